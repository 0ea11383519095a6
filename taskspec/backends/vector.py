"""The interface of a vector program, and when its lanes begin a new episode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from taskspec.backends.buffers import Buffers
from taskspec.base.arrays import Array
from taskspec.task.spaces import SpaceLayout

Mode = Literal["next_step", "same_step", "disabled"]
"""When an environment whose episode has ended is reset: by the next step, by the same step, by the caller only."""


class LanesNotRunningError(Exception):
    """A step before the first reset, or (mode "disabled") of lanes whose episodes have ended."""


class Engine(Protocol):
    """The environments of one task on one backend.

    Lane i draws from the stream of `buffers.seeds[i]`: its episodes and steps equal those of a scalar environment with
    that seed, number for number.
    """

    buffers: Buffers
    observation: SpaceLayout
    action: SpaceLayout
    source: str

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        """Restart the streams of some lanes (indices; None: all) with seeds, uint64, one for each."""

    def reset(self, lanes: Array | None = None) -> None:
        """Begin an episode in some lanes (indices; None: all)."""

    def step(self, actions: Any) -> int:
        """Take a step in every lane; return the number of lanes whose episodes ended in it.

        Raises:
            BadActionError: an action is not in the action space; nothing has changed.
            LanesNotRunningError: an episode is over, or none has begun; nothing has changed.
        """

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Put lanes into given states, (*shape, k) for each component; what is observed stays as it was."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a vector program; `num_threads` matters to Numba only."""

    mode: Mode = "next_step"
    num_threads: int = 1


Make = Callable[[Any, int, Options], Engine]


# -- when lanes may step and when they are reset ------------------------------------------------------------------
#
# - `same_step`: a lane whose episode ends is reset in the same step. The last observation is in `Buffers.final`, the first one
#   of the next episode in `Buffers.seen`, and the flags say that an episode ended.
# - `next_step`: it is reset by the next step, which ignores the action, is not counted, has reward 0 and sets no flag.
# - `disabled`: it is reset by the caller; until then no lane may step.
#
# A reset takes the words of the lane's next episode, and a step those of its next step (`Buffers.episodes`, `Buffers.steps`).


@dataclass
class Episodes:
    """The progress of episodes in some buffers.

    `ready` says whether a step may be taken, and `over` how many episodes have ended without a reset.
    """

    buffers: Buffers
    mode: Mode
    begun: bool = False
    ready: bool = False  # an attribute, since a step of few lanes takes a microsecond
    over: int = 0

    def seed(self, seeds: Array, lanes: Array | None) -> None:
        """Restart the streams of some lanes (indices; None: all)."""
        b = self.buffers
        chosen = slice(None) if lanes is None else lanes
        b.seeds[chosen] = seeds
        b.steps[chosen] = 0
        b.episodes[chosen] = 0

    def reset(self, lanes: Array) -> None:
        """Record that some lanes (indices, or a flag for each) have begun an episode."""
        b = self.buffers
        b.running[lanes] = True
        b.terminated[lanes] = b.truncated[lanes] = b.ended[lanes] = False
        self.begun = self.begun or bool(b.running.all())
        self.step(int(np.count_nonzero(b.ended)))

    def step(self, ended: int) -> int:
        """Record a step in which `ended` episodes ended; return their number."""
        self.over = 0 if self.mode == "same_step" else ended
        self.ready = self.begun and (self.mode != "disabled" or not self.over)
        return ended

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Set the states of lanes (indices), (*shape, k) for each component."""
        for held, new in zip(self.buffers.state, values, strict=True):
            held[..., lanes] = new
