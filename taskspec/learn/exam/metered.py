"""Environments whose steps are counted, and whose rewards somebody else decides about."""

from __future__ import annotations

from typing import Any, Protocol

import gymnasium
import numpy as np

from taskspec.base.arrays import Array, map_parts
from taskspec.envs.env import Environment
from taskspec.language.task.task import Task


class Meter(Protocol):
    """Who counts steps, follows episodes, and decides what is paid for steps."""

    def begin(self, lanes: int, seed: Any) -> None:
        """Note that new episodes begin in all lanes, with the seed that was asked for, if any."""

    def spend(self, steps: int) -> None:
        """Count steps before they are taken; its exceptions reach the caller of the step."""

    def paid(self, before: Any, actions: Any, after: Any, rewards: Array) -> Array:
        """Return the rewards (N,) that are paid for N steps, from those of the task; observations and actions are batches."""

    def follow_one(self, reward: float, is_over: bool) -> None:
        """Note the reward of a single environment, and whether its episode ended."""

    def follow(self, rewards: Array, is_over: Array, takes_part: Array) -> None:
        """Note the rewards (N,) of the task, and which episodes ended; lanes that were reset instead take no part."""


class Metered(gymnasium.Env[Any, Any]):
    """One environment of a task, whose steps a meter counts; there is no way around it to the environment inside.

    Args:
        seed: of the stream of draws, until a reset gives another.
    """

    def __init__(self, task: Task, meter: Meter, seed: int) -> None:
        self._inside = Environment(task)
        self.observation_space = self._inside.observation_space
        self.action_space = self._inside.action_space
        self.metadata = self._inside.metadata
        self._meter = meter
        self._before: Any = None
        self._seed: int | None = seed

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        asked = seed
        if seed is None:
            seed = self._seed
            self._seed = None
        self._before, told = self._inside.reset(seed=seed, options=options)
        self._meter.begin(1, asked)
        return self._before, told

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._meter.spend(1)
        after, reward, terminated, truncated, told = self._inside.step(action)
        rewards = self._meter.paid(_batch(self._before), [action], _batch(after), np.array([reward]))
        self._meter.follow_one(reward, terminated or truncated)
        self._before = after
        return after, float(rewards[0]), terminated, truncated, told

    def action_masks(self) -> Array:
        """Return the legal actions of the present state, as `Environment.action_masks` does."""
        return self._inside.action_masks()

    def close(self) -> None:
        self._inside.close()


def _batch(seen: Any) -> Any:
    return map_parts(lambda part: [part], seen)
