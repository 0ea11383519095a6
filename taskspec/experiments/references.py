"""Two right learners of tables, against which others are measured: Q-learning and Monte-Carlo control."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exam.case import Case, learns_from
from taskspec.learners import CannotLearn

EXPLORATION = 0.2
STEP_SIZE = 0.1
GAMMA = 0.95


@learns_from("reward")
def q_learning(case: Case) -> Array:
    """Return Q-values learned by bootstrapping from the best next action (Watkins 1989)."""
    Q, env, rng = _begin(case)
    s, info = env.reset()
    for _ in range(case.steps):
        a = _action(Q[s], info, rng)
        next_s, reward, terminated, truncated, info = env.step(a)
        V = 0.0 if terminated else Q[next_s, _legal(info, Q)].max()
        Q[s, a] += STEP_SIZE * (reward + GAMMA * V - Q[s, a])
        s = next_s
        if terminated or truncated:
            s, info = env.reset()
    return Q


@learns_from("reward")
def monte_carlo(case: Case) -> Array:
    """Return Q-values that are averages of returns (Sutton and Barto 2018, section 5.4); they know nothing beyond the horizon."""
    Q, env, rng = _begin(case)
    s, info = env.reset()
    episode = []
    for _ in range(case.steps):
        a = _action(Q[s], info, rng)
        next_s, reward, terminated, truncated, info = env.step(a)
        episode.append((s, a, reward))
        s = next_s
        if terminated or truncated:
            rest = 0.0
            for state, action, paid in reversed(episode):
                rest += paid
                Q[state, action] += STEP_SIZE * (rest - Q[state, action])
            episode = []
            s, info = env.reset()
    return Q


def _begin(case: Case) -> tuple[Array, Any, np.random.Generator]:
    n_states = getattr(case.observation_space, "n", None)
    n_actions = getattr(case.action_space, "n", None)
    if n_states is None or n_actions is None:
        raise CannotLearn("tables need discrete observations and actions")
    return np.zeros((int(n_states), int(n_actions))), case.env(), np.random.default_rng(case.seed)


def _legal(info: dict[str, Any], Q: Array) -> Array:
    """Return the numbers of the legal actions, by the info of the last step or reset; all, without a mask."""
    return np.flatnonzero(info.get("action_mask", np.ones(Q.shape[-1])))


def _action(values: Array, info: dict[str, Any], rng: np.random.Generator) -> int:
    legal = _legal(info, values)
    if rng.random() < EXPLORATION:
        return int(legal[rng.integers(len(legal))])
    return int(legal[values[legal].argmax()])
