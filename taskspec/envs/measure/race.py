"""Contestants, and how they are timed: in turns, round after round."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

Drive = Callable[[], int]
"""Takes a good many steps in all lanes; gives their number."""
Clock = Callable[[], float]
"""Seconds, of processor time or of time."""
CALIBRATION = 0.25
"""A measurement is planned from one that takes at least this share of its time."""


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
    """

    task: str
    program: str
    lanes: int
    make: Callable[[], Drive] = field(compare=False)
    target: float | None = None
    rival: str | None = None


@dataclass(frozen=True, slots=True)
class Rate:
    """Steps per second of a contestant, round by round."""

    contestant: Contestant
    rounds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def spread(self) -> float | None:
        return spread(self.rounds)

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
        }


def spread(values: Sequence[float]) -> float | None:
    """Half the distance between the quartiles, as a share of the median; None for a single value."""
    if len(values) < 2:
        return None
    low, _, high = statistics.quantiles(values, n=4)
    return (high - low) / 2 / statistics.median(values)


def race(
    drives: Sequence[Drive],
    rounds: int,
    seconds: float,
    clock: Clock = time.process_time,
    tick: Callable[[], None] = lambda: None,
) -> list[tuple[float, ...]]:
    """Steps per second of each drive, round by round, taking turns.

    Args:
        seconds: how long each measurement takes, about.
        tick: called after each round.
    """
    passes = [_calibrated(drive, seconds, clock) for drive in drives]
    found = []
    for _ in range(rounds):
        found.append([_rate(drive, count, clock) for drive, count in zip(drives, passes, strict=True)])
        tick()
    return list(zip(*found, strict=True))


def _calibrated(drive: Drive, seconds: float, clock: Clock) -> int:
    """How many passes take so long, after one to warm up."""
    drive()
    passes = 1
    while (took := _timed(drive, passes, clock)[1]) < CALIBRATION * seconds:
        passes *= 4
    return max(1, round(passes * seconds / took))


def _rate(drive: Drive, passes: int, clock: Clock) -> float:
    steps, took = _timed(drive, passes, clock)
    return steps / max(1e-9, took)


def _timed(drive: Drive, passes: int, clock: Clock) -> tuple[int, float]:
    start = clock()
    steps = sum(drive() for _ in range(passes))
    return steps, clock() - start
