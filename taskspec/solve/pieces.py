"""Large arrays some at a time, where there may be no memory for anything as large again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from taskspec.base.arrays import Array

PIECE = 500_000
"""How many entries, or numbers of a table, are gone through at once."""


def pieces(matrix: Any, within: slice) -> Iterator[tuple[slice, Any]]:
    """Some rows of a matrix at a time, which share its entries: products with all of them might need as much memory again.

    Slices count from the first row of `within`.
    """
    n, (rows, columns) = max(1, PIECE * matrix.shape[0] // max(1, matrix.nnz)), matrix.shape
    if rows <= n and within == slice(0, rows):
        yield within, matrix
        return
    for low in range(within.start, within.stop, n):
        first = matrix.indptr[low : min(low + n, within.stop) + 1]
        here = slice(int(first[0]), int(first[-1]))
        entries = (matrix.data[here], matrix.indices[here], first - first[0])
        at = low - within.start
        yield slice(at, at + len(first) - 1), type(matrix)(entries, shape=(len(first) - 1, columns))


def every(numbers: Array, holds: Callable[[Array], Array]) -> bool:
    """Whether something holds of every number, looked at in pieces."""
    return all(bool(holds(numbers[low : low + PIECE]).all()) for low in range(0, len(numbers), PIECE))
