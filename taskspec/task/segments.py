"""What the numbers of a Gymnasium value are made of: the one description that every backend packs and unpacks by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Part:
    """One array of a value, or a key of a dict: whole numbers, which are int64 in NumPy, or else float32.

    `name` is the key. A `shape` of () is a single number.
    """

    name: str | None
    shape: tuple[int, ...]
    is_whole: bool


@dataclass(frozen=True, slots=True)
class Segment:
    """Numbers that stand side by side in a part, from number `first` on, and are of one component.

    They are the elements of component number `component`, each less its number of `starts`, if there are any; or they say
    whether the element number `element` is each of some `values`.
    """

    part: int
    first: int
    component: int
    size: int
    starts: tuple[int, ...] = ()
    element: int = 0
    values: range | None = None

    def numbers(self, flat: tuple[Any, ...]) -> tuple[Any, ...]:
        """The numbers, from the elements of the component."""
        if self.values is not None:
            return tuple(float(flat[self.element] == value) for value in self.values)
        return tuple(item - start for item, start in zip(flat, self.starts, strict=True)) if self.starts else flat

    def columns(self, rows: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """The numbers (N, size) of many values at once, from the elements (N, elements) of the component."""
        if self.values is not None:
            found: np.ndarray[Any, Any] = rows[:, self.element, None] == np.array(self.values)
            return found
        less: np.ndarray[Any, Any] = rows - np.array(self.starts) if self.starts else rows
        return less
