"""Environments as `gymnasium.make` gives them, against those of seals: same dynamics, same process, taking turns."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.extras import need
from taskspec.cli.console import write_json
from taskspec.learn.jobs.code_hash import machine
from taskspec.show.terminal.styled_text import Columns, VisibleText, console
from tests.benchmarks.peers import empty_scalar
from tests.benchmarks.printed import Progress, footer, percent
from tests.benchmarks.race import race, spread
from tests.benchmarks.tables import PAIRS, Pair, pair


@dataclass(frozen=True, slots=True)
class Result:
    """Steps per second of both sides, round by round; those of an empty step too, where one environment is measured."""

    pair: Pair
    ours: tuple[float, ...]
    theirs: tuple[float, ...]
    target: float | None
    empty: tuple[float, ...] | None = None

    @property
    def ratios(self) -> tuple[float, ...]:
        return tuple(a / b for a, b in zip(self.ours, self.theirs, strict=True))

    @property
    def ratio(self) -> float:
        return statistics.median(self.ratios)

    @property
    def of_empty(self) -> float | None:
        """Our rate as a share of that of an empty step."""
        if self.empty is None:
            return None
        return statistics.median(a / b for a, b in zip(self.ours, self.empty, strict=True))

    @property
    def met(self) -> bool:
        return self.target is None or self.ratio >= self.target


def bench(names: Sequence[str], lanes: int | None, backend: str, rounds: int, seconds: float, json: bool) -> bool:
    """Measure, print, and say whether every target is met."""
    need("seals", "bench", "this benchmark")  # registers its environments
    pairs = _chosen(names)
    with Progress(len(pairs) * rounds, quiet=json) as progress:
        results = [_raced(each, lanes, backend, rounds, seconds, progress) for each in pairs]
    _print_json(results, lanes, backend, rounds, seconds) if json else _print(results, lanes)
    return all(result.met for result in results)


def _chosen(names: Sequence[str]) -> list[Pair]:
    pairs = PAIRS
    known = {name: pair for pair in pairs for name in (pair.theirs, pair.ours, pair.ours.removesuffix("Seals"))}
    for name in names:
        if name not in known:
            hint = suggest(name, known) or ", ".join(pair.theirs for pair in pairs)
            raise spec_error("E701", f"the benchmark has no task '{name}'", hint)
    return list(dict.fromkeys(known[name] for name in names)) if names else list(pairs)


def _raced(task: Pair, lanes: int | None, backend: str, rounds: int, seconds: float, progress: Progress) -> Result:
    sides = pair(task, lanes, backend)
    drives = [side.make() for side in sides]
    if lanes is None:
        drives.append(empty_scalar())
    ours, theirs, *empty = race(drives, rounds, seconds, tick=progress.tick)
    return Result(task, ours, theirs, sides[0].target, *empty)


# -- output -------------------------------------------------------------------------------------------------------


def _print(results: Sequence[Result], lanes: int | None) -> None:
    target = ["target", "of empty"] if lanes is None else []
    table = Columns(
        "", "task", "taskspec", "±", "seals", "±", "ratio", "spread", *target, right=range(2, 8 + len(target))
    )
    for r in results:
        mark = (
            VisibleText("")
            if r.target is None
            else VisibleText("✓", style="good")
            if r.met
            else VisibleText("✗", style="bad")
        )
        low = min(r.ratios)
        high = max(r.ratios)
        table.add_row(
            mark, VisibleText(r.pair.theirs, style="name"), f"{statistics.median(r.ours):,.0f}", percent(spread(r.ours)),
            f"{statistics.median(r.theirs):,.0f}", percent(spread(r.theirs)),
            VisibleText(f"{r.ratio:.1f}×", style="title"),
            f"{low:.0f}–{high:.0f}", *([] if r.target is None else [f"{r.target:.0f}×", percent(r.of_empty)]),
        )  # fmt: skip
    out = console(wide=True)
    out.print(table)
    out.print()
    packages = ["python", "numpy", "gymnasium", "seals", *([] if lanes is None else ["numba"])]
    what = "" if lanes is None else f", {lanes} lanes, theirs in SyncVectorEnv"
    shown = f"steps per second, resets included{what}"
    rates = [rate for r in results for rate in r.empty or ()]
    if rates:
        shown = f"{shown}; an empty step: {statistics.median(rates):,.0f}"
    footer(shown, len(results[0].ours), "processor", packages)


def _print_json(results: Sequence[Result], lanes: int | None, backend: str, rounds: int, seconds: float) -> None:
    rows: list[dict[str, Any]] = [
        {
            "task": r.pair.task, "seals": r.pair.rival, "ratio": r.ratio, "target": r.target,
            "met": r.met, "of_empty": r.of_empty,
            "steps_per_second": statistics.median(r.ours), "seals_steps_per_second": statistics.median(r.theirs),
            "rounds": {"taskspec": list(r.ours), "seals": list(r.theirs)},
        }
        for r in results
    ]  # fmt: skip
    settings = {"lanes": lanes, "backend": None if lanes is None else backend, "rounds": rounds, "seconds": seconds}
    write_json({"machine": machine(), "clock": "processor", **settings, "results": rows})
