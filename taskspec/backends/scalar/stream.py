"""The draws of a scalar program: computed by NumPy for blocks of coming steps or episodes, handed out one at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.backends.lowering.hoist import WIDE
from taskspec.backends.lowering.phase import Phase
from taskspec.base.arrays import Array
from taskspec.lang import batch
from taskspec.lang.ir import Node
from taskspec.lang.variates import batch_sampler


def stream(items: Callable[[int, int], Sequence[Any]], first: int, width: int) -> Callable[[], Any]:
    """Return a function that hands out the item of counter `first`, then of the next one, and so on.

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
    """Return the stream of a phase, of kind `draws.RESET` or `draws.STEP`; None if it needs no draws."""
    if not phase.names:
        return None
    width = max(phase.layout.count, phase.row_size)
    return stream(lambda at, count: _items(phase, seed, kind, at, count), first, width)


def _items(phase: Phase, seed: int, kind: int, at: int, count: int) -> Sequence[Any]:
    """Return the items of counters `at` to `at + count`: tuples of values in the order of `phase.names`, or single values."""
    layout = phase.layout
    words = np.empty((0, count), np.uint32)
    if layout.count:
        words = draws.block(seed, kind, at, count, layout.count).T
    parts = [node for _, node in phase.row_parts]
    values = batch.evaluate((*phase.hoisted, *parts), {}, batch_sampler(layout, words))
    columns: list[Sequence[Any]] = []
    if phase.row_size:
        columns.append(_rows(phase, values[len(phase.hoisted) :], count))
    for site, names in phase.words.items():
        start = layout.first[site]
        columns += [words[start + k].tolist() for k in range(len(names))]
    for node, value in zip(phase.hoisted, values, strict=False):
        columns.append(_listed(node, value, count))
    return columns[0] if len(columns) == 1 else list(zip(*columns, strict=True))


def _rows(phase: Phase, values: Sequence[Array], count: int) -> list[Array]:
    """Return new float32 observations, with the parts that depend on draws alone filled in."""
    rows = np.empty((count, phase.row_size), np.float32)
    with np.errstate(over="ignore"):
        for (offset, node), value in zip(phase.row_parts, values, strict=True):
            rows[:, offset : offset + node.type.size] = value.reshape(node.type.size, value.shape[-1]).T
    return list(rows.reshape(count, *phase.row_shape))


def _listed(node: Node, value: Array, count: int) -> list[Any]:
    """Return a hoisted value for every item: Python scalars, flat tuples, or flat arrays if they are wide."""
    flat = np.broadcast_to(value.reshape(node.type.size, value.shape[-1]), (node.type.size, count))
    if node.type.is_scalar:
        return flat[0].tolist()  # type: ignore[no-any-return]
    if node.type.size > WIDE:
        return list(np.ascontiguousarray(flat.T))
    return list(map(tuple, flat.T.tolist()))
