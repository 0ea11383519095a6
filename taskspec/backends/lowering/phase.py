"""A phase of a program (reset or step): which values depend on draws alone, and how they are fetched in blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.backends.lowering.hoist import WIDE
from taskspec.base.records import dataclass
from taskspec.draws.variates import stream
from taskspec.lang import batch
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, rewrite, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.types import Kind, Type
from taskspec.lang.variates.sample import WordLayout, batch_sampler, words_of
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task


@dataclass(frozen=True)
class Phase:
    """The roots of a phase, with what depends on draws alone replaced by reads of `hoisted` values.

    An item of the stream is the fresh observation row (if any), then the words of the draws that stay, then the hoisted values.
    """

    roots: tuple[Node, ...]
    observation: tuple[Node, ...]
    hoisted: tuple[Node, ...]
    hoisted_names: tuple[str, ...]
    words: dict[int, tuple[str, ...]]  # of the draws that stay in the lane form, by site
    layout: WordLayout
    row_shape: tuple[int, ...]  # of a fresh float32 observation, () where observations are no arrays
    row_parts: tuple[tuple[int, Node], ...]  # offset and node of what is filled in for a whole block

    @classmethod
    def of(
        cls,
        task: Task,
        roots: Sequence[Node],
        observation: Sequence[Node],
        layout: SpaceLayout,
        words: WordLayout,
    ) -> Phase:
        """Split a phase of a task."""
        everything = (*roots, *observation)
        free = _free(everything)
        rows = layout.form == "box" and bool(layout.shape) and bool(observation)
        parts, inner = _row_parts(observation, free) if rows else ((), list(observation))
        hoisted = _maximal((*roots, *(n for n in inner if n is not None)), free)
        names = {id(n): f"h{i}" for i, n in enumerate(hoisted)}

        def leaf(node: Node) -> Node | None:
            return task.builder.read(Role.VARIABLE, names[id(node)], node.type) if id(node) in names else None

        lane = [*roots, *(n for n in inner if n is not None)]
        rewritten = iter(rewrite(lane, leaf, task.builder.remake))
        new_roots = tuple(next(rewritten) for _ in roots)
        new_observation = tuple(_FILLED if n is None else next(rewritten) for n in inner)
        staying = [n for n in walk([*new_roots, *new_observation]) if isinstance(n, Draw)]
        named = {d.site: tuple(f"w{d.site}_{k}" for k in range(words_of(d))) for d in staying}
        return cls(
            new_roots,
            new_observation,
            tuple(hoisted),
            tuple(names.values()),
            named,
            words,
            layout.shape if rows else (),
            parts,
        )

    @property
    def row_size(self) -> int:
        """Elements of a fresh observation, 0 where observations are no arrays."""
        return math.prod(self.row_shape) if self.row_shape else 0

    @property
    def wide(self) -> list[str]:
        """The hoisted values that come as arrays."""
        return [name for name, n in zip(self.hoisted_names, self.hoisted, strict=True) if n.type.size > WIDE]

    @property
    def names(self) -> list[str]:
        """The names that an item of the stream is unpacked into."""
        row = ["o"] if self.row_size else []
        return [*row, *(w for ws in self.words.values() for w in ws), *self.hoisted_names]

    def stream(self, seed: int, phase: int, first: int) -> Callable[[], Any] | None:
        """Hands out the items of counters first, first + 1, ...; None where a phase needs none."""
        if not self.names:
            return None
        width = max(self.layout.count, self.row_size)
        return stream(lambda at, count: self._items(seed, phase, at, count), first, width)

    def _items(self, seed: int, phase: int, at: int, count: int) -> Sequence[Any]:
        words = (
            draws.block(seed, phase, at, count, self.layout.count).T
            if self.layout.count
            else np.empty((0, count), np.uint32)
        )
        columns: list[Sequence[Any]] = []
        parts = [node for _, node in self.row_parts]
        values = batch.evaluate((*self.hoisted, *parts), {}, batch_sampler(self.layout, words))
        if self.row_size:
            columns.append(self._rows(values[len(self.hoisted) :], count))
        for site, names in self.words.items():
            first = self.layout.first[site]
            columns += [words[first + k].tolist() for k in range(len(names))]
        for node, value in zip(self.hoisted, values, strict=False):
            columns.append(_listed(node, value, count))
        return columns[0] if len(columns) == 1 else list(zip(*columns, strict=True))

    def _rows(self, filled: Sequence[Any], count: int) -> list[Any]:
        """Fresh float32 rows, with what is known of them filled in."""
        rows = np.empty((count, self.row_size), np.float32)
        with np.errstate(over="ignore"):
            for (offset, node), value in zip(self.row_parts, filled, strict=True):
                rows[:, offset : offset + node.type.size] = value.reshape(node.type.size, value.shape[-1]).T
        return list(rows.reshape(count, *self.row_shape))


_FILLED: Node = Const(0, Type(Kind.INT))
"""Stands for an observation component that the block has filled in already."""


def is_filled(node: Node) -> bool:
    return node is _FILLED


def _free(roots: Sequence[Node]) -> dict[int, bool]:
    """For every node: whether a block can compute it, i.e. it reads nothing and uses exact operators only."""
    free: dict[int, bool] = {}
    for node in walk(roots):
        own = not isinstance(node, Read) and not _may_differ(node)
        free[id(node)] = own and all(free[id(c)] for c in children(node))
    return free


def _may_differ(node: Node) -> bool:
    """Whether the last digit differs between NumPy and the C library: such values stay in the scalar form."""
    return isinstance(node, Apply) and node.op in OPERATORS and not OPERATORS[node.op].precise


def _row_parts(
    observation: Sequence[Node], free: dict[int, bool]
) -> tuple[tuple[tuple[int, Node], ...], list[Node | None]]:
    """Observation components that a block fills in, with their offsets; None in place of each."""
    parts: list[tuple[int, Node]] = []
    inner: list[Node | None] = []
    offset = 0
    for node in observation:
        if free[id(node)]:
            parts.append((offset, node))
        inner.append(None if free[id(node)] else node)
        offset += node.type.size
    return tuple(parts), inner


def _maximal(roots: Sequence[Node], free: dict[int, bool]) -> list[Node]:
    """The largest free nodes that hold a draw: those that the rest refers to."""
    random: dict[int, bool] = {}
    for node in walk(roots):
        random[id(node)] = isinstance(node, Draw) or any(random[id(c)] for c in children(node))
    found: dict[int, Node] = {id(r): r for r in roots if free[id(r)] and random[id(r)]}
    for node in walk(roots):
        if not free[id(node)]:
            found |= {id(c): c for c in children(node) if free[id(c)] and random[id(c)]}
    return list(found.values())


def _listed(node: Node, value: Any, count: int) -> list[Any]:
    """A hoisted value for every item: Python scalars, flat tuples, or flat arrays where they are wide."""
    flat = np.broadcast_to(value.reshape(node.type.size, value.shape[-1]), (node.type.size, count))
    if node.type.is_scalar:
        return flat[0].tolist()  # type: ignore[no-any-return]
    if node.type.size > WIDE:
        return list(np.ascontiguousarray(flat.T))
    return list(map(tuple, flat.T.tolist()))
