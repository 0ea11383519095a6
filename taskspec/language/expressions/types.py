"""Static types of expressions, a kind and a shape; and the bounds of values that are known without running anything."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

INF = math.inf
Interval = tuple[float, float]
"""Ends of an int are ints, or infinite; ends of a real are floats."""
EVERYTHING: Interval = (-INF, INF)
HUGE = 1e300
"""Bounds further out than this count as infinite."""


class Range(NamedTuple):
    """Bounds of every element of a value: its bounds, and whether it is always a finite number."""

    low: float
    high: float
    finite: bool = True

    @property
    def bounded(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)

    def holds_zero(self) -> bool:
        return self.low <= 0 <= self.high


Args = Sequence[Range]


# Static types of the expression language: a kind and a shape, both known before anything runs.


class Kind(enum.IntEnum):
    """Kinds in order of promotion: a bool counts as 0/1 among ints, an int as a real among reals."""

    BOOL = 0
    INT = 1
    REAL = 2

    def __str__(self) -> str:
        return self.name.lower()


Shape = tuple[int, ...]
Scalar = bool | int | float  # and Fraction, which never leaves constants
INT_MAX = 2**31 - 1
"""Largest integer that every backend holds; conversions from reals saturate at it."""
INT_WIDEST = 2**63 - 1
"""Largest integer that any value may have on its way."""


@dataclass(frozen=True, slots=True)
class Type:
    """A kind with a static shape: ``()``, ``(n,)`` or ``(n, m)``."""

    kind: Kind
    shape: Shape = ()

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def is_scalar(self) -> bool:
        return self.shape == ()

    def __str__(self) -> str:
        if self.is_scalar:
            return str(self.kind)
        return f"{self.kind} vector {list(self.shape)}"

    @property
    def with_article(self) -> str:
        if self.kind is Kind.INT:
            return f"an {self}"
        return f"a {self}"


BOOL = Type(Kind.BOOL)
INT = Type(Kind.INT)
REAL = Type(Kind.REAL)


@dataclass(frozen=True, slots=True)
class Domain:
    """The values of a `choice`: labels, and for a mapped choice the value of each label.

    A choice is carried as the index of its label. `values` has one entry a label: a scalar or a
    flat tuple, all of type `value_type`; `symbols` are what mathematics prints for the labels.
    """

    labels: tuple[str, ...]
    values: tuple[object, ...] | None = None
    value_type: Type | None = None
    symbols: tuple[str, ...] | None = None

    def index(self, label: str) -> int | None:
        if label in self.labels:
            return self.labels.index(label)
        return None

    @property
    def listed(self) -> str:
        """The labels in words, the first few of many."""
        return ", ".join(self.labels[:6]) + ", ..." * (len(self.labels) > 6)


def shape(type_: Type, domain: Domain | None) -> Shape:
    """Shape of a value in arithmetic: a mapped choice has the shape of its values."""
    if domain is None or domain.value_type is None:
        return type_.shape
    return domain.value_type.shape


BOOLEAN_LABELS = ("false", "true")


# Expressions as those see them who do not take them apart: their types, and the names of what they read.


class Role(enum.Enum):
    """The kinds of value that an expression reads."""

    STATE = "state"
    ACTION = "action"
    NEXT = "next"
    TIME = "time"
    PARAMETER = "parameter"  # of a task that leaves it open
    VARIABLE = "variable"  # of a comprehension or a function, while it is being expanded


TIME = (Role.TIME, "t")
"""The read of the steps taken."""


class Expression:
    """An expression of a task: its value is computed by `evaluate`, and `task.questions` are asked about it."""

    __slots__ = ()
    type: Type


def join(*kinds: Kind) -> Kind:
    return max(kinds)


class Refused(Exception):
    """An operation that cannot be built: a sentence for the author, a code, maybe a hint. The checker adds the place."""

    def __init__(self, message: str, code: str = "E306", hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.hint = hint


class NoElement(Refused):
    """An element of a vector without elements (E407)."""

    def __init__(self, what: str = "index") -> None:
        super().__init__(f"a vector without elements has no {what}", "E407")


def total_size(items: Iterable[Any]) -> int:
    return sum(item.type.size for item in items)
