"""Dirichlet draws: the law at concentrations of every size, shares that are numbers and add up to 1, alike on all backends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from taskspec.exact.model.transitions import expected
from taskspec.language import draws
from taskspec.language.draws import GAMMA_WORDS
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.programs.reference import ReferenceProgram
from tests.shared.conformance import Agreement

COUNT = 40_000
SIGMAS = 5.0
LAWS = [
    (0.02, 0.02, 0.02), (1e-3, 2e-3), (1e-3, 1.0, 1e3), (0.05, 7.0), (0.2, 1.0, 3.0), (0.999, 1.0, 1.001), (300.0, 100.0),
    (1e4, 3e4, 1.0), (1e6, 2e6, 5e5),
]  # fmt: skip


def shares(alphas: tuple[float, ...], seed: int = 4) -> np.ndarray:
    words = draws.block(seed, draws.STEP, 0, COUNT, draws.gamma_words(len(alphas))).T
    return draws.dirichlets(words, alphas).astype(np.float64)


@pytest.mark.parametrize("alphas", LAWS, ids=str)
def test_moments(alphas: tuple[float, ...]) -> None:
    """Of each share a Beta variate: its mean and its variance, within a few of their standard errors."""
    total = sum(alphas)
    for share, alpha in zip(shares(alphas), alphas, strict=True):
        mean, variance, _, kurtosis = map(float, stats.beta(alpha, total - alpha).stats("mvsk"))
        assert share.mean() == pytest.approx(mean, abs=SIGMAS * math.sqrt(variance / COUNT))
        assert share.var() == pytest.approx(variance, abs=SIGMAS * variance * math.sqrt((kurtosis + 2) / COUNT))


@pytest.mark.parametrize("alphas", LAWS, ids=str)
def test_how_often_a_share_is_small(alphas: tuple[float, ...]) -> None:
    """Below thresholds far down and far up, as far as float32 tells shares from 0 and from 1."""
    total = sum(alphas)
    for share, alpha in zip(shares(alphas), alphas, strict=True):
        law = stats.beta(alpha, total - alpha)
        for limit in (1e-30, 1e-12, 1e-3, *law.ppf([0.1, 0.5, 0.9]), 0.999, 1 - 1e-5):
            if 1e-36 < limit <= 1 - 1e-5:
                assert stats.binomtest(int((share <= limit).sum()), COUNT, float(law.cdf(limit))).pvalue > 1e-6


ALPHA = st.floats(5e-324, 1.7e308) | st.sampled_from(
    [5e-324, 1e-300, 2.0**-100, 1e-45, 1e-3, 1.0, 2.0**100, 1e38, 1e300]
)
WORD = st.integers(0, 2**32 - 1) | st.sampled_from([0, 1, 255, 2**31 - 1, 2**31, 2**32 - 1])


@given(st.lists(ALPHA, min_size=1, max_size=5), st.data())
def test_shares_are_numbers_that_add_up_to_one(alphas: list[float], data: st.DataObject) -> None:
    size = draws.gamma_words(len(alphas))
    words = data.draw(st.lists(WORD, min_size=size, max_size=size))
    found = draws.dirichlets(np.array(words, np.uint32), alphas)
    assert all(0 <= s <= 1 for s in found)
    assert sum(found) == pytest.approx(1, abs=1e-6)


# -- in tasks ---------------------------------------------------------------------------------------------------------

SPEC = """
taskspec: 1
name: Shares
state:
  k: {type: int, low: 1, high: 3}
  d: {type: real, shape: 3, low: 0, high: 1}
  e: {type: real, shape: 2, low: 0, high: 1}
action:
  a: {type: bool}
horizon: 50
initial:
  k: 1
  d: "Dirichlet([0.02, 0.02, 0.02])"
  e: 0
dynamics:
  k': k % 3 + 1
  d': "Dirichlet([0.02, 0.02, 0.02])"
  e': "Dirichlet((k / 1000, 10.0**(10 * k)))"
reward: sum(e' * (3, 5))
"""


def shares_task() -> Task:
    return build(read_text(SPEC, "shares.yaml"))


@pytest.mark.slow
def test_no_share_is_nan() -> None:
    """Of 4,000 draws at 0.02, 128 were: all their gamma variates were 0 in float32, and so was their sum."""
    program = ReferenceProgram(shares_task(), 3)
    program.reset()
    for _ in range(4000):
        program.step([(False,)])
        for found in program.state[1:]:
            assert sum(found) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_all_backends_draw_alike(backend: str) -> None:
    pytest.importorskip(backend)
    Agreement(shares_task(), backend, 16, "SameStep").run(15)


def test_the_mean_is_exact() -> None:
    task = build(read_text(SPEC.replace("sum(e' * (3, 5))", "d'[0] + 4 * d'[1]"), "shares.yaml"))
    found = expected(task.process.reward, task.new_builder(), ())
    assert float(found.value) == pytest.approx(5 / 3, rel=1e-15)  # type: ignore[union-attr]


def test_variates_below_the_normal_float32_are_0() -> None:
    """Some machines would flush those to 0, and others not; down to there all are kept."""
    words = np.random.default_rng(0).integers(0, 2**32, (GAMMA_WORDS, 40_000), np.uint32)
    found = draws.gammas(words, np.full((1, 40_000), 0.02))[0]
    assert np.count_nonzero(found == 0) > 100
    assert 2.0**-126 < found[found > 0].min() < 2.0**-125
