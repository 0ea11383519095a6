"""Exact values beside plain recursion over all episodes, in floats and in rationals; gradients beside differences."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import oracle
from taskspec.base.diagnostics import SpecError
from tests.shared.sections import whole_spec
from tests.shared.stand_in_torch import TORCH, Categorical, Module
from tests.shared.tasks import Small

Array = np.ndarray[Any, Any]
PI = np.array([[0.25, 0.75], [0.5, 0.5], [0.75, 0.25]])
DISCOUNTED = Small(3, discount=0.5)


def visits(small: Small, pi: Array) -> Array:
    """Discounted probabilities (T, S) to act in a state at a time, from all episodes."""
    found = np.zeros((small.horizon, small.states))
    for probability, pairs, _ in small.trajectories():
        for s, a in pairs:
            probability *= pi[s, a]
        for t, (s, _) in enumerate(pairs):
            found[t, s] += small.discount**t * probability
    return found


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("small", [Small(1), DISCOUNTED], ids=["1", "discounted"])
def test_values_are_those_of_plain_recursion(small: Small, exact: bool) -> None:
    found = oracle.evaluate(small.task, PI, exact=exact)
    assert found.V.dtype == (object if exact else np.float64)
    V = np.zeros((4, 3))
    Q = np.zeros((3, 3, 2))
    for t in (2, 1, 0):
        for s in range(3):
            for a in range(2):
                after = [small.discount * V[t + 1, s2] * small.going(s2) for s2 in range(3)]
                Q[t, s, a] = (small.p[s, a] * (small.r[s, a] + after)).sum()
            V[t, s] = PI[s] @ Q[t, s]
    assert np.allclose(found.V[:, :2].astype(float), V[:, :2])  # nobody acts in the last state
    assert np.allclose(found.Q[:, :2].astype(float), Q[:, :2])
    assert np.allclose(found.A[:, :2].astype(float), Q[:, :2] - V[:-1, :2, None])
    assert float(found.expected_return) == pytest.approx(small.value(lambda t, s: PI[s]))
    assert np.allclose(found.occupancy.astype(float), visits(small, PI))
    paid = (small.p * small.r).sum(axis=-1)
    by_visits = (found.occupancy.astype(float)[..., None] * PI * paid).sum()
    assert float(found.expected_return) == pytest.approx(by_visits)


def test_rationals_are_the_numbers_that_the_spec_writes() -> None:
    found = oracle.evaluate("CoinToss", "random", exact=True)
    assert found.expected_return == Fraction(13, 20)
    assert found.Q[0, 0].tolist() == [Fraction(3, 10), 1]
    assert oracle.evaluate("CoinToss", "expert", exact=True).expected_return == 1
    assert oracle.evaluate("Echo", "epsilon(0.1)", exact=True).expected_return == Fraction(19, 2)


def test_without_a_horizon_values_solve_the_equations() -> None:
    small = Small(5, horizon="none", discount=0.75)
    found = oracle.evaluate(small.task, PI)
    going = np.array([1.0, 1.0, 0.0])
    P = (PI[:, :, None] * small.p).sum(axis=1) * going
    R = (PI * (small.p * small.r).sum(axis=-1)).sum(axis=1)
    V = np.linalg.solve(np.eye(3) - 0.75 * P, R)
    assert np.allclose(found.V[0, :2], V[:2])
    d = np.linalg.solve(np.eye(3) - 0.75 * P.T, small.start)
    assert np.allclose(found.occupancy[0], d * going)
    assert found.expected_return == pytest.approx(small.start @ V)
    with pytest.raises(SpecError, match="no horizon"):
        oracle.evaluate(small.task, PI, exact=True)


class ActorCritic:
    """What is used of a stochastic model of Stable-Baselines3."""

    def __init__(self) -> None:
        self.policy = self

    def predict(self, observations: Any, deterministic: bool = False) -> Any:
        return PI[observations].argmax(axis=1), None

    def obs_to_tensor(self, observations: Any) -> Any:
        return observations, True

    def set_training_mode(self, mode: bool) -> None:
        assert not mode

    def get_distribution(self, observations: Any) -> ActorCritic:
        self.distribution = Categorical(np.log(PI[observations]))
        return self


def test_every_form_of_a_policy_has_the_same_values(monkeypatch: pytest.MonkeyPatch) -> None:
    task = taskspec.load("SecondThought")
    monkeypatch.setitem(sys.modules, "torch", TORCH)
    forms = {
        "table": PI,
        "over time": np.stack([PI, PI]),
        "fractions": PI.astype(object) * Fraction(1),
        "probabilities": lambda observation: PI[observation],
        "a model of Stable-Baselines3": ActorCritic(),
        "a module of PyTorch": Module(np.log(PI)),
    }
    expected = 0.25 * 0.25 + 0.75 * (0.75 - 0.25)
    for name, policy in forms.items():
        assert oracle.evaluate(task, policy).expected_return == pytest.approx(expected), name
    assert oracle.evaluate(task, forms["probabilities"], exact=True).expected_return == Fraction(7, 16)
    best = np.array([1, 0, 0])
    for policy in (best, np.stack([best, best]), lambda observation: int(best[observation]), "optimal", "expert"):
        assert oracle.evaluate(task, policy).expected_return == 1


@pytest.mark.parametrize(("policy", "code"), [
    (np.ones((3, 2)), "E713"), (np.full((2, 2), 0.5), "E713"), (np.array([0, 1, 2]), "E713"), ("optimall", "E713"),
    (lambda observation, rng: int(rng.integers(2)), "E712"), (3, "E713"),
])  # fmt: skip
def test_no_policy_is_refused(policy: Any, code: str) -> None:
    with pytest.raises(SpecError, match=code):
        oracle.evaluate("SecondThought", policy)


PAIR = """
state:
  x: {type: int, low: 0, high: 1, shape: [SHAPE]}
action:
  a: {type: int, low: 0, high: 1}
horizon: 3
initial:
  x: START
dynamics:
  x': START
reward: a
"""


@pytest.mark.parametrize(("shape", "start"), [("", "0"), ("2", "[0, 0]")])
def test_a_table_over_time_has_a_row_for_each_step(shape: str, start: str, tmp_path: Path) -> None:
    path = tmp_path / "pair.yaml"
    path.write_text(whole_spec(PAIR.replace("SHAPE", shape).replace("START", start)))
    shape_of_all = oracle.evaluate(path, "random").pi.shape
    table = np.zeros(shape_of_all)
    table[..., 0] = 1
    table[2] = [0, 1]
    assert oracle.evaluate(path, table).expected_return == 1
    for wrong in (table[1:], np.concatenate([table, table])):
        with pytest.raises(SpecError, match=f"E713.* has 3 times on .*, not {len(wrong)}"):
            oracle.evaluate(path, wrong)


def test_functions_and_tables_may_take_illegal_actions_and_objects_do_not(tmp_path: Path) -> None:
    class Learner:
        def predict(self, observations: Array, **options: Any) -> Array:
            return np.zeros(len(observations), np.int64)

        def action_probabilities(self, observations: Array) -> Array:
            return np.full((len(observations), 2), 0.5)

    path = tmp_path / "pair.yaml"
    text = PAIR.replace("SHAPE", "").replace("START", "0")
    path.write_text(whole_spec(text + "legal: a == 0\n"))
    for policy, expected in ((lambda _: [0.5, 0.5], 1.5), (np.full((2, 2), 0.5), 1.5), (Learner(), 0), ("random", 0)):
        assert oracle.evaluate(path, policy).expected_return == expected


def test_a_policy_of_drawn_observations_has_no_table() -> None:
    noisy = taskspec.load("SecondThought", modifiers=["dropout=0.5"])
    assert oracle.evaluate(noisy, "random").expected_return == 0.125
    with pytest.raises(SpecError, match="are drawn"):
        oracle.evaluate(noisy, lambda observation: [0.5, 0.5])


def test_rows_of_a_table_may_be_observations() -> None:
    by_observation = oracle.evaluate("LookAlikes", np.array([[0.25, 0.75]]), exact=True)
    by_state = oracle.evaluate("LookAlikes", np.array([[0.25, 0.75]] * 2), exact=True)
    assert by_observation.expected_return == by_state.expected_return == Fraction(3, 8)
    seen = by_observation.by_observation()
    assert seen.V.tolist() == [[Fraction(3, 8)]]
    assert seen.Q.tolist() == [[[Fraction(3, 4), Fraction(1, 4)]]]
    assert seen.A.tolist() == [[[Fraction(3, 8), Fraction(-1, 8)]]]
    assert seen.occupancy.tolist() == [[1]]
    unseen = oracle.evaluate("SecondThought", "expert").by_observation()
    assert np.isnan(unseen.V[0, 1:]).all() and unseen.V[1, 2] == 1
    twin = taskspec.load("SecondThought", modifiers=["relabelled"])
    with pytest.raises(SpecError, match="states or observations"):
        oracle.evaluate(twin, PI)


def differences(task: Any, theta: Array, rows: Any) -> Array:
    """Central differences of the expected return by the logits of a table."""

    def value(logits: Array) -> float:
        weights = np.exp(logits)
        pi = weights / weights.sum(axis=1, keepdims=True)
        return float(oracle.evaluate(task, pi[rows]).expected_return)

    found = np.zeros_like(theta)
    for at in np.ndindex(theta.shape):
        step = np.zeros_like(theta)
        step[at] = 1e-5
        found[at] = (value(theta + step) - value(theta - step)) / 2e-5
    return found


def test_the_policy_gradient_is_the_slope_of_the_return() -> None:
    theta = np.log(PI)
    exact = oracle.policy_gradient(DISCOUNTED.task, PI)
    assert np.allclose(exact, differences(DISCOUNTED.task, theta, slice(None)), atol=1e-8)
    rational = oracle.policy_gradient(DISCOUNTED.task, PI, exact=True)
    assert np.allclose(rational.astype(float), exact)
    seen = np.log(np.array([[0.25, 0.75]]))
    found = oracle.policy_gradient("LookAlikes", np.exp(seen), by="observation")
    assert np.allclose(found, differences("LookAlikes", seen, [0, 0]), atol=1e-8)
    without = oracle.evaluate(DISCOUNTED.task, PI)
    weights = without.occupancy / 0.5 ** np.arange(3)[:, None]
    usual = (weights[..., None] * without.pi * without.A).sum(axis=0)
    assert np.allclose(oracle.policy_gradient(DISCOUNTED.task, PI, discounted=False), usual)
    assert not np.allclose(usual, exact)


@pytest.mark.parametrize("small", [Small(2), Small(4, discount=0.5)], ids=["2", "discounted"])
def test_maximum_entropy_trajectories_are_weighed_by_their_returns(small: Small) -> None:
    found = oracle.soft_values(small.task, 0.5, causal=False)
    weights = np.zeros((3, 2))
    for probability, pairs, total in small.trajectories():
        weights[pairs[0]] += probability * np.exp(0.5 * total)
    weights = weights[:2] / small.start[:2, None]
    assert np.allclose(found.Q[0, :2], np.log(weights) / 0.5)
    assert np.allclose(found.pi[0, :2], weights / weights.sum(axis=1, keepdims=True))


def test_causal_entropy_is_what_the_named_policy_plans() -> None:
    task = DISCOUNTED.task
    soft = oracle.soft_values(task, 2.0)
    named = oracle.evaluate(task, "soft(2)")
    assert np.allclose(soft.pi[:, :2], named.pi[:, :2])
    paid = (DISCOUNTED.p * DISCOUNTED.r).sum(axis=-1)
    assert np.allclose(oracle.soft_values(task, 2.0, reward=paid).Q[:, :2], soft.Q[:, :2])
    entropy = -(soft.pi * np.log(soft.pi)).sum(axis=-1)
    objective = named.expected_return + (named.occupancy * entropy).sum() / 2.0
    assert DISCOUNTED.start @ soft.V[0] == pytest.approx(objective)
    with pytest.raises(SpecError, match="E713"):
        oracle.soft_values(task, reward=np.zeros(3))
    with pytest.raises(SpecError, match=r"E713.*beta is 0"):
        oracle.soft_values(task, 0)


def test_feature_expectations_count_visits() -> None:
    """Visits of each state, the last one of an episode included, from all episodes."""
    small = DISCOUNTED
    total = visits(small, PI).sum(axis=0)
    assert np.allclose(oracle.feature_expectations(small.task, PI, np.eye(3), last=False), total)
    found = oracle.feature_expectations(small.task, PI, np.eye(3))
    following = np.zeros(3)
    for t, d in enumerate(visits(small, PI)):
        reached = 0.5 * (d[:, None, None] * PI[:, :, None] * small.p).sum(axis=(0, 1))
        following += reached if t == 2 else reached * [0, 0, 1]
    assert np.allclose(found, total + following)
    assert oracle.feature_expectations("Patience", "expert", np.arange(5.0)).tolist() == 0 + 1 + 2 + 3 + 4 + 4
    with pytest.raises(SpecError, match="E713"):
        oracle.feature_expectations(small.task, PI, np.zeros(2))
