"""Seeds and steps, chosen from two short trials of the learner, for an exam within a time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from taskspec.base.diagnostics import Diagnostic, SpecError

PILOTS = (1_000, 4_000)
"""Steps of the two trials on each task: time is a line through both."""
SEEDS = 15
"""Seeds, where there is time for that many."""


def seeds_and_steps(
    seconds: float, pilot: Callable[[int], None], runs: float, most: int, is_fixed: bool
) -> tuple[int, int]:
    """Return how many seeds of how many steps an exam has time for.

    Args:
        seconds: for the whole exam, the two trials included.
        pilot: trains one seed on every task for so many steps.
        runs: how often each seed is trained on every task, twins included.
        most: the most steps.
        is_fixed: whether there are `most` steps, not fewer.

    Raises:
        SpecError: E713 where the time is too short for one seed.
    """
    begin = time.perf_counter()
    took = []
    for steps in PILOTS:
        before = time.perf_counter()
        pilot(min(steps, most))
        took.append(time.perf_counter() - before)
    left = seconds - (time.perf_counter() - begin)
    per_step = max(0.0, (took[1] - took[0]) / (PILOTS[1] - PILOTS[0]))
    start = max(0.0, took[0] - per_step * PILOTS[0])
    if is_fixed:
        fewest = most
    else:
        fewest = min(most, PILOTS[0])
    shortest = runs * (start + per_step * fewest)
    seeds = min(SEEDS, int(left / max(shortest, 1e-9)))
    if seeds < 1:
        needed = math.ceil((seconds - left + shortest) / 60)
        message = f"{seconds:g} s are too short for one seed on every task, which takes about {needed} min"
        raise SpecError([Diagnostic("E713", None, message, "more time, or fewer tasks or twins")])
    if is_fixed or per_step == 0:
        return seeds, most
    affordable = (left / (seeds * runs) - start) / per_step
    return seeds, max(fewest, min(most, _rounded(affordable)))


def _rounded(number: float) -> int:
    if number < 1:
        return 1
    unit = int(10 ** max(0, math.floor(math.log10(number)) - 1))
    return int(number // unit) * unit
