"""Draws of many lanes: frequencies, distribution functions, independence."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from scipy import stats

from taskspec.language import draws
from tests.shared.words import stream

ALPHA = 1e-4
MANY = stream(1, 300_000)[0]

# ------------------------------------------------------------------------------ distributions


def assert_frequencies(outcomes: np.ndarray, expected: np.ndarray) -> None:
    """A chi-square test of outcomes 0 to k - 1 against probabilities (k,) of at least 5 cases."""
    counts = np.bincount(outcomes, minlength=len(expected))
    assert len(counts) == len(expected)
    possible = expected > 0
    assert not counts[~possible].any()
    expected = expected[possible] / expected.sum() * len(outcomes)
    assert stats.chisquare(counts[possible], expected).pvalue > ALPHA


def assert_poisson(outcomes: np.ndarray, rate: float) -> None:
    low, high = stats.poisson.ppf([1e-3, 1 - 1e-3], rate).astype(int)
    inner = stats.poisson.pmf(np.arange(low + 1, high), rate)
    ends = [stats.poisson.cdf(low, rate), stats.poisson.sf(high - 1, rate)]
    assert_frequencies(np.clip(outcomes, low, high) - low, np.array([ends[0], *inner, ends[1]]))


@pytest.mark.parametrize("weights", [(1, 1), (1, 3), (0, 2, 5, 0, 3), (1,) * 12])
def test_categorical_frequencies(weights: tuple[int, ...]) -> None:
    expected = np.array(weights, float)
    table = draws.thresholds([Fraction(p, sum(weights)) for p in weights])
    assert_frequencies(draws.categoricals(MANY, table), expected)
    column = np.array(weights, np.float32)[:, None]
    assert_frequencies(draws.weighted_categoricals(MANY, column), expected)


@pytest.mark.parametrize("p", [0.1, 0.5, 0.99])
def test_bernoulli_frequencies(p: float) -> None:
    assert_frequencies(draws.bernoullis(MANY, p).astype(int), np.array([1 - p, p]))
    table = draws.thresholds([1 - p, p])
    assert_frequencies(draws.categoricals(MANY, table), np.array([1 - p, p]))


@pytest.mark.parametrize("n", [2, 3, 10, 97])
def test_index_frequencies(n: int) -> None:
    assert_frequencies(draws.indices(MANY, n), np.ones(n))


def test_permutation_frequencies() -> None:
    orders = draws.permutations(stream(4, 50_000))
    names = {order: i for i, order in enumerate(permutations(range(4)))}
    outcomes = np.array([names[tuple(order)] for order in orders.T.tolist()])
    assert_frequencies(outcomes, np.ones(24))


@pytest.mark.parametrize("rate", [0.3, 4.0, 60.0, 1e5])
def test_poisson_table_frequencies(rate: float) -> None:
    first, table = draws.poisson_table(rate)
    assert_poisson(first + draws.categoricals(MANY, table), rate)
    cdf = stats.poisson.cdf(first + np.arange(len(table)), rate)
    assert np.abs(np.array(table) * 2.0**-32 - cdf).max() < 2**-32


@pytest.mark.parametrize(("rate", "bound"), [(0.3, 5), (4, 5), (50, 64), (150, 200)])
def test_poisson_frequencies(rate: float, bound: float) -> None:
    words = stream(draws.poisson_words(bound), 20_000)
    assert_poisson(draws.poissons(words, np.full(20_000, rate), bound), rate)


def assert_follows(values: np.ndarray, distribution: object) -> None:
    """A Kolmogorov-Smirnov test against a distribution of scipy."""
    assert values.dtype == np.float32
    assert stats.kstest(values.astype(np.float64), distribution.cdf).pvalue > ALPHA  # type: ignore[attr-defined]


def test_real_distributions() -> None:
    words = stream(4, 50_000)
    assert_follows(draws.uniforms(words[0]), stats.uniform)
    assert_follows(draws.exponentials(words[0]), stats.expon)
    for values in draws.normals(words, 4):
        assert_follows(values, stats.norm)


# ------------------------------------------------------------------------------ independence

SIDE = 256


def field(phase: int = draws.STEP, seed: int = 99) -> draws.Words:
    """uint32 (lanes, steps, sites), each axis SIDE, SIDE and 4 long."""
    lanes = draws.lane_seeds(seed, SIDE)
    steps = [draws.lanes_block(lanes, phase, n, 4) for n in range(SIDE)]
    return np.stack(steps, axis=1).T


FIELD = field()
NEIGHBOURS = {
    "lanes": (FIELD[:-1], FIELD[1:]),
    "steps": (FIELD[:, :-1], FIELD[:, 1:]),
    "sites": (FIELD[..., :-1], FIELD[..., 1:]),
    "lanes against steps": (FIELD, FIELD.transpose(1, 0, 2)[::-1]),
    "phases": (FIELD, field(draws.RESET)),
    "high words of the seed": (FIELD, field(seed=99 + 2**32)),
}


@pytest.mark.parametrize("which", NEIGHBOURS)
@pytest.mark.parametrize("shift", [0, 28])
def test_neighbours_are_independent(which: str, shift: int) -> None:
    """Joint cells of the four upper (28) and of the four lower (0) bits, and their correlation."""
    one, other = (words.ravel() >> np.uint32(shift) & np.uint32(15) for words in NEIGHBOURS[which])
    assert_frequencies((16 * one + other).astype(np.int64), np.ones(256))
    correlation = np.corrcoef(one, other)[0, 1]
    assert abs(correlation) * math.sqrt(one.size) < stats.norm.isf(ALPHA / 2)


def test_normals_of_a_pair_and_of_neighbours_are_uncorrelated() -> None:
    values = draws.normals(stream(8, 50_000), 8).astype(np.float64)
    for rows in (values, np.abs(values), values**2):
        off = np.corrcoef(rows)[np.triu_indices(8, 1)] * math.sqrt(50_000)
        assert np.abs(off).max() < stats.norm.isf(ALPHA / 2 / len(off))
