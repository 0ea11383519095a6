"""The memory of a vector environment as one array: a compiled function unpacks one argument sooner than twenty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array

GAP = 16
"""Numbers between the rows of an array.

With a gap they are not a power of two apart. Rows that are share the few places that a cache has for such addresses, and a
loop over many of them takes three times as long.
"""
_POINTERS = {"float64": "f64s", "int64": "i64s", "float32": "f32s", "uint32": "u32s", "bool": "flags"}
"""Functions of `runtime` that point into the memory, by type of number."""


@dataclass(frozen=True)
class Field:
    """An array of the memory: its type, and its shape for one lane."""

    dtype: Any
    shape: tuple[int, ...] = ()

    @property
    def item_size(self) -> int:
        return np.dtype(self.dtype).itemsize

    @property
    def size(self) -> int:
        return math.prod(self.shape)


@dataclass(frozen=True)
class Block:
    """The memory of some lanes as one array, uint64.

    `arrays` are views of it, (*shape, lanes), whose rows are `pitch` numbers apart; `scratch` is the place of each
    thread's scratch, in numbers of 32 bits.
    """

    memory: Array
    pitch: int
    arrays: dict[str, Array]
    scratch: list[int]


class Memory:
    """The places of arrays in a memory, row by row; a row has one number for each lane.

    Rows of the longest numbers come first. So row k of an array begins at number `(place + k) * pitch` of the memory, seen
    as an array of its type. Scratch comes last.
    """

    def __init__(self, fields: Mapping[str, Field], scratch: int) -> None:
        """`scratch`: how many numbers of 32 bits, for each thread."""
        self._fields = fields
        self._scratch = scratch
        self._places: dict[str, int] = {}
        self._bytes = 0  # of a lane
        for name, field in sorted(fields.items(), key=lambda item: -item[1].item_size):
            self._places[name] = self._bytes // field.item_size
            self._bytes += field.size * field.item_size

    def rows(self) -> dict[str, str]:
        """Source of a pointer to each row, from lane `first` on, by the names of `row_names`."""
        sources = {}
        for name, field in self._fields.items():
            pointer = _POINTERS[np.dtype(field.dtype).name]
            for k, row in enumerate(row_names(name, field.shape)):
                sources[row] = f"{pointer}(memory, {self._places[name] + k} * pitch + first)"
        return sources

    def block(self, lanes: int, threads: int) -> Block:
        """Allocate memory for some lanes, all zeros."""
        pitch = math.ceil(lanes / 64) * 64 + GAP
        words = 2 * math.ceil(self._bytes * pitch / 8)
        scratch = [words + k * self._scratch for k in range(threads)]
        size = (words + threads * self._scratch + 1) // 2
        numbers = np.zeros(size + 8, np.uint64)
        aligned = -numbers.ctypes.data % 64 // 8
        memory = numbers[aligned : aligned + size]
        arrays = {}
        for name, field in self._fields.items():
            start = self._places[name] * pitch
            stop = start + field.size * pitch
            rows = memory.view(field.dtype)[start:stop].reshape(*field.shape, pitch)
            arrays[name] = rows[..., :lanes]
        return Block(memory, pitch, arrays, scratch)


def row_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Name each element of an array: its name, with the number of the element if the array has a shape."""
    if not shape:
        return [name]
    return [f"{name}_{k}" for k in range(math.prod(shape))]
