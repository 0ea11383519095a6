"""Learners for the table of laws: small ones in NumPy, PPO of Stable-Baselines3, and one loop with PyTorch."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exam import Case, learns_from
from taskspec.learn.experiments.tabular_learners import ObservationTable, monte_carlo, q_learning

__all__ = ["monte_carlo", "q_learning"]


@learns_from("reward")
def reinforce(case: Case) -> ObservationTable:
    """REINFORCE with a softmax over a table, and a running mean as baseline."""
    env = case.env()
    table = ObservationTable(case)
    obs, _ = env.reset()
    episode = []
    baseline = 0.0
    for _ in range(case.steps):
        weights = np.exp(table[obs] - table[obs].max())
        pi = weights / weights.sum()
        action = int(table.rng.choice(len(pi), p=pi))
        after, reward, terminated, truncated, _ = env.step(table.first + action)
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


@learns_from("reward")
def cleanrl_style(case: Case) -> Any:
    """Q-learning in one loop with PyTorch."""
    from docs.howto.scripts.learners.cleanrl_style import train

    return train(case)


SMALL = ("RiskyPath", "EarlyTermNeg", "Slip")
LEARNERS = {
    "Q-learning": ("q_learning", 5000, SMALL),
    "Monte Carlo": ("monte_carlo", 5000, SMALL),
    "REINFORCE": ("reinforce", 5000, SMALL),
    "PPO (Stable-Baselines3)": ("sb3_ppo", 3000, ("RiskyPath",)),
    "Q-learning (CleanRL-style)": ("cleanrl_style", 3000, ("RiskyPath",)),
}
"""The columns of the table: the function of each learner, its steps and its tasks."""
