"""The NumPy program: generated array code that steps many environments, features first and lanes last."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.ir import draws as draws_below
from taskspec.language.expressions.variates import WordLayout, batch_sampler
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import run
from taskspec.programs.array_form import UFUNCS, arrays
from taskspec.programs.lowering import Hoisted, hoist, tabulate
from taskspec.programs.numpy.step import RUNTIME, Again, generate, never
from taskspec.programs.vector_program import (
    Buffers,
    Episodes,
    LanesNotRunningError,
    Mode,
    Options,
    Values,
    action_reader,
)

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
        """Allow that, from now on, lanes have taken different numbers of steps since they were seeded."""
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
            rows = (self._buffers.steps - self._base).astype(np.int64)
            if self._at >= self._depth or int(rows.max()) >= self._depth:
                self._fetch()
                self._at = 0
                rows = np.zeros(len(self._lanes), np.int64)
            places = rows * len(self._lanes) + self._lanes
            return [np.take(i.reshape(*i.shape[:-2], -1), places, axis=-1, mode="clip") for i in self._items]
        if self._at >= self._depth:
            self._fetch()
        self._at += 1
        return next(self._rows)

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
        # The first observation is often the state itself: such values are kept once.
        self._roots = tuple(dict.fromkeys(roots))
        self._buffers = buffers
        self._places = list(map(self._roots.index, roots))
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
        if self._stale[lanes].any():  # new first states for all lanes that have used theirs
            stale = np.flatnonzero(self._stale)
            seeds = self._buffers.seeds[stale]
            words = draws.lanes_block(seeds, draws.RESET, self._buffers.episodes[stale], self._layout.count)
            for held, new in zip(self._held, evaluated(self._roots, self._layout, words), strict=True):
                held[..., stale] = new
            self._stale[stale] = False
        self._stale[lanes] = True
        taken = [v[..., lanes] for v in self._held]
        return [taken[place] for place in self._places]


def evaluated(nodes: Sequence[Node], layout: WordLayout, words: Array) -> list[Array]:
    """Values (*shape, columns) of nodes that depend on draws alone, from words (count, columns)."""
    values = batch.evaluate(nodes, {}, batch_sampler(layout, words))
    columns = words.shape[-1]
    return [np.broadcast_to(v, (*n.type.shape, columns)) for n, v in zip(nodes, values, strict=True)]


BLOCK = 16_384
"""Lanes stepped together, at most: 128 KiB for each array of 8-byte numbers."""


@dataclass(frozen=True)
class Module:
    """The generated step of a task, and what its phases are made of.

    `bind(n, *arrays)` gives the step function of n lanes over their arrays; see `source`. Where `begins` is set it also begins
    the episodes that follow those which have ended. Where `never_terminates` is set, no step terminates, and `truncated` and
    `ended` are to be one array.
    """

    task: Task
    source: str
    bind: Callable[..., Callable[..., int]]
    observation: SpaceLayout
    action: SpaceLayout
    hoisted: Hoisted
    start: tuple[Node, ...]
    begins: bool
    never_terminates: bool


@lru_cache(maxsize=64)
def compile_numpy(task: Task, mode: Mode = "same_step") -> Module:
    """Generate and compile the array form of a task."""
    b = task.new_builder()
    observation = task.observation_layout
    roots = task.step_roots
    hoisted = hoist(b, roots, task.step_words)
    table = tabulate(b, hoisted.roots)
    start = task.reset_roots
    again = None
    if mode == "same_step" and not draws_below(start):  # all episodes begin alike
        values = evaluated(start, WordLayout.dealt(()), np.zeros((0, 1), np.uint32))
        first = Values.empty(observation, 1)
        write(observation, first.segments(), values[len(task.state) :], np.arange(1))
        again = Again(tuple(values[: len(task.state)]), first.parts)
    source, constants = generate(task, table, hoisted, observation, again)
    namespace = {**_NAMESPACE, "HORIZON": np.array(task.horizon or 0), **arrays(constants, batch.array)}
    if again is not None:
        namespace["FIRST"] = (*again.state, *again.seen)
    run(source, f"<taskspec {task.id} {task.content_hash[:12]} numpy {mode}>", namespace)
    bind = namespace["lanes"]
    begins = again is not None
    never_terminates = never(table[len(task.state) + 1])
    return Module(task, source, bind, observation, task.action_layout, hoisted, start, begins, never_terminates)


_NAMESPACE: dict[str, Any] = {
    **{name: getattr(np, name) for name in (*UFUNCS.values(), "copyto", "count_nonzero", "greater_equal", "putmask")},
    "ONE": np.array(1),
    "ZERO": np.array(0),
    "np": np,
    "xp": np,
    "rt": RUNTIME,
    "nan": np.nan,
    "inf": np.inf,
}


class NumpyEngine:
    """Many environments of a task, stepped by NumPy (see `taskspec.programs.vector_program.Engine`)."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        module = compile_numpy(task, options.mode)
        self.observation = module.observation
        self.action = module.action
        self.source = module.source
        self.buffers = Buffers.of(task, module.observation, lanes)
        if module.never_terminates:
            self.buffers.ended = self.buffers.truncated
        self._read = action_reader(task, module.action, lanes)
        self._episodes = Episodes(self.buffers, options.mode)
        size = 1
        if lanes:
            size = max(1, -(-lanes // -(-lanes // BLOCK)))
        places = [slice(i, min(i + size, lanes)) for i in range(0, lanes, size)]
        self._blocks = [_Block(module, self.buffers.part(p), p, options) for p in places]

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        for block in self._blocks:
            block.ahead.settle()
        self._episodes.seed(seeds, lanes)
        for block, mine in self._parts(lanes):
            block.forget(mine)

    def reset(self, lanes: Array | None = None) -> None:
        for block, mine in self._parts(lanes):
            block.reset(np.arange(block.lanes) if mine is None else mine)

    def step(self, actions: Any) -> int:
        parts = self._read(actions)
        if len(self._blocks) == 1:
            (block,) = self._blocks
            if not block.episodes.ready:
                raise LanesNotRunningError
            return block.step(parts)
        if not all(block.episodes.ready for block in self._blocks):
            raise LanesNotRunningError
        return sum(block.step([p[..., block.place] for p in parts]) for block in self._blocks)

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        self._episodes.place(values, lanes)

    def _parts(self, lanes: Array | None) -> list[tuple[_Block, Array | None]]:
        if lanes is None:
            return [(block, None) for block in self._blocks]
        inside = [(b, lanes[(lanes >= b.place.start) & (lanes < b.place.stop)] - b.place.start) for b in self._blocks]
        return [(block, mine) for block, mine in inside if len(mine)]


class _Block:
    """A range of lanes with scratch arrays of its own."""

    def __init__(self, module: Module, buffers: Buffers, place: slice, options: Options) -> None:
        self.lanes = buffers.lanes
        self.place = place
        self._buffers = buffers
        self._module = module
        self.ahead = Ahead(module.hoisted, buffers)
        self._start = Ready(module.start, module.task.reset_words, buffers)
        self._state_size = len(module.task.state)
        self._seen = buffers.seen.segments()
        self._step = module.bind(
            self.lanes, *buffers.state, buffers.time, *self._seen, buffers.reward, buffers.terminated,
            buffers.truncated, buffers.ended, *buffers.measures, *buffers.seen.parts, *buffers.final.parts,
        )  # fmt: skip
        self.episodes = Episodes(buffers, options.mode)

    def forget(self, lanes: Array | None) -> None:
        """Discard draws made ahead for lanes that have a new seed."""
        self.ahead.restart(everywhere=lanes is None)
        self._start.forget(slice(None) if lanes is None else lanes)

    def reset(self, lanes: Array) -> None:
        """Begin an episode in some lanes."""
        self._begin(lanes)
        self.episodes.reset(lanes)

    def _begin(self, lanes: Array) -> None:
        b = self._buffers
        values = self._start.take(lanes)
        for held, new in zip(b.state, values, strict=False):
            held[..., lanes] = new
        write(b.seen.layout, self._seen, values[self._state_size :], lanes)
        b.time[lanes] = 0
        b.episodes[lanes] += _ONE

    def step(self, actions: Sequence[Array]) -> int:
        b = self._buffers
        episodes = self.episodes
        late = None
        if episodes.over:
            late = b.ended.nonzero()[0]
        if late is not None:
            self.ahead.part_ways()
            b.time[late] = 0  # what the step makes of these lanes is dropped; but it may look things up by the time
        ended = episodes.step(self._step(*actions, *self.ahead.take()))
        if ended and episodes.mode == "same_step" and not self._module.begins:
            for final, seen in zip(b.final.parts, b.seen.parts, strict=True):
                np.copyto(final, seen)
            self._begin(b.ended.nonzero()[0])
        if late is None:
            return ended
        # Lanes whose episodes ended in the step before begin the next one now, and take no step.
        self.ahead.settle()
        b.steps[late] -= _ONE
        b.reward[late] = 0.0
        self.reset(late)
        return episodes.over


_ONE = np.array(1, np.uint32)


def write(layout: SpaceLayout, seen: Sequence[Array], flats: Sequence[Array], lanes: Array) -> None:
    """Write components of observations, (*shape, k) each, into the arrays of the segments, for some lanes.

    In float32 large numbers are infinite.
    """
    with np.errstate(over="ignore"):
        for segment, held in zip(layout.segments, seen, strict=True):
            flat = flats[segment.component]
            if segment.values is not None:
                held[:, lanes] = flat.reshape(-1, flat.shape[-1])[segment.element] == np.array(segment.values)[:, None]
            elif segment.starts:
                held[..., lanes] = flat - np.array(segment.starts).reshape(*flat.shape[:-1], 1)
            else:
                held[..., lanes] = flat
