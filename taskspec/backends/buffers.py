"""Arrays of a vector program: counters, state and results of many environments, features first and lanes last.

Lanes last keeps each feature of all lanes together, which is what array code and vector units want. What is handed
out has the lanes first, as Gymnasium expects, without a copy: a view of the same memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Component, Task

Array = np.ndarray[Any, Any]
DTYPES: dict[Kind, Any] = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}


@dataclass(frozen=True)
class Values:
    """Gymnasium values of all lanes.

    `parts` are the raw arrays, (*shape, lanes): one for every key of a dict, otherwise a single one.
    """

    layout: SpaceLayout
    parts: tuple[Array, ...]

    @classmethod
    def empty(cls, layout: SpaceLayout, lanes: int, gap: int = 0) -> Values:
        """Zeros of a layout, with so many numbers between the rows of an array."""
        if layout.form == "dict":
            return cls(layout, tuple(_entry(c, lanes, gap) for c in layout.components))
        dtype = np.int64 if layout.form in ("discrete", "multi_discrete") else np.float32
        shape = () if layout.form == "discrete" else (layout.size,) if layout.shape else ()
        return cls(layout, (_zeros(shape, lanes, gap, dtype),))

    def view(self) -> Any:
        """The values with the lanes first, sharing memory: what Gymnasium's batched space holds."""
        return self._shown(self.parts)

    def fresh(self) -> Any:
        """The same in memory of its own."""
        return self._shown([part.copy() for part in self.parts])

    def _shown(self, parts: Sequence[Array]) -> Any:
        if self.layout.form == "dict":
            pairs = zip(self.layout.components, parts, strict=True)
            return {c.name: _lanes_first(part) for c, part in pairs}
        (raw,) = parts
        return _lanes_first(raw if len(self.layout.shape) < 2 else raw.reshape(*self.layout.shape, -1))

    def part(self, lanes: slice) -> Values:
        """A range of the lanes, sharing memory."""
        return Values(self.layout, tuple(part[..., lanes] for part in self.parts))

    def flat(self) -> Array:
        """All elements as rows, sharing memory: one row for every element (not for dicts)."""
        (raw,) = self.parts
        return raw.reshape(-1, raw.shape[-1])


def _lanes_first(array: Array) -> Array:
    """An array (*shape, lanes) as (lanes, *shape). `moveaxis` would take longer than the rest of a step of few lanes."""
    return array.T if array.ndim <= 2 else array.transpose(-1, *range(array.ndim - 1))


def _entry(c: Component, lanes: int, gap: int) -> Array:
    whole = c.is_finite and c.type.is_scalar
    return _zeros(c.type.shape, lanes, gap, np.int64 if whole else np.float32)


def _zeros(shape: tuple[int, ...], lanes: int, gap: int, dtype: Any) -> Array:
    rows = np.zeros((math.prod(shape), lanes + gap), dtype)[:, :lanes]
    return rows.reshape(*shape, lanes)


@dataclass
class Buffers:
    """Everything that a vector environment keeps, for lanes 0 to N - 1.

    Attributes:
        seeds: uint64 (N,), the seed of each lane.
        steps: uint32 (N,), steps taken since the lane was seeded, modulo 2**32: counts the draws of steps.
        episodes: uint32 (N,), episodes begun since then: counts the draws of resets.
        time: int64 (N,), steps taken in the present episode.
        running: bool (N,), whether an episode is under way.
        state: one array (*shape, N) for every state component: bool, int64 or float64.
        seen, final: observations now, and those with which episodes ended in this step.
        reward: float64 (N,). terminated, truncated, ended: bool (N,).
    """

    seeds: Array
    steps: Array
    episodes: Array
    time: Array
    running: Array
    state: tuple[Array, ...]
    seen: Values
    final: Values
    reward: Array
    terminated: Array
    truncated: Array
    ended: Array

    @classmethod
    def of(cls, task: Task, layout: SpaceLayout, lanes: int, gap: int = 0) -> Buffers:
        """Zeros, for a task whose observations have the given layout.

        With a gap of so many numbers between rows they are not a power of two apart. Rows that are share the few places
        that a cache has for such addresses, and a loop over many of them takes three times as long.
        """
        flags = [np.zeros(lanes, np.bool_) for _ in range(4)]
        return cls(
            seeds=np.zeros(lanes, np.uint64),
            steps=np.zeros(lanes, np.uint32),
            episodes=np.zeros(lanes, np.uint32),
            time=np.zeros(lanes, np.int64),
            running=flags[0],
            state=tuple(_zeros(c.type.shape, lanes, gap, DTYPES[c.type.kind]) for c in task.state),
            seen=Values.empty(layout, lanes, gap),
            final=Values.empty(layout, lanes, gap),
            reward=np.zeros(lanes, np.float64),
            terminated=flags[1],
            truncated=flags[2],
            ended=flags[3],
        )

    @property
    def lanes(self) -> int:
        return len(self.seeds)

    def part(self, lanes: slice) -> Buffers:
        """A range of the lanes, sharing memory."""
        return Buffers(
            self.seeds[lanes],
            self.steps[lanes],
            self.episodes[lanes],
            self.time[lanes],
            self.running[lanes],
            tuple(s[..., lanes] for s in self.state),
            self.seen.part(lanes),
            self.final.part(lanes),
            self.reward[lanes],
            self.terminated[lanes],
            self.truncated[lanes],
            self.ended[lanes],
        )

    def nbytes(self) -> int:
        """Bytes of all arrays."""
        flags = (self.running, self.terminated, self.truncated, self.ended)
        counters = (self.seeds, self.steps, self.episodes, self.time, self.reward)
        values: Sequence[Array] = (*self.state, *self.seen.parts, *self.final.parts)
        return sum(a.nbytes for a in (*flags, *counters, *values))
