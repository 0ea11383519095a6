"""Fingerprints: mistakes of sampled learners are named from their values alone, on tasks where learners meet every state."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.learn.exam.fingerprints import fingerprint
from taskspec.learn.exam.judgement import Run, judged
from taskspec.learn.exam.operators import GOOD

SPECS = Path(__file__).parents[2] / "specs" / "values"
TASKS = (str(SPECS / "end_in_place.yaml"), str(SPECS / "coin_walk.yaml"), "derail/RiskyPath")
GAMMA = 0.9


@cache
def learned_q(task: str, mistake: str, seed: int, steps: int = 25_000, exploration: float = 0.2) -> np.ndarray:
    """Return the table of Q-learning from samples, with a mistake in its code: a learner that knows nothing of the model."""
    env = taskspec.make(task)
    rng = np.random.default_rng(seed)
    Q = np.zeros((int(env.observation_space.n), int(env.action_space.n)))
    visits = np.zeros_like(Q)
    obs, _ = env.reset(seed=seed)
    for _ in range(steps):
        best = np.flatnonzero(Q[obs] == Q[obs].max())
        action = int(rng.choice(best))
        if rng.random() < exploration:
            action = int(rng.integers(Q.shape[1]))
        next_obs, reward, terminated, truncated, _ = env.step(action)
        first = next_obs
        if terminated or truncated:
            first, _ = env.reset()
        visits[obs, action] += 1
        rate = max(0.02, 1 / (1 + visits[obs, action] ** 0.7))
        wanted = target(mistake, Q, obs, action, float(reward), next_obs, terminated, truncated, first, exploration)
        Q[obs, action] += rate * (wanted - Q[obs, action])
        obs = first
    return Q


def target(
    mistake: str, Q: np.ndarray, obs: int, action: int, reward: float, next_obs: int, terminated: bool, truncated: bool,
    first: int, exploration: float,
) -> float:  # fmt: skip
    """Return the target of a step, as learners with a mistake compute it."""
    goes_on = float(not terminated)
    value = Q[next_obs].max()
    match mistake:
        case "ends ignored":
            return reward + GAMMA * value
        case "next episode" if terminated or truncated:
            return reward + GAMMA * Q[first].max()
        case "limit is an end" if truncated:
            return reward
        case "same state":
            return reward + GAMMA * goes_on * Q[obs].max()
        case "mean of actions":
            return reward + GAMMA * goes_on * Q[next_obs].mean()
        case "least action":
            return reward + GAMMA * goes_on * Q[next_obs].min()
        case "all states":
            return reward + GAMMA * goes_on * Q.max()
        case "action before":
            return reward + GAMMA * goes_on * Q[next_obs, action]
        case "on policy":
            expected = (1 - exploration) * value + exploration * Q[next_obs].mean()
            return reward + GAMMA * goes_on * expected
        case "reward discounted":
            return GAMMA * (reward + goes_on * value)
        case "discounted twice":
            return reward + GAMMA**2 * goes_on * value
        case "rewards shifted":
            return reward - 0.5 + GAMMA * goes_on * value
        case "another discount":
            return reward + 0.6 * GAMMA * goes_on * value
        case "immediate reward":
            return reward
        case "rewards clipped":
            return float(np.clip(reward, -1, 1)) + GAMMA * goes_on * value
        case "signs of rewards":
            return float(np.sign(reward)) + GAMMA * goes_on * value
        case "reward negated":
            return -reward + GAMMA * goes_on * value
        case _:
            return reward + GAMMA * goes_on * value


def run_of(task: str, **learned: Any) -> Run:
    fits = fingerprint(task, discount=GAMMA, **learned)
    return Run(
        task, {name: fit.distance for name, fit in fits.items()}, {name: fit.values for name, fit in fits.items()}
    )


def explained(tables: Sequence[tuple[str, np.ndarray]]) -> list[str]:
    return list(judged([run_of(task, q=table) for task, table in tables], GOOD).names)


def test_a_constant_that_is_added_to_rewards_is_named() -> None:
    tables = []
    for probe in ("EndInPlace", "SecondThought", "Slip"):
        tables += [(f"probes/{probe}", learned_q(f"probes/{probe}", "rewards shifted", seed)) for seed in (11, 12)]
    assert explained(tables) == ["rewards shifted"]


@pytest.mark.parametrize("steps", [300, 3000])
@pytest.mark.parametrize("exploration", [0.1, 0.2, 0.4])
def test_a_learner_that_was_stopped_early_has_no_mistake(steps: int, exploration: float) -> None:
    tables = [(task, learned_q(task, "right", 21, steps, exploration)) for task in TASKS]
    for each in [tables[:1], tables[1:2], tables[2:], tables]:
        assert not set(explained(each)) - set(GOOD)


def test_a_table_and_a_function_of_observations_are_read_alike() -> None:
    table = learned_q(TASKS[1], "limit is an end", 3, steps=5000)
    of_function = fingerprint(TASKS[1], q=lambda seen: table[seen], discount=GAMMA)
    assert of_function == fingerprint(TASKS[1], q=table, discount=GAMMA)


@pytest.mark.parametrize(
    ("factor", "noise", "grows"), [(100, 0.0, False), (-1000, 0.0, False), (3, 1.0, False), (1000, 1.0, True)]
)
def test_values_of_rewards_in_another_unit_have_not_grown(factor: float, noise: float, grows: bool) -> None:
    table = learned_q(TASKS[1], "right", 3, steps=5000)
    table = table + noise * np.abs(table).max() * np.random.default_rng(0).normal(size=table.shape)
    assert ("grows" in fingerprint(TASKS[1], q=factor * table, discount=GAMMA)) == grows


def monte_carlo(task: str, masked: bool, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a random policy by TD(0), and the policy; without a mask, they go on after ends."""
    env = taskspec.make(task)
    rng = np.random.default_rng(seed)
    V = np.zeros(int(env.observation_space.n))
    visits = np.zeros_like(V)
    obs, _ = env.reset(seed=seed)
    for _ in range(60_000):
        next_obs, reward, terminated, truncated, _ = env.step(int(rng.integers(2)))
        goes_on = 1.0
        if masked and terminated:
            goes_on = 0.0
        visits[obs] += 1
        V[obs] += max(0.005, 1 / visits[obs] ** 0.8) * (reward + GAMMA * goes_on * V[next_obs] - V[obs])
        obs = next_obs
        if terminated or truncated:
            obs, _ = env.reset()
    return V, np.full((len(V), 2), 0.5)


@pytest.mark.parametrize(("masked", "names"), [(True, ["right"]), (False, ["ends ignored", "reset at the end"])])
def test_a_critic_is_compared_under_the_policy_that_it_values(masked: bool, names: list[str]) -> None:
    V, pi = monte_carlo(TASKS[0], masked, 5)
    edge, pi_at_edge = monte_carlo("probes/Slip", masked, 6)
    again = run_of("probes/Slip", values=edge, policy=pi_at_edge)
    found = judged([run_of(TASKS[0], values=V, policy=pi), again] * 3, GOOD)
    assert list(found.names) == names


def test_a_critic_is_cut_off_where_its_own_policy_is() -> None:
    """Always sowing, the field is seen at the first step alone, so that its value has the next reward, and nothing after it."""
    V = np.array([GAMMA * 2.5, 2.5])
    pi = np.array([[0.0, 1.0], [0.0, 1.0]])
    found = fingerprint("probes/ValueLeft", values=V, policy=pi, discount=GAMMA)
    assert found["limit is an end"].distance < 1e-3 < 0.5 < found["right"].distance


@pytest.mark.parametrize(
    ("task", "arguments", "code"),
    [
        ("derail/RiskyPath", {"q": np.zeros((3, 2))}, "E713"),
        ("derail/RiskyPath", {"q": np.full((4, 2), np.nan)}, "E713"),
        ("derail/RiskyPath", {"q": np.zeros((4, 2)), "discount": 1.0}, "E712"),
        ("derail/RiskyPath", {"values": np.zeros(4)}, "E713"),
        ("derail/RiskyPath", {}, "E713"),
        ("derail/NoisyObs", {"q": np.zeros((4, 2))}, "E712"),
        ("derail/Parabola", {"q": np.zeros((4, 2))}, "E712"),
    ],
)
def test_values_that_cannot_be_compared_are_refused(task: str, arguments: dict[str, Any], code: str) -> None:
    with pytest.raises(SpecError, match=code):
        fingerprint(task, **arguments)
