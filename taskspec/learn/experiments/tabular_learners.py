"""Two right learners of tables, against which others are measured: Q-learning and Monte-Carlo control."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.learn.exam.case import Case, learns_from
from taskspec.learn.learners import CannotLearn

EXPLORATION = 0.2
STEP_SIZE = 0.1
GAMMA = 0.95


class ObservationTable:
    """Q-values of each observation that was seen, of any space; as a policy, the best action of each observation.

    Raises:
        CannotLearn: for actions that are not a few, and observations of several parts.
    """

    def __init__(self, case: Case) -> None:
        count = getattr(case.action_space, "n", None)
        if count is None or case.observation_space.shape is None:
            raise CannotLearn("tables need discrete actions, and observations of one part")
        self.n_actions = int(count)
        self.first = int(case.action_space.start)
        self.rows: dict[bytes, Array] = {}
        self.rng = np.random.default_rng(case.seed)

    def __getitem__(self, obs: Any) -> Array:
        return self.rows.setdefault(np.asarray(obs, np.float64).tobytes(), np.zeros(self.n_actions))

    def legal(self, info: dict[str, Any]) -> Array:
        """Return the indices of the legal actions, by the info of a reset or a step; of all, without a mask."""
        return np.flatnonzero(info.get("action_mask", np.ones(self.n_actions)))

    def explored(self, obs: Any, info: dict[str, Any]) -> int:
        """Return the index of a best legal action, or now and then of a random one."""
        legal = self.legal(info)
        if self.rng.random() < EXPLORATION:
            return int(legal[self.rng.integers(len(legal))])
        return int(legal[self[obs][legal].argmax()])

    def predict(self, observations: Array, action_masks: Array | None = None) -> Array:
        """Return the best actions of those that masks, bool (N, A), allow."""
        rows = np.array([self[obs] for obs in observations])
        if action_masks is not None:
            rows = np.where(action_masks, rows, -np.inf)
        return np.asarray(self.first + rows.argmax(axis=1))


@learns_from("reward")
def q_learning(case: Case) -> ObservationTable:
    """Return Q-values learned by bootstrapping from the best next action (Watkins 1989)."""
    Q = ObservationTable(case)
    env = case.env()
    obs, info = env.reset()
    for _ in range(case.steps):
        a = Q.explored(obs, info)
        next_obs, reward, terminated, truncated, info = env.step(Q.first + a)
        V = 0.0
        if not terminated:
            V = Q[next_obs][Q.legal(info)].max()
        Q[obs][a] += STEP_SIZE * (reward + GAMMA * V - Q[obs][a])
        obs = next_obs
        if terminated or truncated:
            obs, info = env.reset()
    return Q


@learns_from("reward")
def monte_carlo(case: Case) -> ObservationTable:
    """Return Q-values that are averages of returns (Sutton and Barto 2018, section 5.4); they know nothing beyond the horizon."""
    Q = ObservationTable(case)
    env = case.env()
    obs, info = env.reset()
    episode = []
    for _ in range(case.steps):
        a = Q.explored(obs, info)
        next_obs, reward, terminated, truncated, info = env.step(Q.first + a)
        episode.append((obs, a, reward))
        obs = next_obs
        if terminated or truncated:
            rest = 0.0
            for seen, action, paid in reversed(episode):
                rest += paid
                Q[seen][action] += STEP_SIZE * (rest - Q[seen][action])
            episode = []
            obs, info = env.reset()
    return Q
