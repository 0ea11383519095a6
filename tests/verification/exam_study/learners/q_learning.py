"""Q-learning over a table: optimistic at first, epsilon-greedy, with steps that shrink."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
OPTIMISM = 10.0
DISCOUNT = 0.95


@learns_from("reward")
def train(case: Case) -> Learned:
    """The values of actions, (S, A)."""
    env, rng = case.env(), np.random.default_rng(case.seed)
    q = np.full((case.observation_space.n, case.action_space.n), OPTIMISM)
    visits = np.zeros_like(q)
    seen, _ = env.reset()
    for step in range(case.steps):
        epsilon = max(0.1, 1 - 2 * step / case.steps)
        action = rng.integers(q.shape[1]) if rng.random() < epsilon else best(q[seen], rng)
        after, reward, terminated, truncated, _ = env.step(action)
        visits[seen, action] += 1
        rate = visits[seen, action] ** -0.6
        ahead = 0.0 if terminated else q[after].max()
        q[seen, action] += rate * (reward + DISCOUNT * ahead - q[seen, action])
        if terminated or truncated:
            after, _ = env.reset()
        seen = after
    return Learned(q, discount=0.95)


def best(values: Array, rng: np.random.Generator) -> int:
    """One of the best actions (A,), each as often."""
    return int((values + 1e-9 * rng.random(len(values))).argmax())
