"""Several instances of a task behind one vector interface: each lane has the constants of its own `instance_seed`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space

from taskspec import draws
from taskspec.base.arrays import Array
from taskspec.envs.lanes import LaneView
from taskspec.envs.options import invalid, seed_of
from taskspec.envs.vector import VectorEnvironment
from taskspec.task.task import Task


class InstanceLanes(VectorEnvironment):
    """Lanes of several instances of one task; `task` is that of the first. Lanes of one instance are stepped together.

    `tasks` are the instances, lane by lane; options are those of `VectorEnvironment`. Lane i of `reset(seed=s)` walks the
    trajectory of the scalar environment of its own instance with seed s + i.

    Raises:
        SpecError: E713, where the instances have different spaces.
    """

    def __init__(self, tasks: Sequence[Task], **options: Any) -> None:
        self.tasks: tuple[Task, ...] = tuple(tasks)
        self.num_envs: int = len(tasks)
        self._spec = None
        lanes: dict[str, list[int]] = {}
        for i, task in enumerate(tasks):
            lanes.setdefault(task.content_hash, []).append(i)
        self._where = [np.array(found) for found in lanes.values()]
        self._parts = [VectorEnvironment(tasks[found[0]], len(found), **options) for found in lanes.values()]
        first = self._parts[0]
        self.task: Task = first.task
        for part in self._parts:
            for name in ("single_observation_space", "single_action_space"):
                if getattr(part, name) != getattr(first, name):
                    message = f"the instances have different spaces: {getattr(first, name)} and {getattr(part, name)}"
                    raise invalid(f"{message}; declare bounds that hold for all")
        self.metadata: dict[str, Any] = first.metadata
        self.render_mode: str | None = first.render_mode
        self.backend: str = first.backend
        self.single_observation_space: gymnasium.Space[Any] = first.single_observation_space
        self.single_action_space: gymnasium.Space[Any] = first.single_action_space
        self.observation_space: gymnasium.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space: gymnasium.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        self._seeded = False

    @property
    def instances(self) -> tuple[int, ...]:
        """The `instance_seed` of every lane."""
        return tuple(task.values["instance_seed"] for task in self.tasks)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every lane, or in those of `options["reset_mask"]`; see `VectorEnvironment.reset`."""
        seeds = self._seeds(seed)
        mask = None if options is None else options.get("reset_mask")
        if mask is not None and (not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,)):
            raise invalid(f"reset_mask must be a bool array of shape ({self.num_envs},), not {mask!r}")
        found = []
        for lanes, part in zip(self._where, self._parts, strict=True):
            inner = options if mask is None else {**(options or {}), "reset_mask": mask[lanes]}
            found.append(part.reset(seed=None if seeds is None else [seeds[i] for i in lanes], options=inner)[0])
        self._seeded = True
        return self._joined(found), {}

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None] | None:
        """Return a seed for each lane; lanes of different instances have different streams from the first reset on."""
        if seed is None and self._seeded:
            return None
        if seed is None:
            seed = int(np.random.default_rng().integers(2**63))
        if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str | bytes):
            if len(seed) != self.num_envs:
                raise invalid(f"{len(seed)} seeds for {self.num_envs} lanes")
            return list(seed)
        return [int(s) for s in draws.lane_seeds(seed_of(seed), self.num_envs)]

    def step(self, actions: Any) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        """Take a step in every lane; see `VectorEnvironment.step`."""
        given = np.asarray(actions)
        if given.shape[:1] != (self.num_envs,):
            raise invalid(f"{actions!r} are not {self.num_envs} actions")
        found = [part.step(given[lanes]) for lanes, part in zip(self._where, self._parts, strict=True)]
        rewards, terminated, truncated = (self._joined([result[k] for result in found]) for k in (1, 2, 3))
        return self._joined([result[0] for result in found]), rewards, terminated, truncated, self._infos(found)

    def _infos(self, found: list[Any]) -> dict[str, Any]:
        """Last observations of the episodes that ended in this step, as `VectorEnvironment` has them."""
        if not any(infos for *_, infos in found):
            return {}
        last = np.full(self.num_envs, None, dtype=object)
        ended = np.zeros(self.num_envs, np.bool_)
        for lanes, (*_, infos) in zip(self._where, found, strict=True):
            for k, lane in enumerate(lanes.tolist()) if infos else ():
                last[lane], ended[lane] = infos["final_obs"][k], infos["_final_obs"][k]
        return {"final_obs": last, "_final_obs": ended, "final_info": {}, "_final_info": ended.copy()}

    def _joined(self, parts: list[Any]) -> Any:
        """Return values of all lanes, in order, from those of the instances."""
        if isinstance(parts[0], dict):
            return {name: self._joined([part[name] for part in parts]) for name in parts[0]}
        whole = np.empty((self.num_envs, *parts[0].shape[1:]), parts[0].dtype)
        for lanes, part in zip(self._where, parts, strict=True):
            whole[lanes] = part
        return whole

    @property
    def source(self) -> str:
        """The generated code that steps the environments, instance after instance."""
        return "\n".join(part.source for part in self._parts)

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays that hold state, counters and results."""
        return sum(part.nbytes for part in self._parts)

    @property
    def time(self) -> Array:
        """Steps taken in the present episode of every lane: int64 (num_envs,)."""
        return np.asarray(self._joined([part.time for part in self._parts]))

    def _lane(self, number: int) -> LaneView:
        for lanes, part in zip(self._where, self._parts, strict=True):
            for k in np.flatnonzero(lanes == number).tolist():
                return part._lane(k)
        raise IndexError(number)
