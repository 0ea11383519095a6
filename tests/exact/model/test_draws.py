"""Draws over a batch equal the scalar sampler lane by lane, and enumerated outcomes have the probabilities of samples."""

from typing import Any

import numpy as np
import pytest

from taskspec.exact.model import transitions
from taskspec.exact.model.transitions import branches, count, is_finite
from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import draws as draws_below
from taskspec.language.expressions.types import Role
from taskspec.language.expressions.variates import WordLayout, batch_sampler, sampler
from tests.shared.sections import build_text

SPEC = """
constants:
  table: [[1/2, 1/4, 1/4], [0, 1/3, 2/3], [1, 0, 0]]
state:
  k: {type: int, low: 0, high: 2}
  x: {type: EXPRESSION_TYPE}
action:
  a: {type: int, low: 0, high: 1}
horizon: 3
initial:
  k: 0
  x: ZERO
dynamics:
  x': EXPRESSION
reward: 0
"""

DRAWN = [
    ("real", "0", "Uniform(k, 3)"),
    ("real, shape: [3]", "[0, 0, 0]", "Normal(mean=k, std=2, shape=3)"),
    ("real", "0", "Exponential(rate=k + 1)"),
    ("real, shape: [2]", "[0, 0]", "Dirichlet(alpha=(k + 1, 2))"),
    ("int", "0", "Poisson(rate=3)"),
    ("int, shape: [2]", "[0, 0]", "Poisson(rate=k + 1/2, shape=2)"),
    ("int", "0", "UniformInt(0, k)"),
    ("int, shape: [2, 2]", "[[0, 0], [0, 0]]", "UniformInt(-1, 1, shape=(2, 2))"),
    ("int", "0", "Categorical(table[k])"),
    ("int", "0", "Categorical((k / 4, 1 - k / 4))"),
    ("int, shape: [2]", "[0, 0]", "Categorical((1/4, 3/4), shape=2)"),
    ("bool", "false", "Bernoulli(1/3)"),
    ("bool, shape: [3]", "[false, false, false]", "Bernoulli(k / 2, shape=3)"),
    ("int, shape: [4]", "[0, 0, 0, 0]", "Permutation(4)"),
    ("int", "0", "UniformInt(0, 1) * UniformInt(0, UniformInt(1, 2))"),
]


def node_of(kind: str, zero: str, expression: str) -> Any:
    text = SPEC.replace("EXPRESSION_TYPE", kind).replace("ZERO", zero).replace("EXPRESSION", f'"{expression}"')
    return build_text(text).process.next[1]


@pytest.mark.parametrize(("kind", "zero", "expression"), DRAWN)
def test_a_batch_equals_its_lanes(kind: str, zero: str, expression: str) -> None:
    node = node_of(kind, zero, expression)
    lanes = 40
    layout = WordLayout.of([node])
    words = draws.lanes_block(draws.lane_seeds(5, lanes), draws.STEP, 3, layout.count)
    k = np.arange(lanes) % 3
    (together,) = batch.evaluate([node], {(Role.STATE, "k"): k}, batch_sampler(layout, words))
    together = np.broadcast_to(together, (*together.shape[:-1], lanes))
    for lane in range(lanes):
        sample = sampler(layout, words[:, lane].tolist())
        (alone,) = evaluate([node], {(Role.STATE, "k"): (int(k[lane]),)}, sample)
        np.testing.assert_allclose(together[..., lane].reshape(-1).astype(float), np.array(alone, float), rtol=1e-6)
        if node.type.kind != 2:
            assert tuple(together[..., lane].reshape(-1).tolist()) == alone


@pytest.mark.parametrize(("kind", "zero", "expression"), [d for d in DRAWN if "real" not in d[0]])
@pytest.mark.parametrize("many", [False, True])
def test_outcomes_have_the_frequencies_of_samples(
    monkeypatch: pytest.MonkeyPatch, kind: str, zero: str, expression: str, many: bool
) -> None:
    monkeypatch.setattr(transitions, "LOOP_FROM", 10)
    node = node_of(kind, zero, expression)
    size = 6000
    found = draws_below([node])
    assert all(map(is_finite, found))
    value = 2
    lanes = 20 if many else 1
    points = {(Role.STATE, "k"): np.full(lanes, value)}
    table: dict[tuple[Any, ...], float] = {}
    mass = np.zeros(lanes)
    for branch in branches(found, points, lanes):
        (values,) = batch.evaluate([node], branch.place(points), drawn=branch.drawn)
        origin = branch.origin
        if origin is None:
            origin = np.arange(lanes)
        n = len(origin)
        weight = np.broadcast_to(branch.weight, (n,))
        np.add.at(mass, origin, weight)
        values = np.broadcast_to(values, (*values.shape[:-1], n))
        outcomes = np.flatnonzero(origin == 0)[:1] if many else np.arange(n)
        for i in outcomes:
            key = tuple(values[..., i].reshape(-1).tolist())
            table[key] = table.get(key, 0.0) + float(weight[i])
    np.testing.assert_allclose(mass, 1, atol=1e-12)
    assert len(table) <= count(found, {}) * (3 if "Uniform" in expression else 1)
    if many:
        return
    layout = WordLayout.of([node])
    words = draws.lanes_block(draws.lane_seeds(0, size), draws.STEP, 0, layout.count)
    (seen,) = batch.evaluate([node], {(Role.STATE, "k"): np.array([value])}, batch_sampler(layout, words))
    for key, p in table.items():
        same = (seen.reshape(-1, size) == np.array(key)[:, None]).all(axis=0).sum()
        assert abs(same - size * p) <= 5.5 * np.sqrt(size * p * (1 - p)) + 3
