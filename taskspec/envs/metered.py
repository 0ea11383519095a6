"""Environments whose steps are counted, and whose rewards somebody else decides about."""

from __future__ import annotations

import copy
from typing import Any, Protocol

import gymnasium
import gymnasium.vector
import numpy as np

from taskspec.base.arrays import Array, map_parts
from taskspec.envs.env import Environment
from taskspec.envs.options import positive
from taskspec.envs.vector import VectorEnvironment
from taskspec.task.task import Task


class Meter(Protocol):
    """Who counts steps, follows episodes, and decides what is paid for steps."""

    def begin(self, lanes: int) -> None:
        """Note that new episodes begin in all lanes."""

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
        if seed is None:
            seed = self._seed
            self._seed = None
        self._before, told = self._inside.reset(seed=seed, options=options)
        self._meter.begin(1)
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


class MeteredVector(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Environments of one task that are stepped together; a meter counts their steps, and there is no way around it.

    Args:
        options: of `taskspec.envs.vector.VectorEnvironment`.
    """

    def __init__(self, task: Task, lanes: int, meter: Meter, seed: int, **options: Any) -> None:
        self._inside = VectorEnvironment(task, positive("lanes", lanes), **options)
        spaces = ("observation_space", "action_space", "single_observation_space", "single_action_space")
        for name in ("num_envs", "metadata", *spaces):
            setattr(self, name, getattr(self._inside, name))
        self._meter = meter
        self._before: Any = None
        self._seed: int | None = seed
        self._is_reset_next = np.zeros(self.num_envs, np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        if seed is None:
            seed = self._seed
            self._seed = None
        self._before, told = self._inside.reset(seed=seed, options=options)
        if "reset_mask" not in (options or {}):
            self._meter.begin(self.num_envs)
        self._is_reset_next = np.zeros(self.num_envs, np.bool_)
        return self._before, told

    def step(self, actions: Any) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        self._meter.spend(self.num_envs)
        before = copy.deepcopy(self._before)  # with `reuse` the step writes over it
        after, rewards, terminated, truncated, told = self._inside.step(actions)
        led_to = after
        if "final_obs" in told and not isinstance(after, dict):  # of an episode that ended in the step, the last one
            led_to = np.array(after)
            for lane in np.flatnonzero(terminated | truncated):
                led_to[lane] = told["final_obs"][lane]
        paid = self._meter.paid(before, actions, led_to, rewards)
        is_over = terminated | truncated
        self._meter.follow(rewards, is_over, ~self._is_reset_next)
        if self._inside.autoreset_mode == gymnasium.vector.AutoresetMode.NEXT_STEP:
            self._is_reset_next = np.array(is_over)
        self._before = after
        return after, paid, terminated, truncated, told

    def close_extras(self, **kwargs: Any) -> None:
        self._inside.close()


def _batch(seen: Any) -> Any:
    """Return an observation as a batch of one."""
    return map_parts(lambda part: [part], seen)
