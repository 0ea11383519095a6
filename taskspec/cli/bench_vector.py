"""The vector environments on every backend that is installed: against their targets, and beside what others offer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taskspec.envs.measure import Contestant, Rate


def bench(tasks: Sequence[str], rounds: int, seconds: float, json: bool) -> bool:
    """Measure, print, and say whether every target is met."""
    from taskspec.envs import measure

    found = [rate for group in _groups(tasks) for rate in measure.race(group, rounds, seconds)]
    _print_json(found, rounds, seconds) if json else _print(found)
    return all(rate.met for rate in found)


def _groups(tasks: Sequence[str]) -> list[list[Contestant]]:
    """What is measured in turns: our own table a backend at a time, then others."""
    from taskspec.envs import measure
    from taskspec.registry import load

    rows = measure.table(load, tasks)
    places = list(dict.fromkeys((c.name.split(" on ")[1], c.lanes) for c in rows))
    groups = [[c for c in rows if (c.name.split(" on ")[1], c.lanes) == place] for place in places]
    return groups if tasks else [*groups, _others()]


def _others() -> list[Contestant]:
    from taskspec.envs import measure

    found = [measure.gymnasium_cart_pole(1024)]
    if measure.installed("seals"):
        found.append(measure.seals_sync("seals/RiskyPath-v0"))
    if measure.installed("envpool"):
        found.append(measure.envpool_cart_pole(64))
    if measure.installed("gymnax"):
        found += [measure.gymnax(name, 4096) for name in ("CartPole-v1", "DeepSea-bsuite", "Catch-bsuite")]
    return found


def _print(rates: Sequence[Rate]) -> None:
    from rich.text import Text

    from taskspec.cli.console import columns, console

    table = columns("", "program", "lanes", "million steps/s", "spread", "target", right=(2, 3, 4, 5))
    for r in rates:
        mark = Text("") if r.target is None else Text("✓", style="good") if r.met else Text("✗", style="bad")
        low, high = min(r.rounds) / 1e6, max(r.rounds) / 1e6
        target = "" if r.target is None else f"{r.target / 1e6:g}"
        table.add_row(
            mark, Text(r.name, style="name"), str(r.lanes), f"{r.median / 1e6:.3g}", f"{low:.3g}–{high:.3g}", target
        )
    out = console(wide=True)
    out.print(table)
    out.print(f"\nmedians of {len(rates[0].rounds)} rounds, of processor time; autoreset on", style="quiet")


def _print_json(rates: Sequence[Rate], rounds: int, seconds: float) -> None:
    from taskspec.cli.console import write_json

    write_json({"rounds": rounds, "seconds": seconds, "results": [rate.data() for rate in rates]})
