"""The suite `probes`: which mistakes it exposes, and that right learners pass."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from docs.tools.group_estimators import RIGHT, WRONG, expected
from docs.tools.probes import exposed, scores
from taskspec import load
from taskspec.exact import difficulty
from taskspec.exam import CannotLearn, Case, examine, learns_from
from tests.shared.sparse import sparse

MISTAKES = {
    "EndInPlace": {"ends ignored", "next episode"},
    "Hazard": {"ends ignored", "next episode"},
    "ValueLeft": {"limit is an end", "same state"},
    "SecondThought": {"mean of actions", "least action", "all states", "action before", "same state"},
    "Slip": {"on policy"},
    "Sizes": {"rewards clipped", "signs of rewards"},
    "Patience": {"discounted twice", "ends ignored", "immediate reward"},
    "Echo": {"reward negated"},
}
GAMMA = 0.95


@pytest.mark.parametrize("probe", sparse(MISTAKES, 4))
def test_probes_expose_their_mistakes_and_pass_right_learners(probe: str) -> None:
    task = load(f"probes/{probe}-v0")
    assert set(exposed(task)) >= MISTAKES[probe]
    for gamma in (0.88, 0.95, 0.99):
        assert scores(task, gamma)["right"] == pytest.approx(1)


def test_a_second_thought_is_needed_and_chance_matters() -> None:
    assert difficulty("SecondThought", ["lookahead"])["lookahead"] == 2
    assert difficulty("CoinToss", ["value_norm"])["value_norm"] == pytest.approx(1)  # 2 or 0, equally likely
    assert difficulty("RiskyPath", ["value_norm"])["value_norm"] == pytest.approx(202)  # 4 or -400: +-202


@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        # 1/4 [(2 - 8/5) - (2/5 (3 - 8/5) + 3/5 (0 - 8/5) / T)], where T is 1, or the 10 steps of a failure
        ("length normalised", "1/5", "-2/125"),
        # 1/4 of what the left door earns, 17/5; or of its votes, 2/5 less 3/5
        ("deviation divided", "17/20", "-1/20"),
    ],
)
def test_the_expectation_of_an_estimator_with_a_mistake_has_the_wrong_sign(
    name: str, right: Fraction, wrong: Fraction
) -> None:
    probe, estimate = WRONG[name]
    assert list(expected(probe, RIGHT)) == [Fraction(right), -Fraction(right)]
    assert list(expected(probe, estimate)) == [Fraction(wrong), -Fraction(wrong)]


def suite_of(task_id: str) -> str:
    return task_id.partition("/")[0]


@pytest.mark.parametrize(
    ("terms", "expected"),
    [
        ({}, {"probes/Aim-v0": 10_000}),
        ({"steps": 20_000}, {"probes/Aim-v0": 20_000}),
        ({"tasks": ["RiskyPath", "Aim"]}, {"derail/RiskyPath-v0": 500_000, "probes/Aim-v0": 10_000}),
        ({"suite": "derail"}, {"derail/RiskyPath-v0": 500_000}),
    ],
)
def test_an_exam_asks_the_probes_unless_told_otherwise(terms: dict[str, Any], expected: dict[str, int]) -> None:
    granted = {}

    def train(case: Case) -> None:
        granted[case.task.id] = case.steps
        raise CannotLearn("")

    examine(train, seeds=1, twins=0, peeks=False, **terms)
    assert granted.items() >= expected.items()
    assert set(map(suite_of, granted)) == set(map(suite_of, expected))


def _q_learning(case: Case, counts_ends: bool) -> np.ndarray:
    env = case.env()
    rng = np.random.default_rng(case.seed)
    q = np.zeros((case.observation_space.n, case.action_space.n))
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = int(q[obs].argmax())
        if rng.random() <= 0.2:
            action = int(rng.integers(len(q[obs])))
        after, reward, terminated, truncated, _ = env.step(action)
        target = reward
        if counts_ends or not terminated:
            target += GAMMA * q[after].max()
        q[obs, action] += 0.1 * (target - q[obs, action])
        obs = after
        if terminated or truncated:
            obs, _ = env.reset()
    return q


def _greedy(q: np.ndarray) -> np.ndarray:
    """Probabilities of actions, so that an exam has scores alone to judge by: values would name the mistake, too."""
    best = q == q.max(axis=1, keepdims=True)
    return best / best.sum(axis=1, keepdims=True)


@learns_from("reward")
def right(case: Case) -> np.ndarray:
    return _greedy(_q_learning(case, counts_ends=False))


@learns_from("reward")
def past_the_end(case: Case) -> np.ndarray:
    return _greedy(_q_learning(case, counts_ends=True))


def test_a_bootstrap_past_the_end_is_diagnosed() -> None:
    asked = ["EndInPlace", "Hazard", "SecondThought", "Sizes", "Patience", "Echo"]
    found = examine(past_the_end, suite="probes", tasks=asked, seeds=4, steps=3000, twins=0)
    (diagnosis,) = found["diagnoses"]
    assert diagnosis["name"] == "past_ends"
    again = examine(right, suite="probes", tasks=asked, seeds=4, steps=3000, twins=0)
    assert again["diagnoses"] == []
    for score in again["scores"]:
        assert score["deterministic"] == pytest.approx(1, abs=1e-9)


@learns_from("reward")
def exploring(case: Case) -> np.ndarray:
    q = _q_learning(case, counts_ends=False)
    return 0.5 * _greedy(q) + 0.5 / q.shape[1]


@learns_from("reward")
def opposite(case: Case) -> np.ndarray:
    return _greedy(-_q_learning(case, counts_ends=False))


@pytest.mark.parametrize(("learner", "name"), [(exploring, "still_explores"), (opposite, "reversed")])
def test_policies_that_do_not_follow_from_their_values_are_diagnosed(learner: Any, name: str) -> None:
    asked = ["EndInPlace", "Hazard", "SecondThought", "CoinToss", "Sizes", "Patience", "Echo"]
    found = examine(learner, suite="probes", tasks=asked, seeds=3, steps=2000, twins=0)
    (diagnosis,) = found["diagnoses"]
    assert diagnosis["name"] == name
