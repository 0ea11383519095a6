"""Experts as policies of other libraries, experts of other kinds than the spec's, and the model that scores rest on."""

from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp, softmax

import taskspec
from taskspec import exact
from taskspec.exact import Expert, extract, score, scores
from taskspec.exact.policies.policy import named
from tests.shared.sections import build_text

TASK = taskspec.load("RiskyPath")


def soft_return(beta: float) -> float:
    """Of the Boltzmann policy of soft values on RiskyPath, over its five steps."""
    P = np.zeros((4, 2, 4))  # states start, detour, goal and trap
    P[0] = [[0, 1, 0, 0], [0, 0, 0.5, 0.5]]
    P[1] = [[0, 0, 1, 0], [0, 1, 0, 0]]
    P[2, :, 2] = 1
    P[3, :, 3] = 1
    reward = np.array([0.0, 0.0, 1.0, -100.0])
    value = np.zeros(4)
    paid = np.zeros(4)
    for _ in range(5):
        q = P @ (reward + value)
        policy = softmax(beta * q, axis=1)
        value = logsumexp(beta * q, axis=1) / beta
        paid = (policy * (P @ (reward + paid))).sum(axis=1)
    return float(paid[0])


@pytest.mark.parametrize("beta", [0.01, 1.0, 3.0])
def test_a_soft_expert_is_scored_by_its_own_probabilities(beta: float) -> None:
    found = score(TASK, Expert(TASK, f"soft({beta})"))
    assert found.asked == "probabilities" and found.value.exact
    assert found.value.value == pytest.approx(soft_return(beta), abs=1e-9)


def test_a_soft_expert_acts_as_often_as_it_says() -> None:
    expert = Expert(TASK, "soft(0.01)", seed=1)
    plan = expert.results.expert_plan
    assert plan is not None
    actions, _ = expert.predict(np.zeros(4000, np.int64))
    assert np.mean(actions == 1) == pytest.approx(plan(0)[1, 0], abs=0.03)
    assert 0.05 < plan(0)[1, 0] < 0.95


def test_an_optimal_expert_reaches_the_optimum_and_others_are_refused() -> None:
    assert score("Branching", Expert("Branching", "optimal")).value.value == scores("Branching").optimal.value
    for wrong in ("soft", "soft(x)", "soft(nan)", "best", 3):
        with pytest.raises(taskspec.SpecError, match="E713"):
            Expert(TASK, wrong)  # type: ignore[arg-type]


def test_an_expert_is_called_as_imitation_calls_policies() -> None:
    expert = Expert(TASK)
    env = taskspec.make(TASK)
    assert (expert.observation_space, expert.action_space) == (env.observation_space, env.action_space)
    seen = np.array([0, 1])
    state = None
    starts = np.array([True, True])
    for _ in range(3):
        actions, state = expert(seen, state, starts)
        assert actions.tolist() == [0, 0]
        starts = np.array([False, True])
    assert state[0].tolist() == [3, 1]


def test_stable_baselines3_evaluates_an_expert() -> None:
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.evaluation import evaluate_policy

    from taskspec.envs.sb3 import Sb3VecEnv

    model: Any = Expert(TASK)
    mean, _ = evaluate_policy(model, Sb3VecEnv(TASK, 2, backend="numpy"), n_eval_episodes=4, warn=False)
    assert mean == 4.0


def test_the_model_of_an_abstraction_is_extracted() -> None:
    task = taskspec.load("Sort", L=3)
    model = extract(task)
    assert int(model.entered.sum()) == scores(task).states
    results = exact.Results(task)
    assert results.model is not None and results.model.n_states == model.n_states
    assert np.allclose(model.start, results.model.start)


def test_an_expert_is_a_policy_of_stable_baselines3_where_one_is_asked_for() -> None:
    policies = pytest.importorskip("stable_baselines3.common.policies")
    from taskspec.envs.sb3 import Sb3Expert

    for name in ("derail/InitShiftLearner-v0", "derail/Parabola-v0"):
        plain = Expert(name)
        wrapped = Sb3Expert(name)
        assert isinstance(wrapped, policies.BasePolicy)
        assert (wrapped.observation_space, wrapped.action_space) == (plain.observation_space, plain.action_space)
        seen = np.stack([taskspec.make(name).reset(seed=i)[0] for i in range(3)])
        (actions, steps) = wrapped.predict(seen, deterministic=True)
        (theirs, _) = plain.predict(seen, deterministic=True)
        assert np.array_equal(actions, theirs) and steps[0].tolist() == [1, 1, 1]


FAR = """
state:
  s: {type: int, low: 0, high: 9, shape: [9]}
action:
  a: {type: choice, values: {left: -1, right: 1}}
horizon: 4
initial: {s: "[4 for i in range(9)]"}
dynamics: {s': "clip(s + 2 * a, 0, 9)"}
reward: "s'[0] == 8"
terminal: "s'[0] == 8"
discount: 9/10
expert: optimal
"""


def test_an_expert_that_is_planned_does_not_guess_in_states_that_no_episode_comes_to() -> None:
    """It took the plan of the next state that is in the model, and failed after the last one."""
    far = build_text(FAR)
    expert = Expert(far)
    policy = named(far, "optimal")
    assert expert.predict(np.full(9, 6), deterministic=True)[0] == 1
    for state in (7, 9, 77):
        with pytest.raises(taskspec.SpecError, match=rf"E712.*s = \[{state}, .*no episode of Test comes there"):
            expert.predict(np.full(9, state))
        with pytest.raises(taskspec.SpecError, match=rf"E712.*s = \[{state}, "):
            policy.by_words({"s": np.full((9, 2), [4, state])}, 0, np.zeros((1, 2), np.uint32))
