"""What is recorded of episodes: arrays of transitions, and the trajectories that they make."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.extras import need

Seen: TypeAlias = Any
"""Observations, or actions: an array, or a dict of arrays, with as many rows; the space of the task says which."""
"""Observations: an array, or a dict of arrays where the observation space is one."""
EXTRA = "imitation"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode, or a segment of one, of T steps.

    Attributes:
        obs: T + 1 observations, the first and the last included.
        acts: T actions.
        rews: float64 (T,).
        terminated, truncated: whether the last step came to a terminal state, or to the horizon.
    """

    obs: Seen
    acts: Array
    rews: Array
    terminated: bool
    truncated: bool

    def __len__(self) -> int:
        return len(self.rews)


@dataclass(frozen=True, eq=False)
class Transitions:
    """N transitions, episode after episode, in order of time.

    Attributes:
        obs, next_obs: observations before and after each step, (N, *shape) of int64 or float32, or a dict of such arrays.
        acts: (N, *shape), int64 or float32, as the environment takes them.
        rews: float64 (N,).
        terminated, truncated: bool (N,), as the environment gives them.
        episode: int64 (N,), the number of the episode; steps of one are neighbours.
        time: int64 (N,), the steps that were taken in the episode before.
    """

    obs: Seen
    acts: Array
    rews: Array
    next_obs: Seen
    terminated: Array
    truncated: Array
    episode: Array
    time: Array

    def __len__(self) -> int:
        return len(self.rews)

    @property
    def dones(self) -> Array:
        """bool (N,): whether the episode ended with this step, in a terminal state or at the horizon."""
        return np.asarray(self.terminated | self.truncated)

    @cached_property
    def starts(self) -> Array:
        """int64 (E,): the first transition of each episode."""
        return np.flatnonzero(np.diff(self.episode, prepend=-1))

    @cached_property
    def lengths(self) -> Array:
        """int64 (E,): the steps of each episode."""
        return np.diff(self.starts, append=len(self))

    @cached_property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """The episodes one by one."""
        ends = self.starts + self.lengths
        return tuple(self._trajectory(int(a), int(b)) for a, b in zip(self.starts, ends, strict=True))

    def _trajectory(self, first: int, end: int) -> Trajectory:
        obs = joined([mapped(self.obs, lambda a: a[first:end]), mapped(self.next_obs, lambda a: a[end - 1 : end])])
        over = bool(self.terminated[end - 1]), bool(self.truncated[end - 1])
        return Trajectory(obs, self.acts[first:end], self.rews[first:end], *over)

    def returns(self, discount: float = 1.0) -> Array:
        """float64 (E,): the return of each episode, discounted from its first step."""
        first = np.repeat(self.time[self.starts], self.lengths)
        weights = discount ** (self.time - first).astype(np.float64)
        return np.add.reduceat(weights * self.rews, self.starts)

    def rows(self, indices: Array) -> Transitions:
        """Return some of the transitions (indices, or a mask)."""
        return Transitions(**{name: mapped(value, lambda a: a[indices]) for name, value in columns(self).items()})

    def imitation(self) -> list[Any]:
        """Return the trajectories as imitation's `TrajectoryWithRew`.

        Raises:
            SpecError: E705 where imitation is not installed.
        """
        types = need("imitation.data.types", EXTRA, "this")
        return [
            types.TrajectoryWithRew(
                obs=types.DictObs(t.obs) if isinstance(t.obs, dict) else t.obs, acts=t.acts, rews=t.rews, infos=None,
                terminal=t.terminated or t.truncated,
            )
            for t in self.trajectories
        ]  # fmt: skip


COLUMNS = ("obs", "acts", "rews", "next_obs", "terminated", "truncated", "episode", "time")


def columns(data: Transitions) -> dict[str, Any]:
    """Return the arrays of transitions by name."""
    return {name: getattr(data, name) for name in COLUMNS}


def concatenated(parts: Iterable[Transitions]) -> Transitions:
    """Return transitions one after the other; at least one part."""
    held = list(parts)
    return Transitions(**{name: joined([getattr(part, name) for part in held]) for name in COLUMNS})


def joined(parts: list[Any]) -> Any:
    """Return arrays, or dicts of arrays, one after the other."""
    if isinstance(parts[0], dict):
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(parts)


def mapped(value: Any, function: Callable[[Array], Array]) -> Any:
    """Return a function of an array, or of each in a dict of arrays."""
    if isinstance(value, Mapping):
        return {name: function(part) for name, part in value.items()}
    return function(value)
