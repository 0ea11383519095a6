"""Confidence intervals that hold whatever the distribution, for means of numbers that have bounds.

A normal approximation says nothing of what was not seen: a return of a million that comes with probability 1e-6 leaves no
trace in a thousand episodes. Where a claim is contradicted, it is by these intervals.
"""

from __future__ import annotations

import math

from taskspec.lang.ir import Const
from taskspec.solve.enclosure import Enclosure
from taskspec.task.task import Task

CUT = 1e-12
"""The discount at which simulated episodes are cut off."""


def mean_interval(mean: float, error: float, count: int, low: float, high: float, confidence: float) -> Enclosure:
    """Where the mean of independent numbers between `low` and `high` lies, at a confidence.

    The narrower of Hoeffding's bound (1963) and the empirical Bernstein bound (Maurer and Pontil 2009, theorem 4), each
    at half the risk.

    Args:
        mean, error: of the sample; `error` is its standard error.
        count: how many numbers.
    """
    width, risk = high - low, 1 - confidence
    if not math.isfinite(width):
        return Enclosure(-math.inf, math.inf)
    reach = width * math.sqrt(math.log(4 / risk) / (2 * count))
    if count > 1:
        log = math.log(8 / risk)
        reach = min(reach, error * math.sqrt(2 * log) + 7 * width * log / (3 * (count - 1)))
    found = Enclosure.around(mean, reach * (1 + 1e-9) + 1e-9 * abs(mean))
    ends = Enclosure.exactly(low), Enclosure.exactly(high)
    return Enclosure(max(found.low, ends[0].low), min(found.high, ends[1].high))


def return_range(task: Task) -> tuple[float, float]:
    """What the return of an episode can be at least and at most, as far as bounds of the reward tell."""
    low, high = (float(v) for v in task.builder.bounds(task.reward))
    weight = _weight(task)
    if not (isinstance(task.terminal, Const) and not task.terminal.value):
        low, high = min(low, 0.0), max(high, 0.0)
    cut = CUT * weight * max(abs(low), abs(high)) if task.discount < 1 else 0.0
    ends = [0.0 if end == 0 else weight * end for end in (low, high)]
    return ends[0] * _outward(ends[0], -1) - cut, ends[1] * _outward(ends[1], 1) + cut


def _outward(end: float, sign: int) -> float:
    """A factor that moves an end outwards by more than sums of floats can be off."""
    return 1 + 1e-9 * (sign if end > 0 else -sign)


def _weight(task: Task) -> float:
    """The discounts of all steps of the longest episode together: of every episode, where none terminates."""
    steps, gap = math.inf if task.horizon is None else float(task.horizon), 1 - task.discount
    if gap in (0, 1):
        return steps if gap == 0 else 1.0
    return -math.expm1(steps * math.log1p(-gap)) / gap  # 1 - discount**steps would cancel for discounts near 1
