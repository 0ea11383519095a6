"""Backends, and values as arguments of nodes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.programs import backend_table

BACKENDS = tuple(backend_table.BACKENDS)
SLOWLY = ("numpy", pytest.param("numba", marks=pytest.mark.slow), pytest.param("jax", marks=pytest.mark.slow))
PYTHON: dict[Kind, type] = {Kind.BOOL: bool, Kind.INT: int, Kind.REAL: float}

Key = tuple[Role, str]
Flat = tuple[Any, ...]


def kind_of(value: Any) -> Kind:
    if isinstance(value, tuple):
        return max(map(kind_of, value))
    if isinstance(value, bool):
        return Kind.BOOL
    if isinstance(value, int):
        return Kind.INT
    return Kind.REAL


def type_of(value: Any) -> Type:
    return Type(kind_of(value), np.array(value, object).shape)


def constant(b: Builder, value: Any) -> Node:
    return Argument.of("", value).constant(b)


@dataclass(frozen=True)
class Argument:
    """A value, flat and row-major, with its type, and the name under which nodes read it."""

    name: str
    flat: Flat
    type: Type

    @classmethod
    def of(cls, name: str, value: Any) -> Argument:
        type_ = type_of(value)
        return cls(name, tuple(map(PYTHON[type_.kind], np.array(value, object).flat)), type_)

    @property
    def key(self) -> Key:
        return Role.VARIABLE, self.name

    @property
    def bounds(self) -> tuple[float, float]:
        numbers = [number for number in self.flat if not math.isnan(number)]
        return min(numbers, default=-math.inf), max(numbers, default=math.inf)

    def constant(self, b: Builder) -> Node:
        if self.type.is_scalar:
            return b.const(self.flat[0], self.type)
        return b.const(self.flat, self.type)


def arguments(sample: Iterable[Any]) -> list[Argument]:
    """The values of a sample, under the names a0, a1, ..."""
    return [Argument.of(f"a{i}", value) for i, value in enumerate(sample)]


def by_types(samples: Iterable[Iterable[Any]]) -> list[list[list[Argument]]]:
    """Samples as rows of arguments, those of the same types together."""
    groups: dict[Any, list[list[Argument]]] = {}
    for row in map(arguments, samples):
        types = tuple(a.type for a in row)
        groups.setdefault(types, []).append(row)
    return list(groups.values())


def reads(b: Builder, row: Iterable[Argument]) -> list[Node]:
    return [b.read(*a.key, a.type) for a in row]


def bounded_reads(b: Builder, row: Iterable[Argument]) -> list[Node]:
    """Reads that are known to be where the arguments are."""
    return [b.read(*a.key, a.type, *a.bounds) for a in row]


def constants(b: Builder, row: Iterable[Argument]) -> list[Node]:
    return [a.constant(b) for a in row]


def with_constants(b: Builder, nodes: Sequence[Node], row: Sequence[Argument], places: Iterable[int]) -> list[Node]:
    """Nodes with constants of the arguments at some places."""
    changed = list(nodes)
    for place in places:
        changed[place] = row[place].constant(b)
    return changed


def flats(row: Iterable[Argument]) -> dict[Key, Flat]:
    """Arguments as the reference interpreter takes them."""
    return {a.key: a.flat for a in row}


def columns(rows: Sequence[Sequence[Argument]]) -> dict[Key, np.ndarray]:
    """Arguments as arrays, whose last axis has one lane for each row."""
    arrays = {}
    for column in zip(*rows, strict=True):
        first = column[0]
        lanes = np.array([a.flat for a in column], DTYPES[first.type.kind])
        arrays[first.key] = lanes.T.reshape(*first.type.shape, len(rows))
    return arrays
