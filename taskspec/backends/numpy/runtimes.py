"""Array forms that are quicker in NumPy than those that every array library has."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.lang.arrays import UNSORTED, Runtime, network

Array = np.ndarray[Any, Any]


@lru_cache(maxsize=16)
def _lanes(n: int) -> Array:
    return np.arange(n)


class NumpyRuntime(Runtime):
    """Elements of vectors that differ from lane to lane are found by their place in memory."""

    def __init__(self) -> None:
        super().__init__(np, np.int64, np.float64)

    def index(self, x: Array, i: Array) -> Array:
        """Rows of x (n, ..., N) at the indices i (..., N) of each lane."""
        lanes = x.shape[-1]
        if x.ndim != 2 or lanes == 1 or not x.flags.c_contiguous:
            return super().index(x, i)  # type: ignore[no-any-return]
        picked: Array = x.reshape(-1).take(i * lanes + _lanes(lanes), mode="clip")
        return picked

    def sort(self, x: Array) -> Array:
        if not 1 < x.shape[0] <= UNSORTED:
            return super().sort(x)  # type: ignore[no-any-return]
        rows = list(self.without_sign(x))
        least = np.minimum if x.dtype.kind in "iub" else np.fmin
        for i, j in network(len(rows)):
            rows[i], rows[j] = least(rows[i], rows[j]), np.maximum(rows[i], rows[j])
        ordered = np.empty_like(x)
        for place, row in zip(ordered, rows, strict=True):
            np.copyto(place, row)
        return ordered

    def without_sign(self, x: Array) -> Array:
        return x if x.dtype.kind in "iub" else x + 0.0

    def count(self, x: Array) -> Array:
        if len(x) > 127:
            return super().count(x)  # type: ignore[no-any-return]
        total: Array = np.add.reduce(self.rows(x).view(np.int8), 0, np.int8)
        return total.astype(np.int64)

    def swap(self, x: Array, i: Array, j: Array) -> Array:
        if x.ndim != 2:
            return super().swap(x, i, j)  # type: ignore[no-any-return]
        lanes = max(x.shape[-1], i.shape[-1], j.shape[-1])
        exchanged = np.empty((len(x), lanes), x.dtype)
        exchanged[...] = x
        flat = exchanged.reshape(-1)
        first, second = i * lanes + _lanes(lanes), j * lanes + _lanes(lanes)
        flat[first], flat[second] = flat.take(second), flat.take(first)
        return exchanged


RUNTIME = NumpyRuntime()
