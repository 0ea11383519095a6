"""Streams: what is computed for many coming steps at once, handed out one step at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any

Rows = Callable[[int, int], Sequence[Any]]
"""`rows(first, count)`: what is handed out for counters first, first + 1, ...: one item each."""


def stream(rows: Rows, first: int, width: int) -> Callable[[], Any]:
    """A function that hands out the item of `first`, then of the next counter, and so on.

    Blocks grow from one item, so that a fresh stream is cheap, to some tens of thousands of `width` words.
    """
    most = max(16, min(4096, 49_152 // max(1, width)))

    def blocks() -> Iterator[Sequence[Any]]:
        at, count = first, 1
        while True:
            yield rows(at, count)
            at += count
            count = min(count * 8, most)

    return chain.from_iterable(blocks()).__next__
