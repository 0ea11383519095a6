"""Values of parameters: as callers give them, and as grids for claims; options of environments."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any, Literal, TypeAlias

import numpy as np

from taskspec.base.records import dataclass
from taskspec.lang.types import INT_WIDEST


@dataclass(frozen=True)
class Varying:
    """Given for a parameter: it is left open, and read where the task runs. The value stands for it in messages."""

    value: Any


def convert(value: Any, kind: str) -> Any:
    """Return a value as the kind of a parameter, or None where it is of another kind, no number, or too large."""
    if isinstance(value, np.generic):
        value = value.item()
    if kind == "bool":
        return value if isinstance(value, bool) else None
    is_nan = isinstance(value, float) and math.isnan(value)
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction) or is_nan:
        return None
    if kind == "int":
        return int(value) if -INT_WIDEST <= value <= INT_WIDEST and value == int(value) else None
    try:
        return float(value) if kind == "real" else None
    except OverflowError:
        return None


def article(kind: str) -> str:
    known = {"int": "an int", "real": "a real number", "bool": "true or false"}
    return known.get(kind, f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}")


def brief(value: Any) -> str:
    """Return a value from Python in a few words; ints may be longer than Python is willing to print."""
    if isinstance(value, int) and abs(value) > INT_WIDEST:
        return f"one of {value.bit_length()} bits"
    return reprlib.repr(value)


# Parameter values that a claim or an example is about: a list of choices, or a grid of values, `{L: [1, 2], K: [3, 4]}`.

Grid: TypeAlias = Mapping[str, Any] | Sequence[Mapping[str, Any]] | None


def cases(grid: Grid) -> Iterator[dict[str, Any]]:
    """Yield every choice of values, the first parameter changing slowest; none without a grid."""
    for entry in _entries(grid):
        yield from (dict(zip(entry, values, strict=True)) for values in product(*map(_values, entry.values())))


def size(grid: Grid) -> int:
    """Return how many choices there are, without listing them."""
    return sum(prod(len(_values(value)) for value in entry.values()) for entry in _entries(grid))


def _entries(grid: Grid) -> Sequence[Mapping[str, Any]]:
    return [grid] if isinstance(grid, Mapping) else grid or ()


def _values(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


# Options of environments that a task's own methods take as well.

Ending: TypeAlias = Literal["terminate", "absorb"]
"""What becomes of terminal states: the episode ends, or they absorb until the horizon."""
RenderMode: TypeAlias = Literal["ansi", "rgb_array", "rgb_array_list", "human"]
"""What `render` gives: text, pixels, the pixels of all states since the last call, or a window."""
