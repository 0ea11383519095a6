"""DQN of Stable-Baselines3, with the places where mistakes are made."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3 import DQN
from stable_baselines3.common.buffers import ReplayBuffer

from taskspec.exam import Case, learns_from

Array = np.ndarray[Any, Any]
SETTINGS: dict[str, Any] = {
    "learning_rate": 1e-3, "gamma": 0.9, "learning_starts": 100, "train_freq": 2, "target_update_interval": 20,
    "exploration_fraction": 0.5, "exploration_final_eps": 0.3, "policy_kwargs": {"net_arch": [32]}, "device": "cpu",
}  # fmt: skip


class Buffer(ReplayBuffer):
    """Transitions as they are stored."""

    last_reward = 0.0

    def add(self, obs: Array, next_obs: Array, action: Array, reward: Array, done: Array, infos: Any) -> None:
        """Store a transition."""
        super().add(obs, next_obs, action, reward, done, infos)
        self.last_reward = reward


class Learner(DQN):
    """DQN as it stores what its environment returned."""

    def _store_transition(self, buffer: Any, action: Any, new_obs: Any, reward: Any, dones: Any, infos: Any) -> None:
        super()._store_transition(buffer, action, new_obs, reward, dones, infos)


@learns_from("reward")
def train(case: Case) -> DQN:
    """Return a model."""
    storing = {"handle_timeout_termination": True}
    model = Learner(
        "MlpPolicy", case.env(), replay_buffer_class=Buffer, replay_buffer_kwargs=storing, seed=case.seed, **SETTINGS
    )
    return model.learn(case.steps)
