"""Q-learning from a replay buffer with a target table, in the form of CleanRL's DQN."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, Learned, learns_from

Array = np.ndarray[Any, Any]
GAMMA = 0.9
BATCH = 16
TRAIN_EVERY = 2
TARGET_EVERY = 50
LEARNING_STARTS = 100
START_E, END_E, EXPLORATION_FRACTION = 1.0, 0.1, 0.5


class ReplayBuffer:
    """Transitions in arrays; all are kept."""

    def __init__(self, size: int) -> None:
        self.observations = np.zeros(size, int)
        self.next_observations = np.zeros(size, int)
        self.actions = np.zeros(size, int)
        self.rewards = np.zeros(size)
        self.dones = np.zeros(size)
        self.pos = 0

    def add(self, obs: int, next_obs: int, action: int, reward: float, done: bool) -> None:
        """Store a transition."""
        self.observations[self.pos] = obs
        self.next_observations[self.pos] = next_obs
        self.actions[self.pos] = action
        self.rewards[self.pos] = reward
        self.dones[self.pos] = done
        self.pos += 1

    def sample(self, rng: np.random.Generator) -> tuple[Array, Array, Array, Array, Array]:
        """Return a batch of transitions."""
        idx = rng.integers(0, self.pos, size=BATCH)
        return (
            self.observations[idx], self.next_observations[idx], self.actions[idx], self.rewards[idx], self.dones[idx],
        )  # fmt: skip


@learns_from("reward")
def train(case: Case) -> Learned:
    """Return Q-values (O, A)."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    q = np.zeros((case.observation_space.n, case.action_space.n))
    target_q = q.copy()
    visits = np.zeros_like(q)
    rb = ReplayBuffer(case.steps)
    obs, _ = env.reset()
    for global_step in range(case.steps):
        fraction = min(1.0, global_step / (EXPLORATION_FRACTION * case.steps))
        epsilon = START_E + fraction * (END_E - START_E)
        if rng.random() < epsilon:
            action = int(rng.integers(q.shape[1]))
        else:
            action = greedy(q[obs], rng)
        next_obs, reward, terminated, truncated, _ = env.step(action)
        rb.add(obs, next_obs, action, reward, terminated)
        obs = next_obs
        if terminated or truncated:
            obs, _ = env.reset()
        if global_step >= LEARNING_STARTS and global_step % TRAIN_EVERY == 0:
            o, next_o, a, r, d = rb.sample(rng)
            target_max = target_q[next_o].max(axis=1)
            td_target = r + GAMMA * target_max * (1 - d)
            np.add.at(visits, (o, a), 1)
            rate = np.maximum(0.02, visits[o, a] ** -0.6)
            old_val = q[o, a]
            np.add.at(q, (o, a), rate / counts(o, a) * (td_target - old_val))
            if global_step % TARGET_EVERY == 0:
                target_q = q.copy()
    return Learned(q, discount=GAMMA)


def counts(o: Array, a: Array) -> Array:
    """Return how often the pair of each transition is in the batch."""
    same = (o[:, None] == o) & (a[:, None] == a)
    return same.sum(axis=1)


def greedy(values: Array, rng: np.random.Generator) -> int:
    """Return one of the best actions."""
    return int((values + 1e-9 * rng.random(len(values))).argmax())
