"""Statistics of samples: confidence intervals of means, bootstrap intervals over seeds, and tests of differences.

The normal approximation fails for rare outcomes: a return of a million with probability 1e-6 leaves no trace in a thousand
episodes. So a claim is contradicted by `mean_interval`, which holds for every distribution with bounds. Verdicts rest on the
exact interval of a success rate over seeds. Rules over scores use percentile bootstrap intervals.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.extras import need
from taskspec.solve.enclosure import Enclosure


def mean_interval(mean: float, error: float, count: int, low: float, high: float, confidence: float) -> Enclosure:
    """Return a confidence interval for the mean of independent numbers between `low` and `high`, for any distribution.

    The narrower of Hoeffding's bound (1963) and the empirical Bernstein bound (Maurer and Pontil 2009, theorem 4), each
    at half the risk.

    Args:
        mean, error: of the sample; `error` is its standard error.
        count: the size of the sample.
        low, high: the bounds of the numbers.
        confidence: the probability with which the interval contains the mean.
    """
    width = high - low
    risk = 1 - confidence
    if not math.isfinite(width):
        return Enclosure(-math.inf, math.inf)
    reach = width * math.sqrt(math.log(4 / risk) / (2 * count))
    if count > 1:
        log = math.log(8 / risk)
        reach = min(reach, error * math.sqrt(2 * log) + 7 * width * log / (3 * (count - 1)))
    found = Enclosure.around(mean, reach * (1 + 1e-9) + 1e-9 * abs(mean))
    return Enclosure(max(found.low, Enclosure.exactly(low).low), min(found.high, Enclosure.exactly(high).high))


# -- rates, and means over seeds --------------------------------------------------------------------------------------

CONFIDENCE = 0.95
DIGITS = 9
"""Decimals that the ends of intervals are rounded to, so that rounding errors of floats do not matter."""
ALIKE = 0.02
"""Scores that differ by less count as one value, where scores have two."""


def rate_interval(successes: int, count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a rate (Clopper and Pearson 1934)."""
    special = need("scipy.special", "exact")
    tail = (1 - CONFIDENCE) / 2
    low = 0.0
    high = 1.0
    if successes > 0:
        low = float(special.betaincinv(successes, count - successes + 1, tail))
    if successes < count:
        high = float(special.betaincinv(successes + 1, count - successes, 1 - tail))
    return low, high


def seeds_interval(sample: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the mean over seeds; (-inf, inf) for fewer than two.

    Student's; where scores have two values only, the exact interval of the share of the larger one. Equal scores have an interval
    of width 0, which says nothing of scores that did not occur: `rate_interval` does.
    """
    values = np.asarray(sample, float)
    count = len(values)
    if count < 2:
        return -math.inf, math.inf
    is_low = values <= values.min() + ALIKE
    is_high = values >= values.max() - ALIKE
    if not (is_low & is_high).any() and (is_low | is_high).all():
        bottom = float(values[is_low].mean())
        top = float(values[is_high].mean())
        low, high = (bottom + share * (top - bottom) for share in rate_interval(int(is_high.sum()), count))
    else:
        tail = (1 - CONFIDENCE) / 2
        error = float(values.std(ddof=1)) / math.sqrt(count)
        reach = -error * float(need("scipy.special", "exact").stdtrit(count - 1, tail))
        low = float(values.mean()) - reach
        high = float(values.mean()) + reach
    return round(low, DIGITS), round(high, DIGITS)


# -- bootstrap --------------------------------------------------------------------------------------------------------

Statistic = Callable[[Array], Array]
"""A function from samples (..., n) to a number for each (...)."""
RESAMPLES = 10_000
SEED = 20201203
"""The seed of the resampling: the same results always have the same intervals."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number, and the same number for each bootstrap sample: (RESAMPLES,), or (1,) where no sample is behind it."""

    value: float
    draws: Array

    @classmethod
    def exactly(cls, value: float) -> Estimate:
        return cls(value, np.array([value], float))

    @classmethod
    def between(cls, low: float, high: float) -> Estimate:
        """Return the estimate of a number between two bounds: half of the bootstrap samples at either bound."""
        return cls((low + high) / 2, np.repeat(np.array([low, high], float), RESAMPLES // 2))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % percentile interval; (-inf, inf) where there are fewer than two seeds."""
        if np.isnan(self.draws).any():
            return -np.inf, np.inf
        tail = 50 * (1 - CONFIDENCE)
        low, high = np.percentile(self.draws, [tail, 100 - tail])
        return round(float(low), DIGITS), round(float(high), DIGITS)

    def map(self, change: Callable[..., Any], *others: Estimate) -> Estimate:
        """Return a function of this and other estimates, applied to each bootstrap sample."""
        with np.errstate(all="ignore"):
            draws = np.asarray(change(self.draws, *(o.draws for o in others)), float)
            value = float(change(np.float64(self.value), *(np.float64(o.value) for o in others)))
        return Estimate(value, np.where(np.isfinite(draws), draws, np.nan))


def estimate(sample: Sequence[float] | Array, statistic: Statistic, key: str) -> Estimate:
    """Return a statistic of a sample (n,) over seeds.

    Args:
        key: the name of the sample: statistics of the same sample share their bootstrap samples.
    """
    values = np.asarray(sample, float)
    if len(values) < 2:
        return Estimate(float(statistic(values)), np.array([np.nan]))
    rng = np.random.default_rng([SEED, zlib.crc32(key.encode())])
    picked = rng.integers(len(values), size=(RESAMPLES, len(values)))
    return Estimate(float(statistic(values)), statistic(values[picked]))


def mean(samples: Array) -> Array:
    """Return the means (...) of samples (..., n)."""
    found: Array = np.mean(samples, axis=-1)
    return found


def deviation(samples: Array) -> Array:
    """Return the sample standard deviations (...) of samples (..., n); 0 for one value."""
    found: Array = np.std(samples, axis=-1, ddof=1 if samples.shape[-1] > 1 else 0)
    return found


# -- significance -----------------------------------------------------------------------------------------------------

MATTERS = 0.05
"""The smallest difference of mean scores that counts."""
ALARM = 0.01
"""The probability of any false alarm among all comparisons of a kind (Bonferroni)."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference of mean scores.

    Args:
        effect: the difference.
        low, high: its 95 % bootstrap interval.
        p_value: of the two-sided t-test; the bootstrap interval alone is too narrow for few seeds.
    """

    effect: float
    low: float
    high: float
    p_value: float

    def is_real(self, among: int) -> bool:
        """Return whether the difference matters, and is significant among this many comparisons."""
        excludes_zero = not self.low <= 0 <= self.high
        return abs(self.effect) >= MATTERS and excludes_zero and self.p_value < ALARM / among


def paired(now: Sequence[float], then: Sequence[float], key: str) -> Difference | None:
    """Return the mean difference of scores of the same seeds; None for fewer than two seeds."""
    differences = np.subtract(now, then)
    if len(differences) < 2:
        return None
    effect = float(differences.mean())
    low, high = estimate(differences, mean, key).interval
    return Difference(effect, low, high, _p_value(effect, _standard_error(differences), len(differences) - 1))


def unpaired(now: Sequence[float], then: Sequence[float], key: str) -> Difference | None:
    """Return the difference of mean scores of independent seeds; None for fewer than two of either."""
    if min(len(now), len(then)) < 2:
        return None
    effect = float(np.mean(now) - np.mean(then))
    low, high = estimate(now, mean, f"{key}, now").map(np.subtract, estimate(then, mean, f"{key}, then")).interval
    a = _standard_error(np.asarray(now))
    b = _standard_error(np.asarray(then))
    parts = a**4 / (len(now) - 1) + b**4 / (len(then) - 1)
    degrees = (a**2 + b**2) ** 2 / parts if parts else 1
    return Difference(effect, low, high, _p_value(effect, math.hypot(a, b), degrees))


def _standard_error(sample: Array) -> float:
    return float(np.std(sample, ddof=1) / math.sqrt(len(sample)))


def _p_value(effect: float, error: float, degrees: float) -> float:
    """Return the two-sided p-value of a mean under Student's t distribution (for two samples, Welch's degrees of freedom)."""
    if error <= 1e-12 * abs(effect):
        return 0.0 if effect else 1.0
    return float(2 * need("scipy.special", "exact").stdtr(degrees, -abs(effect) / error))
