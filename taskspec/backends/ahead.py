"""Draws computed ahead for many lanes: values of coming steps, and the first states of coming episodes.

A call of NumPy costs the same for ten numbers and for a thousand, and the random words of one step take more than a
hundred calls. So words, and values that depend on them alone, are computed for several steps at once, and first states
for many lanes at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.backends.buffers import Buffers
from taskspec.backends.lowering.hoist import Hoisted
from taskspec.base.arrays import Array
from taskspec.lang import batch
from taskspec.lang.ir import Node
from taskspec.lang.ir import draws as draws_below
from taskspec.lang.variates import WordLayout, batch_sampler

WORDS = 65_536
"""The largest number of random words computed at once, unless a single step takes more."""
STEPS = 64


class Ahead:
    """The hoisted values and named words of a phase, step after step, for the lanes of some buffers."""

    def __init__(self, hoisted: Hoisted, buffers: Buffers) -> None:
        self._hoisted = hoisted
        self._buffers = buffers
        self._words = hoisted.word_numbers
        count = hoisted.layout.count
        lanes = buffers.lanes
        self._depth = max(1, min(STEPS, WORDS // max(1, count * lanes)))
        self._lanes = np.arange(lanes)
        self._items: list[Array] = []  # (*shape, depth, lanes) each
        self._rows: Iterator[tuple[Array, ...]] = iter(())  # the same, row after row
        self._base = np.zeros(lanes, np.uint32)
        self._at = self._depth  # the next row, while all lanes are at the same one
        self._together = True
        self._uncounted = 0

    def settle(self) -> None:
        """Count the steps taken: `Buffers.steps` is right after this, until the next step."""
        if self._uncounted:
            self._buffers.steps += np.uint32(self._uncounted)
            self._uncounted = 0

    def restart(self, everywhere: bool) -> None:
        """Drop fetched values, because all lanes or some were seeded."""
        self._at = self._depth
        self._together = everywhere

    def part_ways(self) -> None:
        """From now on lanes may have taken different numbers of steps since they were seeded."""
        if self._together:
            self._together = False
            if self._at < self._depth and len(self._items):
                self._at = 0  # rows are found by each lane's own count

    def take(self) -> Sequence[Array]:
        """Return the items of the next step, (*shape, lanes) each: hoisted values, then words; the step is counted."""
        if not self._together or self._at >= self._depth:
            self.settle()
        self._uncounted += 1
        if not self._hoisted.names and not self._words:
            return ()
        if not self._together:
            return self._own_rows()
        if self._at >= self._depth:
            self._fetch()
        self._at += 1
        return next(self._rows)

    def _own_rows(self) -> list[Array]:
        rows = (self._buffers.steps - self._base).astype(np.int64)
        if self._at >= self._depth or int(rows.max()) >= self._depth:
            self._fetch()
            self._at = 0
            rows = np.zeros(len(self._lanes), np.int64)
        places = rows * len(self._lanes) + self._lanes
        return [np.take(i.reshape(*i.shape[:-2], -1), places, axis=-1, mode="clip") for i in self._items]

    def _fetch(self) -> None:
        steps = self._buffers.steps
        lanes = len(self._lanes)
        depth = self._depth
        self._base = steps.copy()
        self._at = 0
        words = draws.lanes_ahead(self._buffers.seeds, steps, depth, self._hoisted.layout.count)
        values = evaluated(self._hoisted.values, self._hoisted.layout, words)
        named = [words[k].astype(np.int64) for k in self._words.values()]
        shaped = [v.reshape(*v.shape[:-1], depth, lanes) for v in values]
        self._items = [*shaped, *(w.reshape(depth, lanes) for w in named)]
        self._rows = zip(*(np.moveaxis(item, -2, 0) for item in self._items), strict=True)


class Ready:
    """The first state of the next episode of every lane, computed for many lanes at once."""

    def __init__(self, roots: Sequence[Node], layout: WordLayout, buffers: Buffers) -> None:
        # What is observed at first is often the state itself: such values are kept once.
        self._roots = tuple(dict.fromkeys(roots))
        self._buffers = buffers
        self._places = [self._roots.index(root) for root in roots]
        self._layout = layout
        self.fixed = not draws_below(roots)
        lanes = 1 if self.fixed else buffers.lanes
        first = evaluated(self._roots, self._layout, np.zeros((self._layout.count, 1), np.uint32))
        self._held = [np.broadcast_to(v, (*v.shape[:-1], lanes)).copy() for v in first]
        self._stale = np.full(buffers.lanes, not self.fixed)

    @property
    def values(self) -> list[Array]:
        """The value of each root: (*shape, lanes), or (*shape, 1) if all episodes begin in the same state."""
        return [self._held[place] for place in self._places]

    def forget(self, lanes: Any) -> None:
        """Drop the first states of lanes (an index), which were seeded."""
        self._stale[lanes] = not self.fixed

    def take(self, lanes: Array) -> list[Array]:
        """Return values (*shape, k) of the first states of the next episodes of k lanes, or (*shape, 1)."""
        if self.fixed:
            return self.values
        if self._stale[lanes].any():
            self._refresh()
        self._stale[lanes] = True
        taken = [v[..., lanes] for v in self._held]
        return [taken[place] for place in self._places]

    def _refresh(self) -> None:
        """Compute new first states for all lanes that have used theirs."""
        stale = np.flatnonzero(self._stale)
        seeds = self._buffers.seeds[stale]
        episodes = self._buffers.episodes[stale]
        words = draws.lanes_block(seeds, draws.RESET, episodes, self._layout.count)
        for held, new in zip(self._held, evaluated(self._roots, self._layout, words), strict=True):
            held[..., stale] = new
        self._stale[stale] = False


def evaluated(nodes: Sequence[Node], layout: WordLayout, words: Array) -> list[Array]:
    """Return values (*shape, columns) of nodes that depend on draws alone, from words (count, columns)."""
    values = batch.evaluate(nodes, {}, batch_sampler(layout, words))
    columns = words.shape[-1]
    return [np.broadcast_to(v, (*n.type.shape, columns)) for n, v in zip(nodes, values, strict=True)]
