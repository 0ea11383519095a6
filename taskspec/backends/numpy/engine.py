"""The NumPy program: generated array code that steps many environments, features first and lanes last.

`compile_numpy` gives the generated module of a task, `NumpyEngine` runs it over blocks of lanes that fit a cache.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.backends.actions import reader
from taskspec.backends.ahead import Ahead, Ready, evaluated
from taskspec.backends.buffers import Buffers, Values
from taskspec.backends.emit.array import UFUNCS, arrays
from taskspec.backends.emit.source import run
from taskspec.backends.lowering.hoist import Hoisted, hoist
from taskspec.backends.lowering.tabulate import tabulate
from taskspec.backends.numpy.step import RUNTIME, Again, generate, never
from taskspec.backends.vector import Episodes, LanesNotRunningError, Mode, Options
from taskspec.base.arrays import Array
from taskspec.lang import batch
from taskspec.lang.ir import Node
from taskspec.lang.ir import draws as draws_below
from taskspec.lang.variates import WordLayout
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task

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
    b = task.builder
    observation = task.observation_layout
    roots = task.step_roots
    hoisted = hoist(b, roots, task.step_words)
    table = tabulate(b, hoisted.roots)
    start = task.reset_roots
    again = _again(start, len(task.state), observation) if mode == "same_step" else None
    source, constants = generate(task, table, hoisted, observation, again)
    namespace = {**_NAMESPACE, "HORIZON": np.array(task.horizon or 0), **arrays(constants, batch.array)}
    if again is not None:
        namespace["FIRST"] = (*again.state, *again.seen)
    run(source, f"<taskspec {task.id} {task.content_hash[:12]} numpy {mode}>", namespace)
    bind = namespace["lanes"]
    begins = again is not None
    never_terminates = never(table[len(task.state) + 1])
    return Module(task, source, bind, observation, task.action_layout, hoisted, start, begins, never_terminates)


def _again(start: tuple[Node, ...], states: int, observation: SpaceLayout) -> Again | None:
    """Return how episodes begin, if all do alike."""
    if draws_below(start):
        return None
    values = evaluated(start, WordLayout.dealt(()), np.zeros((0, 1), np.uint32))
    seen = Values.empty(observation, 1)
    write(observation, seen.segments(), values[states:], np.arange(1))
    return Again(tuple(values[:states]), seen.parts)


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
    """Many environments of a task, stepped by NumPy (see `taskspec.backends.vector.Engine`)."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        module = compile_numpy(task, options.mode)
        self.observation = module.observation
        self.action = module.action
        self.source = module.source
        self.buffers = Buffers.of(task, module.observation, lanes)
        if module.never_terminates:
            self.buffers.ended = self.buffers.truncated
        self._read = reader(task, module.action, lanes)
        self._episodes = Episodes(self.buffers, options.mode)
        size = max(1, -(-lanes // -(-lanes // BLOCK))) if lanes else 1
        places = [slice(i, min(i + size, lanes)) for i in range(0, lanes, size)]
        self._blocks = [_Block(module, self.buffers.part(p), p, options) for p in places]

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        for block in self._blocks:
            block.settle()
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
        """Return the blocks concerned, each with indices of its own (None: all of them)."""
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
        self._ahead = Ahead(module.hoisted, buffers)
        self._start = Ready(module.start, module.task.reset_words, buffers)
        self._state_size = len(module.task.state)
        self._seen = buffers.seen.segments()
        self._step = module.bind(
            self.lanes,
            *buffers.state,
            buffers.time,
            *self._seen,
            buffers.reward,
            buffers.terminated,
            buffers.truncated,
            buffers.ended,
            *buffers.seen.parts,
            *buffers.final.parts,
        )
        self.episodes = Episodes(buffers, options.mode)

    def settle(self) -> None:
        """Bring the counts of steps up to date."""
        self._ahead.settle()

    def forget(self, lanes: Array | None) -> None:
        """Some lanes were seeded anew."""
        self._ahead.restart(everywhere=lanes is None)
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
        late = b.ended.nonzero()[0] if episodes.over else None
        if late is not None:
            self._ahead.part_ways()
            b.time[late] = 0  # what the step makes of these lanes is dropped; but it may look things up by the time
        ended = episodes.step(self._step(*actions, *self._ahead.take()))
        if ended and episodes.mode == "same_step" and not self._module.begins:
            self._finish()
        return ended if late is None else self._skip(late)

    def _finish(self) -> None:
        """Keep the last observations of the episodes that have ended, and begin the next ones."""
        b = self._buffers
        for final, seen in zip(b.final.parts, b.seen.parts, strict=True):
            np.copyto(final, seen)
        self._begin(b.ended.nonzero()[0])

    def _skip(self, late: Array) -> int:
        """Lanes whose episodes ended in the step before begin the next one now, and take no step."""
        b = self._buffers
        self._ahead.settle()
        b.steps[late] -= _ONE
        b.reward[late] = 0.0
        self.reset(late)
        return self.episodes.over


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
