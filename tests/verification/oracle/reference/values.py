"""Values of the language: a kind, a shape, and flat elements.

Elements of kind ``bool`` and ``int`` are Python's; those of kind ``real`` are `Fraction` as long as they are known
before the task runs and have met no float, and floats from then on. Those of kind ``choice`` are numbers of labels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

Number = int | Fraction | float
Shape = tuple[int, ...]


class Wrong(Exception):
    """The spec means nothing here: a wrong shape, an unknown name."""


@dataclass
class Doubts:
    """How often something hung on the last digits of numbers that are promised to their last digits only."""

    count: int = 0


DOUBTS = Doubts()


@dataclass(frozen=True)
class Choice:
    """The labels of a choice, and what they stand for in arithmetic, if for anything."""

    labels: tuple[str, ...]
    meaning: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Value:
    kind: str
    shape: Shape
    data: tuple[Any, ...]
    fixed: bool = True
    """Known before the task runs: made of numbers, parameters and constants."""
    rough: bool = False
    """Right to its last digits only."""
    choice: Choice | None = None

    @property
    def item(self) -> Any:
        if self.shape != ():
            raise Wrong(f"one value is needed, not {self.shape}")
        return self.data[0]

    def rows(self) -> list[Value]:
        """The elements of a vector, the rows of a matrix."""
        if not self.shape:
            raise Wrong("a vector is needed")
        width = math.prod(self.shape[1:])
        pieces = (self.data[i * width : (i + 1) * width] for i in range(self.shape[0]))
        return [Value(self.kind, self.shape[1:], piece, self.fixed, self.rough, self.choice) for piece in pieces]


RANK = {"bool": 0, "int": 1, "real": 2}


def number(value: Value) -> Value:
    """A value in arithmetic: a choice is what its labels stand for, or their numbers, from 0."""
    if value.kind != "choice":
        return value
    assert value.choice is not None
    if not value.choice.meaning:
        return settled("int", value.shape, value.data, fixed=value.fixed)
    picked = [value.choice.meaning[i] for i in value.data]
    return settled(
        joint_kind(value.choice.meaning),
        value.shape + picked[0].shape,
        [x for v in picked for x in v.data],
        fixed=value.fixed,
    )


def joint_kind(values: Iterable[Value]) -> str:
    return max((v.kind for v in values), key=RANK.__getitem__)


def settled(kind: str, shape: Shape, data: Iterable[Any], *, fixed: bool, rough: bool = False) -> Value:
    """A value whose elements have the form of their kind; fractions end where the task begins to run."""
    elements = tuple(data)
    if kind == "real" and not fixed:
        elements = tuple(as_float(x) for x in elements)
    elif kind == "int":
        elements = tuple(int(x) for x in elements)
    elif kind == "bool":
        elements = tuple(bool(x) for x in elements)
    return Value(kind, shape, elements, fixed, rough and kind == "real")


def scalar(x: bool | Number, *, fixed: bool = True) -> Value:
    kind = "bool" if isinstance(x, bool) else "int" if isinstance(x, int) else "real"
    return Value(kind, (), (x,), fixed)


def as_float(x: Number) -> float:
    try:
        return float(x)
    except OverflowError:
        return math.inf if x > 0 else -math.inf


def common_shape(values: Sequence[Value]) -> Shape:
    """The shape of an elementwise operation: single values go with any shape, others must be equal."""
    shapes = {v.shape for v in values if v.shape}
    if len(shapes) > 1:
        raise Wrong(f"shapes {shapes} do not fit")
    return shapes.pop() if shapes else ()


def spread(value: Value, shape: Shape) -> tuple[Any, ...]:
    """The elements of a value stretched to a shape."""
    return value.data if value.shape == shape else value.data * math.prod(shape)


def elementwise(function: Callable[..., Any], kind: str, *args: Value, rough: bool = False) -> Value:
    """A function of single numbers, applied to each place."""
    values = [number(v) for v in args]
    shape = common_shape(values)
    columns = [spread(v, shape) for v in values]
    fixed = all(v.fixed for v in values)
    if not fixed:
        columns = [tuple(as_float(x) if isinstance(x, Fraction) else x for x in c) for c in columns]
    data = [function(*row) for row in zip(*columns, strict=True)]
    return settled(kind, shape, data, fixed=fixed, rough=rough or any(v.rough for v in values))


def vector(parts: Sequence[Value]) -> Value:
    """Values side by side, as the rows of one."""
    rows = [number(v) for v in parts]
    if not rows:
        return Value("bool", (0,), ())
    if len({v.shape for v in rows}) > 1:
        raise Wrong("rows of different shapes")
    return settled(
        joint_kind(rows),
        (len(rows), *rows[0].shape),
        [x for v in rows for x in v.data],
        fixed=all(v.fixed for v in rows),
        rough=any(v.rough for v in rows),
    )


def same(left: Value, right: Value) -> bool:
    """Whether two values are equal as a whole: those of one choice by their labels, others by what they stand for."""
    if left.kind == right.kind == "choice" and left.choice == right.choice:
        return left.data == right.data
    a = number(left)
    b = number(right)
    return common_shape([a, b]) == a.shape == b.shape and all(
        equal(x, y, rough=a.rough or b.rough) for x, y in zip(a.data, b.data, strict=True)
    )


def both(x: Number, y: Number) -> tuple[Number, Number]:
    """Two numbers in one form: floats as soon as one of them is a float."""
    if isinstance(x, float) or isinstance(y, float):
        return as_float(x), as_float(y)
    return x, y


def equal(x: Number, y: Number, *, rough: bool = False) -> bool:
    watch(x, y, rough=rough)
    a, b = both(x, y)
    return a == b


def watch(x: Number, y: Number, *, rough: bool) -> None:
    """Note a comparison of rough numbers that is too close to call."""
    if rough and math.isfinite(x) and math.isfinite(y):
        DOUBTS.count += abs(float(x) - float(y)) <= CLOSE * max(1.0, abs(float(x)), abs(float(y)))


CLOSE = 1e-9
