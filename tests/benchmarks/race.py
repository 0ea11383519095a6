"""Contestants and their rates: programs of taskspec, and those of others."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.envs.env import Environment
from taskspec.language.task.task import Task
from taskspec.learn.experiments.speed import Clock, Drive, passes_in, rate, scalar, vector
from tests.benchmarks.limit import limit


@dataclass(frozen=True, slots=True)
class Contestant:
    """Something that steps a task: a program of ours, or that of somebody else.

    Args:
        task: what is stepped.
        program: what steps it.
        lanes: how many environments are stepped together.
        make: gets it ready, compiled and warm.
        target: steps per second that it has to reach.
        rival: the program of ours to compare it with, where it steps the same task.
        limit: what no program of this task can exceed; None where that is not known.
    """

    task: str
    program: str
    lanes: int
    make: Callable[[], Drive] = field(compare=False)
    target: float | None = None
    rival: str | None = None
    limit: Callable[[], Drive] | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Rate:
    """Steps per second of a contestant, round by round, and those of its limit, where that is known."""

    contestant: Contestant
    rounds: tuple[float, ...]
    limits: tuple[float, ...] | None = None

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def spread(self) -> float | None:
        return spread(self.rounds)

    @property
    def limit(self) -> float | None:
        return None if self.limits is None else statistics.median(self.limits)

    @property
    def of_limit(self) -> float | None:
        """The rate as a share of its limit."""
        if self.limits is None:
            return None
        return statistics.median(a / b for a, b in zip(self.rounds, self.limits, strict=True))

    @property
    def met(self) -> bool:
        return self.contestant.target is None or self.median >= self.contestant.target

    def data(self) -> dict[str, Any]:
        """As plain data."""
        c = self.contestant
        return {
            "task": c.task,
            "program": c.program,
            "lanes": c.lanes,
            "steps_per_second": self.median,
            "spread": self.spread,
            "rounds": list(self.rounds),
            "target": c.target,
            "met": self.met,
            "limit": self.limit,
            "of_limit": self.of_limit,
        }


def spread(values: Sequence[float]) -> float | None:
    """Half the distance between the quartiles, as a share of the median; None for a single value."""
    if len(values) < 2:
        return None
    low, _, high = statistics.quantiles(values, n=4)
    return (high - low) / 2 / statistics.median(values)


def label(task: Task) -> str:
    """The id of a task, and the parameters that differ from their defaults."""
    changed = [f"{p.name}={p.value}" for p in task.parameters if p.value != p.default]
    return " ".join([task.id, *changed])


def ours(
    task: Task,
    program: str,
    lanes: int = 1,
    *,
    name: str | None = None,
    num_threads: int = 1,
    target: float | None = None,
) -> Contestant:
    """One of `taskspec.programs.backend_table.PROGRAMS`; a task goes by its `label` unless another name is given."""

    def make() -> Drive:
        match program:
            case "scalar":
                return scalar(Environment(task))
            case "jax-scan":
                from tests.benchmarks.scan import scan

                return scan(task, lanes)
            case backend:
                return vector(task, backend, lanes, num_threads)

    return Contestant(name or label(task), program, lanes, make, target, limit=lambda: limit(task, program, lanes))


def jax_device(programs: Iterable[str]) -> str | None:
    """The platform that JAX runs on, where it is among the programs: cpu, gpu or tpu."""
    if not any(program.startswith("jax") for program in programs):
        return None
    from tests.benchmarks.scan import device

    return device()


def clock_for(device: str | None, num_threads: int = 1) -> tuple[str, Clock]:
    """The clock that is fair to all: processor time, which others on the machine do not lengthen.

    Several threads, and accelerators, are measured by time as it passes.
    """
    if num_threads > 1 or device not in (None, "cpu"):
        return "wall", time.perf_counter
    return "processor", time.process_time


def rates(
    ready: Sequence[tuple[Contestant, Drive]], rounds: int, seconds: float, clock: Clock,
    tick: Callable[[], None] = lambda: None,
) -> list[Rate]:  # fmt: skip
    """Measure contestants and their limits in turns; arguments as those of `race`."""
    drives = [drive for _, drive in ready]
    limits = [c.limit() for c, _ in ready if c.limit is not None]
    found = race([*drives, *limits], rounds, seconds, clock, tick)
    of_limits = iter(found[len(drives) :])
    return [
        Rate(c, own, None if c.limit is None else next(of_limits)) for (c, _), own in zip(ready, found, strict=False)
    ]


def race(
    drives: Sequence[Drive],
    rounds: int,
    seconds: float,
    clock: Clock = time.process_time,
    tick: Callable[[], None] = lambda: None,
) -> list[tuple[float, ...]]:
    """Measure drives in turns, round after round, so that a slow moment of the machine meets all of them.

    Args:
        drives: what is measured.
        rounds: the number of measurements of each drive.
        seconds: the approximate duration of a measurement.
        clock: processor time unless given.
        tick: called after each round.

    Returns:
        The steps per second of each drive, round by round.
    """
    passes = [passes_in(drive, seconds, clock) for drive in drives]
    found = []
    for _ in range(rounds):
        found.append([rate(drive, count, clock) for drive, count in zip(drives, passes, strict=True)])
        tick()
    return list(zip(*found, strict=True))
