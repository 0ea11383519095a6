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


def holds(codes: Array, members: Array) -> Array:
    """Which of some codes (N,) are among sorted ones."""
    if not len(members):
        return np.zeros(len(codes), np.bool_)
    at = np.minimum(np.searchsorted(members, codes), len(members) - 1)
    return np.asarray(members[at] == codes)


def without(codes: Array, others: Array) -> Array:
    """The codes that are not among sorted ones."""
    return codes[~holds(codes, others)]
