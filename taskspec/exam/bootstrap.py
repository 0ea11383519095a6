"""Numbers over seeds with bootstrap intervals: each carries what it would have been on other draws of the seeds."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
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
