"""Statistics of samples: confidence intervals of rates and other numbers over seeds, and tests of differences.

Verdicts rest on the
exact interval of a success rate over seeds, rules on exact and studentised intervals of numbers over seeds. Two samples of
seeds are compared by permutation tests.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from statistics import NormalDist
from typing import Any, Literal, TypeVar

import numpy as np
from scipy import special

from taskspec.base.arrays import Array
from taskspec.exact.solve.enclosure import CONFIDENCE as CONFIDENCE

Name = TypeVar("Name", bound=Hashable)


DIGITS = 9  # decimals that the ends of intervals are rounded to, so that rounding errors of floats do not matter
ALIKE = 0.02  # scores that differ by less count as one value, where scores have two


def rate_interval(successes: int, count: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the exact interval of a rate (Clopper and Pearson 1934), by default the 95 % one."""
    tail = (1 - confidence) / 2
    low, high = _rate_quantiles(successes, count, (tail, 1 - tail)).tolist()
    return low, high


def seeds_interval(sample: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the mean over seeds; (-inf, inf) for fewer than two.

    Student's; where scores have two values only, the exact interval of the share of the larger one. Equal scores have an interval
    of width 0, which says nothing of scores that did not occur: `rate_interval` does.
    """
    values = np.asarray(sample, float)
    if len(values) < 2:
        return -math.inf, math.inf
    tail = (1 - CONFIDENCE) / 2
    low, high = _mean_quantiles(values, (tail, 1 - tail))
    return round(float(low), DIGITS), round(float(high), DIGITS)


DRAWS = 10_000
LEVELS = tuple((i + 0.5) / DRAWS for i in range(DRAWS))
"""The levels of the quantiles that are drawn, each once."""
SEED = 20201203  # the seed of the draws: the same results always have the same intervals


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number, and draws from its confidence distribution: (DRAWS,), or (1,) where no sample is behind it.

    The confidence distribution of a number (Xie and Singh 2013) is the one whose quantiles are the ends of its intervals: of
    a mean, Student's distribution around the mean of the sample. Functions of several numbers are computed draw by draw.
    """

    value: float
    draws: Array
    _intervals: dict[float, tuple[float, float]] = field(default_factory=dict, repr=False)

    @classmethod
    def exactly(cls, value: float) -> Estimate:
        return cls(value, np.array([value], float))

    @classmethod
    def between(cls, low: float, high: float) -> Estimate:
        """Return the estimate of a number between two bounds: half of the draws at either bound."""
        return cls((low + high) / 2, np.repeat(np.array([low, high], float), DRAWS // 2))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval; (-inf, inf) where there are too few seeds for one."""
        return self.interval_at(CONFIDENCE)

    def interval_at(self, confidence: float) -> tuple[float, float]:
        """Return the interval of another confidence."""
        if confidence not in self._intervals:
            low = -np.inf
            high = np.inf
            if not np.isnan(self.draws).any():
                tail = 50 * (1 - confidence)
                low, high = np.percentile(self.draws, [tail, 100 - tail])
            self._intervals[confidence] = round(float(low), DIGITS), round(float(high), DIGITS)
        return self._intervals[confidence]

    def map(self, change: Callable[..., Any], *others: Estimate) -> Estimate:
        """Return a function of this and other estimates, applied to each draw."""
        with np.errstate(all="ignore"):
            draws = np.asarray(change(self.draws, *(o.draws for o in others)), float)
            value = float(change(np.float64(self.value), *(np.float64(o.value) for o in others)))
        return Estimate(value, np.where(np.isfinite(draws), draws, np.nan))


Statistic = Literal["mean", "sd", "median", "highest", "lowest"]


def estimate(sample: Sequence[float] | Array, statistic: Statistic, key: str) -> Estimate:
    """Estimate a statistic of a sample (n,) over seeds.

    Means have the interval of `seeds_interval`, standard deviations the interval of Bonett (2006), which does not need normal
    scores, medians the interval of the order statistics. The highest and the lowest are of the seeds that were run.

    Args:
        key: the name of the sample: statistics of the same sample share their draws.
    """
    values = np.sort(np.asarray(sample, float))
    rng = np.random.default_rng([SEED, zlib.crc32(key.encode())])
    order = rng.permutation(DRAWS)
    if len(values) < 2:
        return Estimate(float(values.mean()) if statistic != "sd" else 0.0, np.array([np.nan]))
    match statistic:
        case "mean":
            return Estimate(float(values.mean()), _mean_quantiles(values, LEVELS)[order])
        case "sd":
            return Estimate(float(values.std(ddof=1)), _sd_quantiles(values, LEVELS)[order])
        case "median":
            return Estimate(float(np.median(values)), _median_quantiles(values, LEVELS)[order])
        case "highest":
            return Estimate.exactly(float(values[-1]))
        case "lowest":
            return Estimate.exactly(float(values[0]))


def _two_values(values: Array) -> tuple[float, float, int] | None:
    """Return the lower value, the higher one, and the number of the higher ones; None where there are not just two."""
    is_low = values <= values.min() + ALIKE
    is_high = values >= values.max() - ALIKE
    if (is_low & is_high).any() or not (is_low | is_high).all():
        return None
    return float(values[is_low].mean()), float(values[is_high].mean()), int(is_high.sum())


@lru_cache(maxsize=64)
def _rate_quantiles(successes: int, count: int, levels: tuple[float, ...]) -> Array:
    """Return the quantiles of a rate: ends of Clopper-Pearson intervals, lower ones below 1/2, upper ones above."""
    low = np.zeros(len(levels))
    high = np.ones(len(levels))
    if successes > 0:
        low = special.betaincinv(successes, count - successes + 1, levels)
    if successes < count:
        high = special.betaincinv(successes + 1, count - successes, levels)
    return np.where(np.array(levels) < 0.5, low, high)


def _mean_quantiles(values: Array, levels: tuple[float, ...]) -> Array:
    count = len(values)
    two = _two_values(values)
    if two is not None:
        bottom, top, successes = two
        return bottom + (top - bottom) * _rate_quantiles(successes, count, levels)
    error = float(values.std(ddof=1)) / math.sqrt(count)
    return values.mean() + error * _student_quantiles(count - 1, levels)


@lru_cache(maxsize=64)
def _student_quantiles(freedom: int, levels: tuple[float, ...]) -> Array:
    return special.stdtrit(freedom, levels)


def _sd_quantiles(values: Array, levels: tuple[float, ...]) -> Array:
    """Return the quantiles of a standard deviation; NaN for fewer than five values that are not equal."""
    count = len(values)
    variance = float(values.var(ddof=1))
    if variance <= ALIKE**2 * 1e-6:
        return np.full(len(levels), math.sqrt(variance))
    if count < 5:
        return np.full(len(levels), np.nan)
    two = _two_values(values)
    if two is not None:
        bottom, top, successes = two
        rate = _rate_quantiles(successes, count, levels)
        return (top - bottom) * np.sqrt(rate * (1 - rate) * count / (count - 1))
    trimmed = int(count / (2 * math.sqrt(count - 4)))
    middle = float(values[trimmed : count - trimmed].mean())
    kurtosis = count * float(((values - middle) ** 4).sum()) / ((count - 1) * variance) ** 2
    deviations = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
    correction = count / (count - deviations)
    error = correction * math.sqrt(max(0.0, kurtosis - (count - 3) / count) / (count - 1))
    logs = math.log(correction * variance) + error * special.ndtri(levels)
    return np.exp(logs / 2)


def _median_quantiles(values: Array, levels: tuple[float, ...]) -> Array:
    """Return the quantiles of a median: ends of intervals between order statistics; NaN for fewer than six values."""
    count = len(values)
    below = np.cumsum([math.comb(count, k) / 2**count for k in range(count + 1)])
    if below[0] > (1 - CONFIDENCE) / 2:
        return np.full(len(levels), np.nan)
    at = np.array(levels)
    tails = np.minimum(at, 1 - at)
    rank = np.clip(np.searchsorted(below, tails, side="right") - 1, 0, (count - 1) // 2)
    return np.where(at < 0.5, values[rank], values[count - 1 - rank])


MATTERS = 0.05  # the smallest difference of mean scores that counts
ALARM = 0.01  # the probability of any false alarm among all comparisons of a kind
MOST_PERMUTATIONS = 20_000  # permutations that are tried: all of them, or so many at random


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference of mean scores of two samples.

    Args:
        effect: the difference.
        low, high: its 95 % interval, Welch's; None where a sample has fewer than two scores.
        p_value: of the permutation test, corrected for all comparisons that were made.
        is_together: whether it is the p-value of all comparisons together, where none of them alone is significant.
    """

    effect: float
    low: float | None
    high: float | None
    p_value: float
    is_together: bool = False

    @property
    def is_real(self) -> bool:
        """True if the difference matters and is significant."""
        return abs(self.effect) >= MATTERS and self.p_value <= ALARM


def differences(scores: Array, is_first: Array, only_below: bool | Sequence[bool] = False) -> list[Difference]:
    """Return the differences of the mean scores of two samples in several comparisons, by exact permutation tests.

    The rows of the two samples are permuted, each with its scores in all comparisons. First all comparisons are tested together,
    by the sum of the squares of their differences in standard deviations; then each of them by the largest difference among
    those that are not larger (Westfall and Young 1993), which is closed testing. A p-value is at least the first test's.
    If only the first test is significant, the largest difference has its p-value.

    Args:
        scores: (rows, comparisons), NaN where a row has none.
        is_first: bool (rows,), the rows of the first sample.
        only_below: of all comparisons or of each, whether a mean of the first sample counts only below the mean of the
            second one.
    """
    is_known = ~np.isnan(scores)
    filled = np.where(is_known, scores, 0.0)
    picks = _permutations(is_first).astype(float)
    counts = picks @ is_known
    others = is_known.sum(axis=0) - counts
    sums = picks @ filled
    with np.errstate(all="ignore"):
        effects = sums / counts - (filled.sum(axis=0) - sums) / others
        means = filled.sum(axis=0) / is_known.sum(axis=0)
        spread = np.sqrt((np.where(is_known, scores - means, 0.0) ** 2).sum(axis=0) / is_known.sum(axis=0))
        sizes = np.where((spread > 1e-9) & np.isfinite(effects), effects / spread, 0.0)
    sizes = np.where(only_below, np.maximum(-sizes, 0.0), np.abs(sizes))
    together = _share_as_large((sizes**2).sum(axis=1))
    p_value = together
    by_metric: dict[int, Difference] = {}
    order = np.argsort(-sizes[0], kind="stable").tolist()
    for i, j in enumerate(order):
        largest = sizes[:, order[i:]].max(axis=1)
        largest[0] = sizes[0, j]
        p_value = max(p_value, _share_as_large(largest))
        known = is_known[:, j]
        low, high = _welch_interval(scores[is_first & known, j], scores[~is_first & known, j])
        by_metric[j] = Difference(float(effects[0, j]), low, high, p_value)
    largest_one = by_metric[order[0]]
    if largest_one.p_value > ALARM >= together:
        by_metric[order[0]] = replace(largest_one, p_value=together, is_together=True)
    return [by_metric[j] for j in range(scores.shape[1])]


def compared(
    rows: Mapping[tuple[bool, Any], Mapping[Name, float]],
    names: Sequence[Name],
    only_below: Sequence[bool] | bool = False,
) -> dict[Name, Difference]:
    """Test the differences of two samples, by name.

    Args:
        rows: numbers by name, for each row; its key says whether it is in the first sample, and which one it is.
        names: of the comparisons.
        only_below: as of `differences`.
    """
    if not names:
        return {}
    scores = np.full((len(rows), len(names)), np.nan)
    for i, row in enumerate(rows.values()):
        scores[i] = [row.get(name, np.nan) for name in names]
    is_first = np.array([first for first, _ in rows])
    return dict(zip(names, differences(scores, is_first, only_below), strict=True))


def _permutations(is_first: Array) -> Array:
    """Return which rows are in the first sample, (permutations, rows); in permutation 0 those that are."""
    rows = len(is_first)
    size = int(is_first.sum())
    if math.comb(rows, size) <= MOST_PERMUTATIONS:
        chosen = np.array(list(itertools.combinations(range(rows), size)), int).reshape(-1, size)
    else:
        rng = np.random.default_rng(SEED)
        chosen = rng.random((MOST_PERMUTATIONS, rows)).argsort(axis=1)[:, :size]
    orders = np.zeros((len(chosen), rows), bool)
    np.put_along_axis(orders, chosen, True, axis=1)
    if len(chosen) < MOST_PERMUTATIONS:
        orders = orders[(orders != is_first).any(axis=1)]
    return np.vstack([is_first, orders])


def sign_flip_p_value(gains: Sequence[float]) -> float:
    """Return the p-value of a positive sum of paired gains: the signs of all are flipped, in every way or at random.

    Args:
        gains: differences of pairs, which are as likely positive as negative if nothing is gained.
    """
    if 2 ** len(gains) <= MOST_PERMUTATIONS:
        signs = np.array(list(itertools.product((1, -1), repeat=len(gains))))
    else:
        signs = np.random.default_rng(SEED).choice((1, -1), (MOST_PERMUTATIONS, len(gains)))
        signs[0] = 1
    return _share_as_large(signs @ np.array(gains))


def _share_as_large(statistic: Array) -> float:
    return float(np.mean(statistic >= statistic[0] - 1e-9))


def _welch_interval(first: Array, second: Array) -> tuple[float | None, float | None]:
    if min(len(first), len(second)) < 2:
        return None, None
    effect = float(first.mean() - second.mean())
    with np.errstate(over="ignore"):
        a = first.var(ddof=1) / len(first)
        b = second.var(ddof=1) / len(second)
        parts = a**2 / (len(first) - 1) + b**2 / (len(second) - 1)
    if parts == 0:
        return effect, effect
    if not np.isfinite(parts):
        return None, None
    tail = (1 - CONFIDENCE) / 2
    reach = -math.sqrt(a + b) * float(special.stdtrit((a + b) ** 2 / parts, tail))
    return effect - reach, effect + reach
