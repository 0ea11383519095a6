"""The draws of every backend have the distributions that they should, and are independent.

Seeds are fixed, so a test gives the same answer every time; its threshold is a probability of 1e-4 under the hypothesis
that all is well, and there are about a hundred tests, so that a fresh choice of seeds would fail once in a hundred.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from taskspec.envs.vector import VectorEnvironment
from taskspec.source import read
from taskspec.spec.build import build

stats = pytest.importorskip("scipy.stats")

BACKENDS = ("numpy", "numba", "jax")
LANES, STEPS = 2000, 25
RARE = 1e-4
SPEC = """
taskspec: 1
name: Sample
title: Sample
summary: Every distribution.
action:
  a: {type: int, low: 0, high: 1}
horizon: none
reward: 0
state:
  u: {type: real}
  v: {type: real}
  n: {type: real, shape: [3]}
  e: {type: real}
  k: {type: int}
  b: {type: bool}
  c: {type: int, low: 0, high: 2}
  d: {type: real, shape: [3]}
  i: {type: int, low: -2, high: 5}
  p: {type: int, shape: [4], low: 0, high: 3}
initial: {u: 0, v: 0, n: "[0, 0, 0]", e: 0, k: 0, b: false, c: 0, d: "[0, 0, 0]", i: 0, p: "[0, 1, 2, 3]"}
dynamics:
  u': Uniform(-1, 3)
  v': Uniform(0, 1)
  n': Normal(mean=1, std=2, shape=3)
  e': Exponential(rate=2)
  k': Poisson(rate=4)
  b': Bernoulli(0.3)
  c': "Categorical([1/2, 1/3, 1/6])"
  d': "Dirichlet(alpha=[0.5, 1, 2])"
  i': UniformInt(-2, 5)
  p': Permutation(4)
"""


@lru_cache(maxsize=3)
def drawn(backend: str) -> dict[str, np.ndarray]:
    """Values by component: (STEPS, LANES, size)."""
    pytest.importorskip(backend)
    task = build(read(SPEC), None, {}, "")
    env = VectorEnvironment(task, LANES, backend=backend)
    env.reset(seed=20)
    rows = np.stack([env.step(np.zeros(LANES, np.int64))[0] for _ in range(STEPS)])
    found, offset = {}, 0
    for c in task.state:
        found[c.name] = rows[:, :, offset : offset + c.type.size].astype(float)
        offset += c.type.size
    return found


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("name", "column", "law"),
    [
        ("u", 0, stats.uniform(-1, 4)),
        ("v", 0, stats.uniform(0, 1)),
        ("n", 0, stats.norm(1, 2)),
        ("n", 1, stats.norm(1, 2)),
        ("n", 2, stats.norm(1, 2)),
        ("e", 0, stats.expon(scale=0.5)),
        ("d", 0, stats.beta(0.5, 3)),
        ("d", 1, stats.beta(1, 2.5)),
        ("d", 2, stats.beta(2, 1.5)),
    ],
)
def test_real_draws(backend: str, name: str, column: int, law: object) -> None:
    sample = drawn(backend)[name][..., column].ravel()
    assert stats.kstest(sample, law.cdf).pvalue > RARE  # type: ignore[attr-defined]


def chi_square(values: np.ndarray, probabilities: dict[int, float]) -> float:
    """The probability of counts as uneven as these."""
    counts = [np.count_nonzero(values == v) for v in probabilities]
    assert sum(counts) == values.size
    expected = np.array(list(probabilities.values())) * values.size
    return float(stats.chisquare(counts, expected).pvalue)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("b", {0: 0.7, 1: 0.3}),
        ("c", {0: 1 / 2, 1: 1 / 3, 2: 1 / 6}),
        ("i", dict.fromkeys(range(-2, 6), 1 / 8)),
    ],
)
def test_finite_draws(backend: str, name: str, law: dict[int, float]) -> None:
    assert chi_square(drawn(backend)[name].ravel(), law) > RARE


@pytest.mark.parametrize("backend", BACKENDS)
def test_poisson(backend: str) -> None:
    values = np.minimum(drawn(backend)["k"].ravel(), 12)
    law = {k: float(stats.poisson(4).pmf(k)) for k in range(12)}
    assert chi_square(values, law | {12: 1 - sum(law.values())}) > RARE


@pytest.mark.parametrize("backend", BACKENDS)
def test_permutations(backend: str) -> None:
    orders = drawn(backend)["p"].reshape(-1, 4) @ [1, 4, 16, 64]
    codes, counts = np.unique(orders, return_counts=True)
    assert len(codes) == 24
    assert stats.chisquare(counts).pvalue > RARE


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("pair", ["lanes", "steps", "sites", "elements"])
def test_independence(backend: str, pair: str) -> None:
    """Uniforms of neighbouring lanes, steps and sites fill the unit square evenly."""
    values = drawn(backend)
    v, u = values["v"][..., 0], (values["u"][..., 0] + 1) / 4
    n = stats.norm(1, 2).cdf(values["n"])
    a, b = {
        "lanes": (v[:, :-1:2], v[:, 1::2]),
        "steps": (v[:-1:2], v[1::2]),
        "sites": (u, v),
        "elements": (n[..., 0], n[..., 1]),
    }[pair]
    cells = np.minimum((a * 8).astype(int), 7) * 8 + np.minimum((b * 8).astype(int), 7)
    assert stats.chisquare(np.bincount(cells.ravel(), minlength=64)).pvalue > RARE
