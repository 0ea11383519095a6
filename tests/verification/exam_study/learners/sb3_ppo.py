"""PPO of Stable-Baselines3, with the places where mistakes are made."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnvWrapper

from taskspec.exam import Case, learns_from

SETTINGS: dict[str, Any] = {
    "n_steps": 100, "batch_size": 100, "learning_rate": 5e-3, "gamma": 0.9, "policy_kwargs": {"net_arch": [32]}, "device": "cpu",
}  # fmt: skip


class Environments(VecEnvWrapper):
    """Environments as PPO sees them."""

    def reset(self) -> Any:
        """Begin episodes."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Return what a step led to."""
        obs, rewards, dones, infos = self.venv.step_wait()
        return obs, np.array(rewards), dones, infos


class Buffer(RolloutBuffer):
    """A round of steps, and their advantages."""

    def compute_returns_and_advantage(self, last_values: Any, dones: Any) -> None:
        """Work out returns and advantages."""
        super().compute_returns_and_advantage(last_values, dones)


@learns_from("reward")
def train(case: Case) -> PPO:
    """Return a model."""
    env = Environments(DummyVecEnv([case.env]))
    return PPO("MlpPolicy", env, rollout_buffer_class=Buffer, seed=case.seed, **SETTINGS).learn(case.steps)
