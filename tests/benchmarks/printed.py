"""How benchmarks are shown: progress while they run, tables of rates, and what they were measured on."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from itertools import groupby
from types import TracebackType
from typing import Any

from taskspec.base.extras import machine
from taskspec.base.terminal import Columns, VisibleText, console
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
    """Million steps per second: a row for each task, a column for each program and number of lanes."""
    places = list(dict.fromkeys((r.contestant.program, r.contestant.lanes) for r in rates))
    headers = [f"{short(program)}\n{lanes}" for program, lanes in places]
    table = Columns("million steps/s\nlanes", *headers, "\n±", right=range(1, len(places) + 2))
    for task, mine in groupby(rates, lambda r: r.contestant.task):
        found = {(r.contestant.program, r.contestant.lanes): r for r in mine}
        table.add_row(
            VisibleText(task, style="name"), *(cell(found.get(place)) for place in places), widest(found.values())
        )
    return table


def sections(rates: Sequence[Rate]) -> Any:
    """Million steps per second: a heading for each task, a row for each program, a column for each number of lanes."""
    lanes = sorted({r.contestant.lanes for r in rates})
    beside = any(r.contestant.rival for r in rates)
    headers = ("million steps/s", *map(str, lanes), "±", *(["ours ÷ this"] if beside else []))
    table = Columns(*headers, right=range(1, len(lanes) + 2))
    for task, mine in groupby(rates, lambda r: r.contestant.task):
        group = list(mine)
        table.add_row(VisibleText(task, style="name"))
        for program in dict.fromkeys(r.contestant.program for r in group):
            found = {r.contestant.lanes: r for r in group if r.contestant.program == program}
            cells = [cell(found.get(n)) for n in lanes]
            words = [_ratios(found.values(), group)] if beside else []
            table.add_row(f"  {program}", *cells, widest(found.values()), *words)
    return table


def short(program: str) -> str:
    """A name that fits above a column."""
    return {"SyncVectorEnv": "Sync", "jax-scan": "jax"}.get(program, program)


def cell(rate: Rate | None) -> Any:
    if rate is None:
        return ""
    text = millions(rate.median)
    return text if rate.met else VisibleText(f"✗{text}", style="bad")


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


def _ratios(rates: Iterable[Rate], group: Sequence[Rate]) -> str:
    found = [each for r in rates if (each := ratio_of(r, group))]
    words = " ".join(f"{ratio:,.{1 if ratio < 100 else 0}f}×" for _, ratio in found)
    return f"{words} on {found[0][0]}" if found else ""


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
