"""How benchmarks are shown: progress while they run, tables of rates, and what they were measured on."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from itertools import groupby
from types import TracebackType
from typing import Any

from taskspec.learn.jobs.code_hash import machine
from taskspec.show.terminal.styled_text import Columns, VisibleText, console
from tests.benchmarks.race import Rate
from tests.benchmarks.starts import MemoryUse, Start

MILLION = 1e6
CLOCKS = {"processor": "processor time, one core", "wall": "wall-clock time"}


class Progress:
    """A bar on standard error, where that is a terminal."""

    def __init__(self, total: float, quiet: bool = False) -> None:
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        err = console(err=True)
        columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
        self._bar = Bar(*columns, console=err, transient=True, disable=quiet or not err.is_terminal)
        self._task = self._bar.add_task("measuring", total=total)

    def __enter__(self) -> Progress:
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bar.stop()

    def tick(self, what: str = "measuring", steps: float = 1) -> None:
        self._bar.update(self._task, advance=steps, description=f"{what:24.24}")


def matrix(rates: Sequence[Rate]) -> Any:
    """Million steps per second, a column for each program and number of lanes; below each task, what the limits are."""
    places = list(dict.fromkeys((r.contestant.program, r.contestant.lanes) for r in rates))
    headers = [f"{short(program)}\n{lanes}" for program, lanes in places]
    table = Columns("million steps/s\nlanes", *headers, "\n±", right=range(1, len(places) + 2))
    for task, mine in groupby(rates, lambda r: r.contestant.task):
        found = {(r.contestant.program, r.contestant.lanes): r for r in mine}
        here = [found.get(place) for place in places]
        table.add_row(VisibleText(task, style="name"), *map(cell, here), widest(found.values()))
        if any(r.limits for r in found.values()):
            table.add_row("  limit", *map(limit_cell, here), "")
            table.add_row("  of limit", *map(share_cell, here), "")
    return table


def sections(rates: Sequence[Rate]) -> Any:
    """Million steps per second: a heading for each task, a row for each program and number of lanes."""
    beside = any(r.contestant.rival for r in rates)
    headers = ("million steps/s", "lanes", "", "±", "limit", "of it", *(["ours ÷ this"] if beside else []))
    table = Columns(*headers, right=range(1, 6))
    for task, mine in groupby(rates, lambda r: r.contestant.task):
        group = list(mine)
        table.add_row(VisibleText(task, style="name"))
        for r in group:
            c = r.contestant
            words = [_ratio(r, group)] if beside else []
            table.add_row(
                f"  {c.program}", f"{c.lanes:,}", cell(r), percent(r.spread), limit_cell(r), share_cell(r), *words
            )
    return table


def short(program: str) -> str:
    """A name that fits above a column."""
    return {"SyncVectorEnv": "Sync", "jax-scan": "jax"}.get(program, program)


def cell(rate: Rate | None) -> Any:
    if rate is None:
        return ""
    text = millions(rate.median)
    return text if rate.met else VisibleText(f"✗{text}", style="bad")


def limit_cell(rate: Rate | None) -> str:
    """The limit of a rate in million steps per second."""
    if rate is None or rate.limit is None:
        return ""
    return millions(rate.limit)


def share_cell(rate: Rate | None) -> str:
    """A rate as a share of its limit: tenths of percent of small ones."""
    if rate is None or rate.of_limit is None:
        return ""
    return f"{100 * rate.of_limit:.{0 if rate.of_limit >= 0.1 else 1}f}%"


def millions(steps_per_second: float) -> str:
    """Three digits, two of small numbers."""
    value = steps_per_second / MILLION
    digits = (2 if value >= 0.1 else 1) - math.floor(math.log10(value)) if value > 0 else 0
    return f"{value:,.{min(max(digits, 0), 6)}f}"


def percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f}%"


def widest(rates: Iterable[Rate]) -> str:
    """The largest of the spreads."""
    return percent(max((r.spread for r in rates if r.spread is not None), default=None))


def ratio_of(rate: Rate, rates: Iterable[Rate]) -> tuple[str, float] | None:
    """The program of ours that a rate of others is compared with, and how many times as fast that is."""
    c = rate.contestant
    for program in () if c.rival is None else (c.rival, "numpy"):
        for r in rates:
            if (r.contestant.task, r.contestant.program, r.contestant.lanes) == (c.task, program, c.lanes):
                return program, r.median / rate.median
    return None


def _ratio(rate: Rate, group: Sequence[Rate]) -> str:
    found = ratio_of(rate, group)
    if found is None:
        return ""
    program, ratio = found
    return f"{ratio:,.{1 if ratio < 100 else 0}f}× on {program}"


def starts(found: Sequence[Start], memories: Sequence[MemoryUse]) -> Any:
    """Seconds to the first step, and bytes for each lane."""
    sizes = {(m.task, m.program): m for m in memories}
    table = Columns("first step after", "cold s", "warm s", "bytes/lane", right=(1, 2, 3))
    for task, mine in groupby(found, lambda s: s.task):
        table.add_row(VisibleText(task, style="name"))
        for s in mine:
            size = sizes.get((s.task, s.program))
            table.add_row(f"  {s.program}", f"{s.cold:.2f}", f"{s.warm:.2f}", f"{size.per_lane:,.0f}" if size else "")
    return table


def footer(what: str, rounds: int, clock: str, packages: Container[str]) -> None:
    """What the numbers above are, and where they come from: the machine, and the versions of packages."""
    found = machine()
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items() if name in packages)
    count = "one round" if rounds == 1 else f"medians of {rounds} rounds"
    text = f"{what}: {count} of {CLOCKS[clock]}; {found['processor']}, {found['cores']} cores; {versions}"
    console().print(text, style="quiet")
