"""Operators that are said to be linear are: along a line of arguments, second differences vanish."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.language.expressions.types import Kind
from tests.shared.for_each import for_each
from tests.shared.values import Argument, Flat, arguments, flats, reads

STEPS = {Kind.BOOL: (False, True, True), Kind.INT: (0, 1, 2), Kind.REAL: (0.0, 0.5, 1.0)}
"""What is added to an argument at three points; a condition is false at the first only."""


def moved(a: Argument, k: int) -> Flat:
    """An argument at the point k of a line, whose elements move at different speeds."""
    step = STEPS[a.type.kind][k]
    if a.type.kind is Kind.BOOL:
        return (step,) * a.type.size
    speeds = range(1, a.type.size + 1)
    return tuple(value + step * speed for value, speed in zip(a.flat, speeds, strict=True))


def bend(make: Any, row: Sequence[Argument], moves: Sequence[bool]) -> float:
    """How far the value at the middle point is from the mean of the others."""
    b = Builder()
    root = make(b, reads(b, row))
    values = []
    for k in range(3):
        at = list(row)
        for i in np.flatnonzero(moves):
            at[i] = replace(row[i], flat=moved(row[i], k))
        (value,) = evaluate([root], flats(at))
        values.append(np.array(value, float))
    with np.errstate(invalid="ignore"):
        differences = np.abs(values[0] + values[2] - 2 * values[1])
    return float(differences[np.isfinite(differences)].max(initial=0))  # x / 0 has no mean


def fits(name: str, row: Sequence[Argument]) -> bool:
    """Of numbers; the value of a condition is a line through two points, unless it chooses."""
    kinds = {a.type.kind for a in row}
    return largest(row) < math.inf and (name == "where" or Kind.BOOL not in kinds)


def largest(row: Sequence[Argument]) -> float:
    numbers = np.concatenate([a.flat for a in row])
    return float(np.abs(numbers.astype(float)).max(initial=0))


def apply(name: str, b: Builder, nodes: Sequence[Node]) -> Node:
    return b.apply(name, *nodes)


def structure(name: str, static: tuple[int, ...], b: Builder, nodes: Sequence[Node]) -> Node:
    return b.structure(name, nodes, static)


def cases() -> Iterator[tuple[str, Any, list[Argument], Any]]:
    for name, op in OPERATORS.items():
        for sample in op.samples:
            yield name, partial(apply, name), arguments(sample), op.linear
    for name, entry in STRUCTURES.items():
        for sample, static in entry.samples:
            yield name, partial(structure, name, static), arguments(sample), entry.linear


@for_each(("name", "make", "row", "linear"), cases())
def test_what_is_said_to_be_linear_is(name: str, make: Any, row: list[Argument], linear: Any) -> None:
    if not fits(name, row):
        return
    for moves in product((False, True), repeat=len(row)):
        if any(moves) and linear(moves):
            assert bend(make, row, moves) < 1e-9 * (1 + largest(row)), moves


def test_some_operators_are_linear_and_some_are_not() -> None:
    linear = {name for name, op in OPERATORS.items() if op.linear((True, True))}
    assert linear >= {"add", "sub", "neg", "sum"} and not linear & {"mul", "div", "pow", "min2", "exp"}
