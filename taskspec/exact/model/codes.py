"""Sets of codes as sorted arrays of ints, each code once: by sorting, which is far faster than NumPy's hash tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def distinct(codes: Array) -> Array:
    """The codes of an array (N,), sorted, each once."""
    found = np.sort(codes)
    return found[np.append(True, found[1:] != found[:-1])] if len(found) else found


def union(parts: Sequence[Array]) -> Array:
    """The codes of several arrays, sorted, each once; of none, an empty array."""
    return distinct(np.concatenate(parts)) if parts else np.zeros(0, np.int64)


class Growing:
    """A set of codes that grows: a few sorted arrays, each more than twice as long as the next one."""

    def __init__(self) -> None:
        self._parts: list[Array] = []
        self.size = 0

    def add(self, codes: Array) -> Array:
        """Add sorted codes; gives those that are new."""
        new = self.without(codes)
        self.size += len(new)
        if len(new):
            self._parts.append(new)
        while len(self._parts) > 1 and len(self._parts[-2]) <= 2 * len(self._parts[-1]):
            self._parts[-2:] = [union(self._parts[-2:])]
        return new

    def without(self, codes: Array) -> Array:
        """Those of some codes that are not in the set."""
        for part in self._parts:
            codes = without(codes, part)
        return codes

    def all(self) -> Array:
        """The codes of the set, sorted."""
        return union(self._parts)


def holds(codes: Array, members: Array) -> Array:
    """Which of some codes (N,) are among sorted ones."""
    if not len(members):
        return np.zeros(len(codes), np.bool_)
    at = np.minimum(np.searchsorted(members, codes), len(members) - 1)
    return np.asarray(members[at] == codes)


def without(codes: Array, others: Array) -> Array:
    """The codes that are not among sorted ones."""
    return codes[~holds(codes, others)]
