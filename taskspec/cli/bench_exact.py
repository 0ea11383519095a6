"""Exact models: a slippery grid world built and solved, beside Storm where it is installed, and beside plain loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from taskspec.cli.console import say

if TYPE_CHECKING:
    from taskspec.solve.benchmark import Timing

TARGETS = {"storm": 3.0, "loops": 100.0}
"""How many times as long others should take, by a part of their name."""


def bench(rounds: int, json: bool) -> bool:
    """Measure, print, and say whether every target is met."""

    from taskspec.cli.console import write_json
    from taskspec.solve import benchmark

    timings = benchmark.run(repeat=rounds)
    if json:
        write_json(benchmark.record(timings))
    else:
        say(benchmark.table(timings))
    return all(_met(timings, name, factor) for name, factor in TARGETS.items())


def _met(timings: Sequence[Timing], name: str, factor: float) -> bool:
    """Whether a rival, where it was measured, took that many times as long as ours on the same grid."""
    for rival in (t for t in timings if name in t.name.lower()):
        own = next(t for t in timings if t.name == "taskspec" and t.states == rival.states)
        if rival.total < factor * own.total:
            return False
    return True
