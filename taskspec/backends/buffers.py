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

from taskspec.base.arrays import Array
from taskspec.lang.types import Kind
from taskspec.task.spaces import Part, SpaceLayout
from taskspec.task.task import Task

DTYPES: dict[Kind, Any] = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}


@dataclass(frozen=True)
class Values:
    """Gymnasium values of all lanes.

    `parts` are the raw arrays, (*shape, lanes): one for every part of the layout.
    """

    layout: SpaceLayout
    parts: tuple[Array, ...]

    @classmethod
    def empty(cls, layout: SpaceLayout, lanes: int, gap: int = 0) -> Values:
        """Zeros of a layout, with so many numbers between the rows of an array."""
        return cls(layout, tuple(_raw(part, lanes, gap) for part in layout.parts))

    def view(self) -> Any:
        """Return the values with the lanes first, sharing memory: what Gymnasium's batched space holds."""
        return self._shown(self.parts)

    def fresh(self) -> Any:
        """Return the same in memory of its own."""
        return self._shown([part.copy() for part in self.parts])

    def _shown(self, raw: Sequence[Array]) -> Any:
        shown = list(map(_lanes_first, raw))
        return {p.name: a for p, a in zip(self.layout.parts, shown, strict=True)} if self.layout.is_dict else shown[0]

    def part(self, lanes: slice) -> Values:
        """Return a range of the lanes, sharing memory."""
        return Values(self.layout, tuple(part[..., lanes] for part in self.parts))

    def segments(self) -> list[Array]:
        """Return the arrays of the layout's segments, sharing memory: (*shape, lanes) of the component, or a row for each
        value.
        """
        found = []
        for segment in self.layout.segments:
            raw = self.parts[segment.part]
            rows = raw.reshape(-1, raw.shape[-1])[segment.first : segment.first + segment.size]
            shape = (
                (segment.size,) if segment.values is not None else self.layout.components[segment.component].type.shape
            )
            found.append(rows.reshape(*shape, raw.shape[-1]))
        return found


def _lanes_first(array: Array) -> Array:
    """Return an array (*shape, lanes) as (lanes, *shape). `moveaxis` would take longer than the rest of a step of few
    lanes.
    """
    return array.T if array.ndim <= 2 else array.transpose(-1, *range(array.ndim - 1))


def _raw(part: Part, lanes: int, gap: int) -> Array:
    return _zeros(part.shape, lanes, gap, np.int64 if part.is_whole else np.float32)


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
        """Return a range of the lanes, sharing memory."""
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
        """Return bytes of all arrays."""
        flags = (self.running, self.terminated, self.truncated, self.ended)
        counters = (self.seeds, self.steps, self.episodes, self.time, self.reward)
        values: Sequence[Array] = (*self.state, *self.seen.parts, *self.final.parts)
        return sum(a.nbytes for a in (*flags, *counters, *values))
