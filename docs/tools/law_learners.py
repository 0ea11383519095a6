"""Learners for the table of laws: small ones in NumPy, and PPO of Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, learns_from

Array = np.ndarray[Any, Any]


class Table:
    """Values of actions for each observation that was seen, of any kind of observation."""

    def __init__(self, actions: int) -> None:
        self.rows: dict[bytes, Array] = {}
        self.actions = actions

    def __getitem__(self, obs: Any) -> Array:
        return self.rows.setdefault(np.asarray(obs, float).tobytes(), np.zeros(self.actions))

    def predict(self, observations: Array) -> Array:
        return np.array([self[obs].argmax() for obs in observations])


def explored(q: Array, rng: np.random.Generator) -> int:
    """Return a best action, or in three of ten steps a random one."""
    if rng.random() < 0.3:
        return int(rng.integers(len(q)))
    return int(rng.choice(np.flatnonzero(q == q.max())))


@learns_from("reward")
def q_learning(case: Case) -> Table:
    """Tabular Q-learning."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    table = Table(case.action_space.n)
    obs, _ = env.reset()
    for _ in range(case.steps):
        action = explored(table[obs], rng)
        after, reward, terminated, truncated, _ = env.step(action)
        target = reward + (0 if terminated else 0.99 * table[after].max())
        table[obs][action] += 0.1 * (target - table[obs][action])
        obs = env.reset()[0] if terminated or truncated else after
    return table


@learns_from("reward")
def monte_carlo(case: Case) -> Table:
    """Monte Carlo control: no bootstrap."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    table = Table(case.action_space.n)
    obs, _ = env.reset()
    episode = []
    for _ in range(case.steps):
        action = explored(table[obs], rng)
        after, reward, terminated, truncated, _ = env.step(action)
        episode.append((obs, action, reward))
        obs = after
        if terminated or truncated:
            earned = 0.0
            for seen, done, paid in reversed(episode):
                earned += paid
                table[seen][done] += 0.1 * (earned - table[seen][done])
            episode = []
            obs, _ = env.reset()
    return table


@learns_from("reward")
def reinforce(case: Case) -> Table:
    """REINFORCE with a softmax over a table, and a running mean as baseline."""
    env = case.env()
    rng = np.random.default_rng(case.seed)
    table = Table(case.action_space.n)
    obs, _ = env.reset()
    episode = []
    baseline = 0.0
    for _ in range(case.steps):
        weights = np.exp(table[obs] - table[obs].max())
        pi = weights / weights.sum()
        action = int(rng.choice(len(pi), p=pi))
        after, reward, terminated, truncated, _ = env.step(action)
        episode.append((obs, action, pi, reward))
        obs = after
        if terminated or truncated:
            earned = 0.0
            for seen, done, probabilities, paid in reversed(episode):
                earned += paid
                table[seen][:] -= 0.1 * (earned - baseline) * probabilities
                table[seen][done] += 0.1 * (earned - baseline)
            baseline += 0.1 * (earned - baseline)
            episode = []
            obs, _ = env.reset()
    return table


@learns_from("reward")
def sb3_ppo(case: Case) -> Any:
    """PPO of Stable-Baselines3."""
    from stable_baselines3 import PPO

    model = PPO("MlpPolicy", case.env(), n_steps=200, batch_size=100, learning_rate=3e-3, seed=case.seed, device="cpu")
    return model.learn(case.steps // 200 * 200)


SMALL = ("RiskyPath", "EarlyTermNeg", "Slip")
LEARNERS = {
    "Q-learning": ("q_learning", 5000, SMALL),
    "Monte Carlo": ("monte_carlo", 5000, SMALL),
    "REINFORCE": ("reinforce", 5000, SMALL),
    "PPO (Stable-Baselines3)": ("sb3_ppo", 3000, ("RiskyPath",)),
}
"""The columns of the table: the function of each learner, its steps and its tasks."""
