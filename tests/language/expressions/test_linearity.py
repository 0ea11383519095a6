"""Operators that are said to be linear are: along a line of arguments, second differences vanish."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.language.expressions.types import Kind, Role
from tests.shared.for_each import for_each
from tests.shared.values import kind_of, type_of

STEPS = {Kind.BOOL: (False, True, True), Kind.INT: (0, 1, 2), Kind.REAL: (0.0, 0.5, 1.0)}
"""What is added to an argument at three points; a condition is false at the first only."""


def points(value: Any, moves: bool) -> list[tuple[Any, ...]]:
    """An argument at three points of a line, flat."""
    flat = tuple(np.array(value, object).flat)
    steps = STEPS[kind_of(tuple(np.array(value, object).flat))]
    if not moves:
        return [flat] * 3
    return [tuple(s if isinstance(s, bool) else v + s * (k + 1) for k, v in enumerate(flat)) for s in steps]


def bend(b: Builder, make: Any, sample: Sequence[Any], below: Sequence[bool]) -> float:
    """How far the value at the middle point is from the mean of the others."""
    nodes = [b.read(Role.VARIABLE, f"a{i}", type_of(value)) for i, value in enumerate(sample)]
    root: Node = make(b, nodes)
    lines = [points(value, moves) for value, moves in zip(sample, below, strict=True)]
    at = [evaluate([root], {(Role.VARIABLE, f"a{i}"): line[k] for i, line in enumerate(lines)})[0] for k in range(3)]
    first, middle, last = (np.array(values, float) for values in at)
    with np.errstate(invalid="ignore"):
        found = np.abs(first + last - 2 * middle)
    return float(found[np.isfinite(found)].max(initial=0))  # x / 0 has no mean


def fits(name: str, sample: Sequence[Any]) -> bool:
    """Of numbers; what becomes of a condition is a line through two points, unless it chooses."""
    flat = [v for value in sample for v in np.array(value, object).flat]
    return all(map(math.isfinite, flat)) and (name == "where" or not any(isinstance(v, bool) for v in flat))


OF_OPERATORS = [
    (f"{name} {k}", lambda b, nodes, name=name: b.apply(name, *nodes), sample, op.linear)
    for name, op in OPERATORS.items() for k, sample in enumerate(op.samples) if fits(name, sample)
]  # fmt: skip
OF_STRUCTURES = [
    (f"{name} {k}", lambda b, nodes, name=name, static=static: b.structure(name, nodes, static), sample, entry.linear)
    for name, entry in STRUCTURES.items() for k, (sample, static) in enumerate(entry.samples) if fits(name, sample)
]  # fmt: skip


@for_each(("case", "make", "sample", "linear"), [*OF_OPERATORS, *OF_STRUCTURES])
def test_what_is_said_to_be_linear_is(case: str, make: Any, sample: Sequence[Any], linear: Any) -> None:
    for below in product((False, True), repeat=len(sample)):
        if any(below) and linear(below):
            assert bend(Builder(), make, sample, below) < 1e-9 * (
                1 + max(abs(v) for x in sample for v in np.ravel(x))
            ), below


def test_some_operators_are_linear_and_some_are_not() -> None:
    assert {name for name, op in OPERATORS.items() if op.linear((True,) * 2)} >= {"add", "sub", "neg", "sum"}
    assert not any(OPERATORS[name].linear((True, True)) for name in ("mul", "div", "pow", "min2", "exp"))
