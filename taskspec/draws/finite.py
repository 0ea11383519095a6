"""Finite draws: categorical, index, permutation and Poisson, from integer comparisons of words.

Names and shapes are those of `draws`, which re-exports them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taskspec.base.limits import Limits
from taskspec.draws.polynomials import F, Ints, Reals, uniform
from taskspec.draws.threefry import Words

NEVER = 1 << 32  # a threshold above every word
POISSON_SHARE = 64  # the largest mean of one sequential search: exp(64) is well inside float32
POISSON_LIMIT = Limits.poisson


def index(word: int, n: int) -> int:
    """Return an integer below n, for 0 < n < 2^31: (w n) >> 32.

    With 32 bits alone and n <= 2^16: ((w >> 16) n + ((w & 0xffff) n >> 16)) >> 16.
    """
    return word * n >> 32


def indices(words: Words, n: ArrayLike) -> Ints:
    """`index`, elementwise: int32; n broadcasts."""
    product = words.astype(np.uint64) * np.asarray(n).astype(np.uint64)
    return (product >> np.uint64(32)).astype(np.int32)


def thresholds(probabilities: Sequence[Fraction | float]) -> tuple[int, ...]:
    """Return the k - 1 words at which outcomes 1 to k - 1 begin: round(2^32 x cumulative probability).

    Fractions are exact, floats are taken at their exact value, and all are relative to their total.
    An outcome of probability 0 has no words: where it comes first, outcome 1 begins at word 0;
    where it comes last, it begins at 2^32 (`NEVER`), which no word reaches. Thresholds that must
    fit 32 bits may drop the `NEVER` at their end, or go through `threshold_table`.

    What is no distribution means what it means to `weighted_categoricals`: a negative weight and NaN
    count as 0; where all do, or the total is infinite, the outcome is the last one.
    """
    weights = [p if p > 0 else Fraction(0) for p in probabilities]
    if not 0 < sum(weights) < math.inf:
        return (0,) * (len(weights) - 1)
    cumulative = list(accumulate(Fraction(p) for p in weights))
    return tuple(round(NEVER * c / cumulative[-1]) for c in cumulative[:-1])


def categorical(word: int, thresholds: Sequence[int]) -> int:
    """Return the outcome of a word: how many thresholds are at most the word."""
    return bisect_right(thresholds, word)


def categoricals(words: Words, thresholds: Sequence[int] | Words) -> Ints:
    """`categorical`, elementwise: int32 of the same shape. Thresholds as uint32 are those a word can reach."""
    reached = thresholds if isinstance(thresholds, np.ndarray) else reachable(thresholds)
    if len(reached) > 8:
        return np.searchsorted(reached, words, side="right").astype(np.int32)
    result = np.zeros(words.shape, np.int32)
    for threshold in reached:
        result += words >= threshold
    return result


def reachable(thresholds: Sequence[int]) -> Words:
    """Return the thresholds that some word reaches, in 32 bits."""
    return np.array([t for t in thresholds if t < NEVER], np.uint32)


def threshold_table(
    distributions: Sequence[Sequence[Fraction | float]],
) -> tuple[Words, Ints]:
    """Distributions of one size that are chosen by row at run time, in 32 bits.

    Gives thresholds (rows, k - 1), where `NEVER` has become 2^32 - 1, and the last outcome of
    positive probability (rows,), to which a draw is limited so that the difference cannot show.
    """
    table = [thresholds(row) for row in distributions]
    last = [sum(t < NEVER for t in row) for row in table]
    clipped = [[min(t, NEVER - 1) for t in row] for row in table]
    return np.array(clipped, np.uint32), np.array(last, np.int32)


def row_categorical(word: int, row: int, table: Words, last: Ints) -> int:
    """Return a draw from one row of a `threshold_table`."""
    return min(bisect_right(table[row].tolist(), word), int(last[row]))


def row_categoricals(words: Words, row: NDArray[np.integer], table: Words, last: Ints) -> Ints:
    """`row_categorical`, elementwise: int32 of the same shape."""
    reached: Ints = (words[..., None] >= table[row]).sum(axis=-1, dtype=np.int32)
    result: Ints = np.minimum(reached, last[row])
    return result


def weighted_categorical(word: int, weights: Sequence[float]) -> int:
    """Return an outcome in proportion to float32 weights; see `weighted_categoricals`."""
    return int(weighted_categoricals(np.array([word], np.uint32), np.asarray(weights)[:, None])[0])


def weighted_categoricals(words: Words, weights: ArrayLike) -> Ints:
    """Return outcomes in proportion to weights (k, ...) known only at run time: int32 (...).

    How many of the first k - 1 running sums are at most uniform × total. That product rounds to
    less than the total, and a weight of 0 (as a negative one and NaN count) leaves the running sum
    as it was, so outcomes of no weight are never drawn, unless all are.
    """
    with np.errstate(over="ignore"):  # what no float32 holds is infinite
        weight = np.asarray(weights, np.float32)
    sums = list(accumulate(np.where(weight > F(0), weight, F(0))))
    target = uniform(words) * sums[-1]
    result = np.zeros(target.shape, np.int32)
    for partial in sums[:-1]:
        result += partial <= target
    return result


def permutation(words: Sequence[int]) -> tuple[int, ...]:
    """Return the order that sorts the words, equal words keeping theirs."""
    return tuple(sorted(range(len(words)), key=words.__getitem__))


def permutations(words: Words) -> Ints:
    """`permutation` along the first axis: int32 (n, ...) from words (n, ...)."""
    return np.argsort(words, axis=0, kind="stable").astype(np.int32)


# -- Poisson


@lru_cache(maxsize=256)
def poisson_table(rate: float) -> tuple[int, tuple[int, ...]]:
    """``(first, thresholds)``: a draw is first + categorical(word, thresholds).

    The weights run down and up from the mode by + * / alone, so the table is the same everywhere;
    it holds every count that has a word. The rate is limited to [0, 100000], NaN to 0.
    """
    rate = min(rate, POISSON_LIMIT) if rate > 0 else 0.0
    below = list(_poisson_below(rate))
    table = thresholds([*reversed(below), 1.0, *_poisson_above(rate)])
    empty = table.count(0)
    return int(rate) - len(below) + empty, tuple(t for t in table[empty:] if t < NEVER)


_FAINTEST = 2.0**-80


def _poisson_below(rate: float) -> Iterator[float]:
    weight = 1.0
    for k in range(int(rate), 0, -1):
        weight *= k / rate
        if weight < _FAINTEST:
            return
        yield weight


def _poisson_above(rate: float) -> Iterator[float]:
    weight = 1.0
    k = int(rate) + 1
    while (weight := weight * (rate / k)) >= _FAINTEST:
        yield weight
        k += 1


def poisson_words(bound: float) -> int:
    """Return how many words a Poisson draw takes whose rate is at most ``bound``."""
    return max(1, math.ceil(bound / POISSON_SHARE))


def poisson_terms(bound: float) -> int:
    """Return the largest count that one of its words is searched for."""
    first, table = poisson_table(bound / poisson_words(bound))
    return first + len(table)


def poisson(words: Sequence[int], rate: float, bound: float) -> int:
    """Return a Poisson draw whose rate is known only at run time; see `poissons`."""
    return int(poissons(np.array(words, np.uint32)[:, None], np.asarray([rate]), bound)[0])


def poissons(words: Words, rate: ArrayLike, bound: float) -> Ints:
    """Poisson draws: int32 (...) from words (poisson_words(bound), ...) and rates (...).

    The rate is limited to [0, bound] and shared equally among the words. Each word is searched for
    in the running sums of rate^k / k!, times their total: no exponential is needed, and the search
    has a fixed length. As the sums are float32, a probability is off by at most 1e-6.
    """
    given = np.asarray(rate, np.float32)
    limited: Reals = np.minimum(np.where(given > F(0), given, F(0)), F(bound))
    share: Reals = limited / F(poisson_words(bound))
    sums = list(_exponential_sums(share, poisson_terms(bound)))
    target = uniform(words) * sums[-1]
    counts = np.zeros(target.shape, np.int32)
    for partial in sums[:-1]:
        below = partial <= target
        if not below.any():
            break  # nor is any later sum: most rates are far below their bound
        counts += below
    total: Ints = counts.sum(axis=0, dtype=np.int32)
    return total


def _exponential_sums(rate: Reals, terms: int) -> Iterator[Reals]:
    term = total = np.ones_like(rate)
    yield total
    for k in range(1, terms + 1):
        term = term * rate / F(k)
        total = total + term
        yield total
