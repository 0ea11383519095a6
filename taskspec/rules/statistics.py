"""Numbers over seeds with bootstrap intervals, and whether scores of seeds differ."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.extras import need

# ---------- bootstrap
# Numbers over seeds with bootstrap intervals: each carries what it would have been on other draws of the seeds.

Statistic = Callable[[Array], Array]
"""From samples (..., n) to a number for each (...)."""
RESAMPLES = 10_000
CONFIDENCE = 0.95
SEED = 20201203
"""Of the resampling, so that the same results always have the same intervals."""
DIGITS = 9
"""Decimals to which ends of intervals are compared: what is beyond them is the rounding of floats."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number, and the same number on each draw of the seeds (RESAMPLES,), or (1,) where it rests on none."""

    value: float
    draws: Array

    @classmethod
    def exactly(cls, value: float) -> Estimate:
        return cls(value, np.array([value], float))

    @classmethod
    def between(cls, low: float, high: float) -> Estimate:
        """A number that is somewhere between two: half of the draws are at either end, and so are those of its interval."""
        return cls((low + high) / 2, np.repeat(np.array([low, high], float), RESAMPLES // 2))

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % percentile interval; from -inf to inf where one seed, or none, tells nothing of others."""
        if np.isnan(self.draws).any():
            return -np.inf, np.inf
        tail = 50 * (1 - CONFIDENCE)
        low, high = np.percentile(self.draws, [tail, 100 - tail])
        return round(float(low), DIGITS), round(float(high), DIGITS)

    def map(self, change: Callable[..., Any], *others: Estimate) -> Estimate:
        """A function of this and other numbers, draw by draw."""
        with np.errstate(all="ignore"):
            draws = np.asarray(change(self.draws, *(o.draws for o in others)), float)
            value = float(change(np.float64(self.value), *(np.float64(o.value) for o in others)))
        return Estimate(value, np.where(np.isfinite(draws), draws, np.nan))


def estimate(sample: Sequence[float] | Array, statistic: Statistic, key: str) -> Estimate:
    """A statistic of a sample (n,) over seeds; `key` names the sample, so that two statistics of one share their draws."""
    values = np.asarray(sample, float)
    if len(values) < 2:
        return Estimate(float(statistic(values)), np.array([np.nan]))
    picked = np.random.default_rng([SEED, zlib.crc32(key.encode())]).integers(
        len(values), size=(RESAMPLES, len(values))
    )
    return Estimate(float(statistic(values)), statistic(values[picked]))


def mean(samples: Array) -> Array:
    """Means (...) of samples (..., n)."""
    found: Array = np.mean(samples, axis=-1)
    return found


def deviation(samples: Array) -> Array:
    """Standard deviations (...) of samples (..., n), of a population of which they are draws; 0 for one value."""
    found: Array = np.std(samples, axis=-1, ddof=1 if samples.shape[-1] > 1 else 0)
    return found


# ---------- significance
# Whether scores of seeds differ: by how much, within which interval, and whether that is more than chance.

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
