"""Vector environments whose steps are counted, and whose rewards somebody else decides about."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium.vector
import numpy as np

from taskspec.envs.metered import Meter
from taskspec.envs.options import positive
from taskspec.envs.vector import VectorEnvironment
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]


class MeteredVector(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Environments of one task that are stepped together; a meter is told of their steps, and there is no way around it.

    Args:
        options: of `taskspec.envs.vector.VectorEnvironment`.
    """

    def __init__(self, task: Task, lanes: int, meter: Meter, seed: int, **options: Any) -> None:
        inside = VectorEnvironment(task, positive("lanes", lanes), **options)
        self._inside = inside
        self.num_envs = inside.num_envs
        self.observation_space = inside.observation_space
        self.action_space = inside.action_space
        self.single_observation_space = inside.single_observation_space
        self.single_action_space = inside.single_action_space
        self.metadata = inside.metadata
        self._meter = meter
        self._before: Any = None
        self._seed: int | None = seed

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        if seed is None:
            seed, self._seed = self._seed, None
        self._before, told = self._inside.reset(seed=seed, options=options)
        return self._before, told

    def step(self, actions: Any) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        self._meter.spend(self.num_envs)
        before = copy.deepcopy(self._before)  # with `reuse` the step writes over it
        after, rewards, terminated, truncated, told = self._inside.step(actions)
        paid = self._meter.paid(before, actions, _led_to(after, told, terminated | truncated), rewards)
        self._before = after
        return after, paid, terminated, truncated, told

    def close_extras(self, **kwargs: Any) -> None:
        self._inside.close()


def _led_to(after: Any, told: dict[str, Any], ended: Array) -> Any:
    """The observations that steps led to: of episodes that have begun anew within the step, the last one."""
    final = told.get("final_obs")
    if final is None or isinstance(after, dict):
        return after
    led = np.array(after)
    for lane in np.flatnonzero(ended):
        led[lane] = final[lane]
    return led
