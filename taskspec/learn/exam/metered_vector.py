"""Environments that are stepped together, whose steps are counted; apart, since they need Gymnasium 1.1."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium.vector
import numpy as np

from taskspec.base.arrays import Array
from taskspec.envs.options import positive
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.task.task import Task
from taskspec.learn.exam.metered import Meter


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
        asked = seed
        if seed is None:
            seed = self._seed
            self._seed = None
        self._before, told = self._inside.reset(seed=seed, options=options)
        if "reset_mask" not in (options or {}):
            self._meter.begin(self.num_envs, asked)
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
