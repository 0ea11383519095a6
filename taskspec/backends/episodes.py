"""When lanes may step, and when their episodes begin anew: the rules that all engines keep.

- `same_step`: an episode that ends begins anew within the step. What the step gave is kept in `Buffers.final`, what is observed
  is the first observation of the next episode, and the flags tell that one has ended.
- `next_step`: it begins anew with the next step, which is spent on it: whatever the action, no step is counted, the reward is 0
  and no flag is set.
- `disabled`: it begins anew with a reset; until then no lane may step.

A reset takes the words of the lane's next episode, and a step those of its next step (`Buffers.episodes`, `Buffers.steps`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taskspec.backends.buffers import Array, Buffers
from taskspec.backends.vector import Mode


@dataclass
class Episodes:
    """Where the lanes of some buffers stand.

    `ready` says whether a step may be taken, and `over` how many episodes have ended and were not begun anew.
    """

    buffers: Buffers
    mode: Mode
    begun: bool = False
    ready: bool = False  # an attribute, since a step of few lanes takes a microsecond
    over: int = 0

    def seed(self, seeds: Array, lanes: Array | None) -> None:
        """Start the streams of some lanes (indices; None: all) anew."""
        b, chosen = self.buffers, slice(None) if lanes is None else lanes
        b.seeds[chosen] = seeds
        b.steps[chosen] = 0
        b.episodes[chosen] = 0

    def reset(self, lanes: Array) -> None:
        """Some lanes (indices, or a flag for each) have begun an episode."""
        b = self.buffers
        b.running[lanes] = True
        b.terminated[lanes] = b.truncated[lanes] = b.ended[lanes] = False
        self.begun = self.begun or bool(b.running.all())
        self.step(int(np.count_nonzero(b.ended)))

    def step(self, ended: int) -> int:
        """A step was taken after which so many episodes are over; gives their number."""
        self.over = 0 if self.mode == "same_step" else ended
        self.ready = self.begun and (self.mode != "disabled" or not self.over)
        return ended

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Put lanes (indices) into given states, (*shape, k) for each component."""
        for held, new in zip(self.buffers.state, values, strict=True):
            held[..., lanes] = new
