"""Whether scores of seeds differ: by how much, within which interval, and whether that is more than chance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exam.bootstrap import estimate, mean
from taskspec.extras import need

Array = np.ndarray[Any, Any]
MATTERS = 0.05
"""Differences of mean scores below this are not worth a word."""
ALARM = 0.01
"""How often all comparisons of a kind together may cry wolf, where nothing differs."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference of mean scores, with its 95 % bootstrap interval, and how likely chance alone makes it as large.

    Args:
        chance: of Student's test on both sides: the bootstrap is too sure of few seeds.
    """

    effect: float
    low: float
    high: float
    chance: float

    def is_real(self, among: int) -> bool:
        """Whether it matters, and would stand out among so many comparisons of scores that are all the same."""
        is_beside = not self.low <= 0 <= self.high
        return abs(self.effect) >= MATTERS and is_beside and self.chance < ALARM / among


def paired(now: Sequence[float], then: Sequence[float], key: str) -> Difference | None:
    """How much the first are above the second, seed by seed; None for less than two seeds."""
    apart = np.subtract(now, then)
    if len(apart) < 2:
        return None
    low, high = estimate(apart, mean, key).interval
    return Difference(float(apart.mean()), low, high, _chance(apart.mean(), _error(apart), len(apart) - 1))


def unpaired(now: Sequence[float], then: Sequence[float], key: str) -> Difference | None:
    """How much the first are above the second, seeds having nothing to do with each other; None for less than two of either."""
    if min(len(now), len(then)) < 2:
        return None
    effect = float(np.mean(now) - np.mean(then))
    low, high = estimate(now, mean, f"{key}, now").map(np.subtract, estimate(then, mean, f"{key}, then")).interval
    a, b = _error(np.asarray(now)), _error(np.asarray(then))
    parts = a**4 / (len(now) - 1) + b**4 / (len(then) - 1)
    return Difference(effect, low, high, _chance(effect, math.hypot(a, b), (a**2 + b**2) ** 2 / parts if parts else 1))


def _error(sample: Array) -> float:
    """The standard error of a mean."""
    return float(np.std(sample, ddof=1) / math.sqrt(len(sample)))


def _chance(effect: float, error: float, degrees: float) -> float:
    """How likely a mean is as far from 0 as this if the truth is 0 (Student; for two samples, Welch)."""
    if error <= 1e-12 * abs(effect):
        return 0.0 if effect else 1.0
    return float(2 * need("scipy.special", "exact").stdtr(degrees, -abs(effect) / error))
