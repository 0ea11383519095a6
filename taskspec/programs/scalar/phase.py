"""Phases of the scalar program, reset and step: what depends on draws alone is computed by NumPy for blocks of items."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, rewrite, walk
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.language.expressions.variates import WordLayout, batch_sampler
from taskspec.language.task.spaces import SpaceLayout
from taskspec.programs.lowering import WIDE, everywhere, maximal_draws, word_names


@dataclass(frozen=True)
class Phase:
    """The roots of a phase, with what depends on draws alone replaced by reads of `hoisted` values.

    An item of the stream (`taskspec.programs.scalar.phase`) is the new observation row (if any), then the words of the draws
    that stay, then the hoisted values.
    """

    roots: tuple[Node, ...]
    observation: tuple[Node, ...]
    hoisted: tuple[Node, ...]
    hoisted_names: tuple[str, ...]
    words: dict[int, tuple[str, ...]]  # of the draws that stay in the lane form, by site
    layout: WordLayout
    row_shape: tuple[int, ...]  # of a fresh float32 observation, () where observations are no arrays
    row_parts: tuple[tuple[int, Node], ...]  # offset and node of what is filled in for a whole block
    row_count: int  # of equal rows in an item: copies made for a whole block cost half of those made one at a time

    @classmethod
    def of(
        cls, b: Builder, roots: Sequence[Node], observation: Sequence[Node], layout: SpaceLayout, words: WordLayout,
        row_count: int = 1,
    ) -> Phase:  # fmt: skip
        """Split a phase of a task; an observation that the block fills in wholly may come in `row_count` equal rows."""
        everything = (*roots, *observation)
        free = everywhere(everything, _block_can_compute)
        rows = layout.form == "box" and bool(layout.shape) and bool(observation)
        if rows:
            parts, inner = _row_parts(observation, free)
        else:
            parts, inner = ((), list(observation))
        hoisted = maximal_draws((*roots, *(n for n in inner if n is not None)), free)
        names = {}
        for i, n in enumerate(hoisted):
            names[id(n)] = f"h{i}"
        variables = {}
        for n in hoisted:
            variables[id(n)] = b.read(Role.VARIABLE, names[id(n)], n.type)
        lane = [*roots, *(n for n in inner if n is not None)]
        rewritten = iter(rewrite(lane, variables, b.remake))
        new_roots = tuple(next(rewritten) for _ in roots)
        observed = []
        for part in inner:
            if part is None:
                observed.append(_FILLED)
            else:
                observed.append(next(rewritten))
        new_observation = tuple(observed)
        staying = []
        for n in walk([*new_roots, *new_observation]):
            if isinstance(n, Draw):
                staying.append(n)
        named = {d.site: word_names(d) for d in staying}
        return cls(
            new_roots, new_observation, tuple(hoisted), tuple(names.values()), named, words,
            layout.shape if rows else (), parts, row_count if rows and all(n is None for n in inner) else int(rows),
        )  # fmt: skip

    @property
    def row_size(self) -> int:
        """Elements of a fresh observation, 0 where observations are no arrays."""
        if self.row_shape:
            return math.prod(self.row_shape)
        return 0

    @property
    def wide(self) -> list[str]:
        """The hoisted values that come as arrays."""
        wide = []
        for name, n in zip(self.hoisted_names, self.hoisted, strict=True):
            if n.type.size > WIDE:
                wide.append(name)
        return wide

    @property
    def row_names(self) -> list[str]:
        """The names of the fresh observation and of its copies."""
        return [f"o{i or ''}" for i in range(self.row_count)]

    @property
    def names(self) -> list[str]:
        """The names that an item of the stream is unpacked into."""
        return [*self.row_names, *(w for ws in self.words.values() for w in ws), *self.hoisted_names]


_FILLED: Node = Const(0, Type(Kind.INT))
"""Stands for an observation component that the block has filled in already."""


def is_filled(node: Node) -> bool:
    return node is _FILLED


def _block_can_compute(node: Node) -> bool:
    """Test whether NumPy computes the same in a block: nothing is read, or differs in the last digit from the C library."""
    if isinstance(node, Read):
        return False
    return not isinstance(node, Apply) or node.op not in OPERATORS or OPERATORS[node.op].precise


def _row_parts(
    observation: Sequence[Node], free: dict[int, bool]
) -> tuple[tuple[tuple[int, Node], ...], list[Node | None]]:
    parts: list[tuple[int, Node]] = []
    inner: list[Node | None] = []
    offset = 0
    for node in observation:
        if free[id(node)]:
            parts.append((offset, node))
        inner.append(None if free[id(node)] else node)
        offset += node.type.size
    return tuple(parts), inner


def stream(items: Callable[[int, int], Sequence[Any]], first: int, width: int) -> Callable[[], Any]:
    """Make a function that hands out the item of counter `first`, then of the next one, and so on.

    Blocks grow from one item, so that a fresh stream is cheap, to some tens of thousands of `width` words.

    Args:
        items: from a first counter and a number of items to these items.
    """
    most = max(16, min(4096, 49_152 // max(1, width)))

    def blocks() -> Iterator[Sequence[Any]]:
        at = first
        count = 1
        while True:
            yield items(at, count)
            at += count
            count = min(count * 8, most)

    return chain.from_iterable(blocks()).__next__


def phase_stream(phase: Phase, seed: int, kind: int, first: int) -> Callable[[], Any] | None:
    """Make the stream of a phase, of kind `draws.RESET` or `draws.STEP`; None if it needs no draws."""
    if not phase.names:
        return None
    width = max(phase.layout.count, phase.row_size)
    return stream(lambda at, count: _items(phase, seed, kind, at, count), first, width)


def _items(phase: Phase, seed: int, kind: int, at: int, count: int) -> Sequence[Any]:
    """Items of counters `at` to `at + count`: tuples of values in the order of `phase.names`, or single values."""
    layout = phase.layout
    words = np.empty((0, count), np.uint32)
    if layout.count:
        words = draws.block(seed, kind, at, count, layout.count).T
    parts = [node for _, node in phase.row_parts]
    values = batch.evaluate((*phase.hoisted, *parts), {}, batch_sampler(layout, words))
    columns: list[Sequence[Any]] = []
    if phase.row_size:
        numbers = np.empty((count, phase.row_size), np.float32)
        with np.errstate(over="ignore"):
            for (offset, node), value in zip(phase.row_parts, values[len(phase.hoisted) :], strict=True):
                numbers[:, offset : offset + node.type.size] = value.reshape(node.type.size, value.shape[-1]).T
        rows = numbers.reshape(count, *phase.row_shape)
        columns += [list(rows), *(list(rows.copy()) for _ in range(1, phase.row_count))]
    for site, names in phase.words.items():
        start = layout.first[site]
        columns += [words[start + k].tolist() for k in range(len(names))]
    for node, value in zip(phase.hoisted, values, strict=False):
        columns.append(_listed(node, value, count))
    if len(columns) == 1:
        return columns[0]
    return list(zip(*columns, strict=True))


def _listed(node: Node, value: Array, count: int) -> list[Any]:
    """List a hoisted value for every item: Python scalars, flat tuples, or flat arrays if they are wide."""
    flat = np.broadcast_to(value.reshape(node.type.size, value.shape[-1]), (node.type.size, count))
    if node.type.is_scalar:
        return flat[0].tolist()
    if node.type.size > WIDE:
        return list(np.ascontiguousarray(flat.T))
    return list(map(tuple, flat.T.tolist()))
