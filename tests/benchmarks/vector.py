"""Vector environments, ours on each backend and others beside them; the start of a process; memory."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer

from taskspec.base.diagnostics import SpecError, TaskspecError, spec_error
from taskspec.base.extras import is_installed, need
from taskspec.cli.console import misuse, print_diagnostics, say, write_json
from taskspec.cli.options import checked_choice
from taskspec.language.registry import load
from taskspec.language.task.task import Task
from taskspec.learn.experiments.speed import Drive
from taskspec.learn.jobs.code_hash import machine
from taskspec.programs import backend_table as select
from taskspec.programs.backend_table import BACKENDS, PROGRAMS, QUICKEST
from taskspec.show.terminal.styled_text import console
from taskspec.tools.targets import files_of, task_in, variants_of
from tests.benchmarks import printed, tables
from tests.benchmarks.chart import draw
from tests.benchmarks.printed import Progress
from tests.benchmarks.race import Contestant, Rate, clock_for, jax_device, ours, rates
from tests.benchmarks.starts import MemoryUse, Start, memory, start_times

CHARTS = (".svg", ".png", ".pdf")
LANES = (1, 64, 1024, 4096)
REPEATS = 3
"""Warm starts of each program."""
MANY_LANES = 1_000_000
"""For how many lanes of `MANY_TASK` memory is also counted."""
MANY_TASK = "RiskyPath"
PACKAGES = (*filter(None, (b.needs for b in BACKENDS.values())), "seals", "gymnax", "envpool")
"""What the project's own table needs, all of it optional."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for."""

    targets: tuple[str, ...]
    parameters: tuple[str, ...]
    programs: tuple[str, ...]
    lanes: tuple[int, ...]
    num_threads: int
    rounds: int
    seconds: float
    starts: bool
    chart: Path | None
    json: bool


@dataclass(slots=True)
class Found:
    """What was measured, and what could not be: of others with a word on why, of ours with the error."""

    clock: str
    jax_device: str | None
    suite: list[Rate] = field(default_factory=list)
    others: list[Rate] = field(default_factory=list)
    starts: list[Start] = field(default_factory=list)
    memories: list[MemoryUse] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    errors: list[TaskspecError] = field(default_factory=list)

    @property
    def rates(self) -> list[Rate]:
        return [*self.suite, *self.others]


@dataclass(frozen=True, slots=True)
class BenchPlan:
    """Groups of contestants that take turns, and programs of tasks whose start is measured."""

    suite: list[list[Contestant]]
    others: list[list[Contestant]]
    starts: list[tuple[Task, str]]


def bench(wanted: Wanted) -> bool:
    """Measure, print, and say whether every target is met."""
    _check(wanted)
    if wanted.num_threads == 1:  # XLA would share every short loop among threads, which takes it many times as long
        os.environ.setdefault("PJRT_NPROC", "1")
    plan = _chosen(wanted) if wanted.targets else _own()
    groups = [*plan.suite, *plan.others]
    device = jax_device({c.program for group in groups for c in group})
    name, clock = clock_for(device, wanted.num_threads)
    found = Found(name, device)
    if not wanted.targets:
        found.missing = {package: "not installed" for package in PACKAGES if not is_installed(package)}
    effort = sum(len(group) * (1 + wanted.rounds * wanted.seconds) for group in groups)
    with Progress(effort + wanted.starts * len(plan.starts) * (1 + REPEATS), quiet=wanted.json) as progress:
        for group in plan.suite:
            found.suite += _raced(group, wanted, clock, found, progress)
        for group in plan.others:
            found.others += _raced(group, wanted, clock, found, progress)
        if wanted.starts:
            _start(plan, found, progress)
    _show(wanted, found)
    return all(rate.met for rate in found.rates)


# -- what to measure ----------------------------------------------------------------------------------------------


def _check(wanted: Wanted) -> None:
    """Refuse, before anything is measured, what means nothing or could not be written."""
    for program in wanted.programs:
        checked_choice("--backend", program, PROGRAMS)
    if not wanted.targets and (wanted.parameters or wanted.programs or wanted.lanes or wanted.num_threads > 1):
        hint = "for example: python -m tests.benchmarks vector derail --backend numba"
        raise misuse(
            "-p, --backend, --lanes and --num-threads need a TASK: the project's own benchmarks set them", hint
        )
    if wanted.chart is not None:
        if wanted.chart.suffix.lower() not in CHARTS:
            raise misuse(f"--chart is a file that ends in {', '.join(CHARTS)}, not '{wanted.chart.name}'")
        need("matplotlib", "figures")


def _own() -> BenchPlan:
    """The project's own table."""
    programs = ("scalar", *filter(select.installed, BACKENDS))
    starts = [(load(f"derail/{name}-v0"), p) for name in tables.STARTS for p in programs]
    return BenchPlan(tables.own(), tables.games(), starts)


def _chosen(wanted: Wanted) -> BenchPlan:
    """The tasks that were named, each on its programs, for every number of lanes."""
    groups = []
    starts = []
    for task in _tasks(wanted):
        programs = _programs(task, wanted.programs)
        groups.append([c for p in programs for c in _contestants(task, p, wanted)])
        starts += [(task, p) for p in dict.fromkeys(p.removesuffix("-scan") for p in programs)]
    return BenchPlan([], groups, starts)


def _tasks(wanted: Wanted) -> Iterator[Task]:
    for file in files_of(wanted.targets, wanted.parameters):
        for variant in variants_of(file):
            yield task_in(file, variant)


def _programs(task: Task, asked: Sequence[str]) -> list[str]:
    """Those that were asked for, else all that are installed and suit the task.

    Raises:
        SpecError: E705 for one that is not installed.
    """

    for program in asked:
        if program != "scalar":
            select.choose(task, program.removesuffix("-scan"))
    if asked:
        return list(dict.fromkeys(asked))
    ready = [name for name in BACKENDS if select.installed(name) and select.suits(name, task)]
    return ["scalar", *(p for p in QUICKEST if p.removesuffix("-scan") in ready)]


def _contestants(task: Task, program: str, wanted: Wanted) -> Iterator[Contestant]:
    for lanes in (1,) if program == "scalar" else dict.fromkeys(wanted.lanes or LANES):
        target = tables.target_of(task, program, lanes) if wanted.num_threads == 1 else None
        yield ours(task, program, lanes, num_threads=wanted.num_threads, target=target)


# -- measuring ----------------------------------------------------------------------------------------------------


def _raced(group: Sequence[Contestant], wanted: Wanted, clock: Any, found: Found, progress: Progress) -> list[Rate]:
    """The rates of those in a group that run."""
    ready: list[tuple[Contestant, Drive]] = []
    for contestant in group:
        progress.tick(contestant.task)
        drive = _made(contestant, found)
        if drive is not None:
            ready.append((contestant, drive))
    effort = len(group) * wanted.seconds
    return rates(ready, wanted.rounds, wanted.seconds, clock, lambda: progress.tick(group[0].task, effort))


def _made(contestant: Contestant, found: Found) -> Drive | None:
    """What drives a contestant; None, with a note, where it does not run."""
    c = contestant
    try:
        return c.make()
    except TaskspecError as error:
        found.errors.append(error)
    except MemoryError:
        found.errors.append(
            spec_error("E713", f"there is no memory for {c.lanes:,} lanes of {c.task} on {c.program}", "fewer --lanes")
        )
    except Exception as error:
        if c.program in PROGRAMS:
            raise
        found.missing[c.program] = f"{type(error).__name__}: {error}"  # the code of others: we go on without it
    return None


def _start(plan: BenchPlan, found: Found, progress: Progress) -> None:
    """Starts of processes, and memory of what was started."""
    for task, program in plan.starts:
        before = time.perf_counter()
        try:
            found.starts.append(start_times(task, program, REPEATS))
            if program != "scalar":
                found.memories.append(memory(task, program))
                if plan.suite and task.name == MANY_TASK:
                    found.memories.append(memory(task, program, MANY_LANES))
        except TaskspecError as error:
            found.errors.append(error)
        progress.tick(f"{task.name}: starting, {time.perf_counter() - before:.0f} s", 1 + REPEATS)


# -- output -------------------------------------------------------------------------------------------------------


def _show(wanted: Wanted, found: Found) -> None:
    if wanted.json:
        _print_json(wanted, found)
    else:
        _print(wanted, found)
    if wanted.chart is not None and found.rates:
        draw(found.rates, wanted.chart)
        say(f"wrote {wanted.chart}", err=wanted.json)
    if found.errors:
        _report(found.errors)


def _report(errors: Sequence[TaskspecError]) -> None:
    """What went wrong, once for each; the command fails."""
    print_diagnostics(dict.fromkeys(d for error in errors if isinstance(error, SpecError) for d in error.diagnostics))
    for error in errors:
        if not isinstance(error, SpecError):
            say(f"error: {error}", err=True)
    raise typer.Exit(1)


def _print(wanted: Wanted, found: Found) -> None:
    out = console(wide=True)
    tables = [
        printed.matrix(found.suite) if found.suite else None,
        printed.sections(found.others) if found.others else None,
        printed.starts(found.starts, found.memories) if found.starts else None,
    ]
    for table in filter(None, tables):
        out.print(table)
        out.print()
    notes = list(_notes(found))
    for note in notes:
        console().print(note, style="quiet")
    if notes:
        out.print()
    threads = f", {wanted.num_threads} threads on Numba" if wanted.num_threads > 1 else ""
    printed.footer(f"steps per second, with resets{threads}", wanted.rounds, found.clock, _packages(wanted, found))


def _packages(wanted: Wanted, found: Found) -> set[str]:
    """Those that the numbers rest on."""
    backends = {r.contestant.program.removesuffix("-scan") for r in found.rates}
    return {"python", "numpy", "gymnasium", *backends, *(() if wanted.targets else PACKAGES)}


def _notes(found: Found) -> Iterator[str]:
    """What the tables leave to say."""
    aimed = [r for r in found.rates if r.contestant.target is not None]
    for r in aimed:
        if not r.met:
            c = r.contestant
            place = f"{c.task} on {c.program}, {c.lanes} lanes"
            yield f"missed: {place}: {printed.millions(r.median)} of {printed.millions(c.target or 0)} million steps/s"
    if aimed:
        yield f"{sum(r.met for r in aimed)} of {len(aimed)} targets met"
    many = [f"{m.bytes / 1e6:,.0f} MB on {m.program}" for m in found.memories if m.lanes == MANY_LANES]
    if many:
        yield f"{MANY_LANES:,} lanes of {MANY_TASK} hold {', '.join(many)}"
    for name, why in found.missing.items():
        yield f"{name}: not measured ({why})"


def _print_json(wanted: Wanted, found: Found) -> None:
    results = []
    for rate in found.rates:
        program, ratio = printed.ratio_of(rate, found.rates) or (None, None)
        results.append(rate.data() | {"beside": program, "ratio": ratio})
    write_json(
        {
            "machine": machine(),
            "jax_device": found.jax_device,
            "clock": found.clock,
            "num_threads": wanted.num_threads,
            "rounds": wanted.rounds,
            "seconds": wanted.seconds,
            "results": results,
            "starts": [start.data() for start in found.starts],
            "memory": [memory.data() for memory in found.memories],
            "missing": found.missing,
        }
    )
