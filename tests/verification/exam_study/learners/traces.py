"""Q(lambda) with replacing traces in the form of textbooks: the trace is cut where an action explores (Watkins)."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
GAMMA = 0.9
LAMBDA = 0.5
EPSILON = 0.25


@learns_from("reward")
def train(case: Case) -> Learned:
    """Return Q-values (O, A)."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    q = np.zeros((case.observation_space.n, case.action_space.n))
    trace = np.zeros_like(q)
    s, _ = env.reset()
    a = epsilon_greedy(q[s], rng)
    for step in range(case.steps):
        alpha = max(0.02, 0.3 * (1 - step / case.steps))
        s_next, r, terminated, truncated, _ = env.step(a)
        a_next = epsilon_greedy(q[s_next], rng)
        best = q[s_next].max()
        follow = 0.0 if terminated else 1.0
        delta = r + GAMMA * follow * best - q[s, a]
        trace[s] = 0.0
        trace[s, a] = 1.0
        q += alpha * delta * trace
        trace *= GAMMA * LAMBDA if q[s_next, a_next] >= best - 1e-9 else 0.0
        s, a = s_next, a_next
        if terminated or truncated:
            trace[:] = 0.0
            s, _ = env.reset()
            a = epsilon_greedy(q[s], rng)
    return Learned(q, discount=GAMMA)


def epsilon_greedy(values: Array, rng: np.random.Generator) -> int:
    """Return a best action, or a random one with probability EPSILON."""
    if rng.random() < EPSILON:
        return int(rng.integers(len(values)))
    return int((values + 1e-9 * rng.random(len(values))).argmax())
