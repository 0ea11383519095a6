"""Types of arrays, and observations that are one array or several.

Shapes stand in docstrings, one letter an axis: S states, A actions, T times, K features, N lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
"""An array of NumPy."""
AnyArray = Any
"""An array of NumPy or of JAX."""


# Observations are one array, or a dict of arrays.


def map_parts(function: Callable[..., Any], *values: Any) -> Any:
    """Apply a function to some arrays, or to the arrays of each name where they are dicts."""
    first = values[0]
    if not isinstance(first, Mapping):
        return function(*values)
    mapped = {}
    for name in first:
        parts = [value[name] for value in values]
        mapped[name] = function(*parts)
    return mapped


def parts_of(value: Any) -> list[Any]:
    """Return the arrays of a dict of them, or the only array."""
    if isinstance(value, Mapping):
        return list(value.values())
    return [value]


def as_matrix(value: Any, rows: int) -> Array:
    """Return the numbers of an array, or of all arrays in a dict side by side, as float64 (rows, columns)."""
    columns = [np.asarray(part, np.float64).reshape(rows, -1) for part in parts_of(value)]
    return np.hstack(columns)


def part_at(value: Any, index: Any) -> Any:
    """Return the elements at an index of the first axis, of an array or of each in a dict."""
    return map_parts(itemgetter(index), value)


def end_to_end(values: Sequence[Any]) -> Any:
    """Return arrays, or dicts of arrays, one after the other."""
    return map_parts(lambda *parts: np.concatenate(parts), *values)
