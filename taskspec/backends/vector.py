"""What a vector program is to the environment that wraps it: many environments, stepped together by one backend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from taskspec.backends.buffers import Array, Buffers
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
        """Start the streams of some lanes (indices; None: all) anew: uint64, one for each."""

    def reset(self, lanes: Array | None = None) -> None:
        """Begin an episode in some lanes (indices; None: all)."""

    def step(self, actions: Any) -> int:
        """Take a step in every lane; gives the number of lanes whose episodes ended in it.

        Raises:
            BadActionError: an action is not in the action space; nothing has changed.
            LanesNotRunningError: an episode is over, or none has begun; nothing has changed.
        """

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Put lanes into given states, (*shape, k) for each component; what is observed stays as it was."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a vector program runs: `num_threads` matters to Numba only."""

    mode: Mode = "next_step"
    num_threads: int = 1


Make = Callable[[Any, int, Options], Engine]
