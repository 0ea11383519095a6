"""Parameter values that a claim or an example is about: a list of choices, or a grid of values, `{L: [1, 2], K: [3, 4]}`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import prod
from typing import Any, TypeAlias

Grid: TypeAlias = Mapping[str, Any] | Sequence[Mapping[str, Any]] | None


def cases(grid: Grid) -> Iterator[dict[str, Any]]:
    """Every choice of values, the first parameter changing slowest; none without a grid."""
    for entry in _entries(grid):
        yield from (dict(zip(entry, values, strict=True)) for values in product(*map(_values, entry.values())))


def size(grid: Grid) -> int:
    """How many choices there are, without listing them."""
    return sum(prod(len(_values(value)) for value in entry.values()) for entry in _entries(grid))


def _entries(grid: Grid) -> Sequence[Mapping[str, Any]]:
    return [grid] if isinstance(grid, Mapping) else grid or ()


def _values(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]
