"""Numbers in claims: exact ones, and intervals that simulation gives."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from taskspec.lang import syntax as s

TOLERANCE = 1e-9
Exact = int | float | Fraction


class Undecidable(Exception):
    """The claim needs something that the task does not have: a sentence that says what."""

    def __init__(self, message: str, place: s.Expr | None = None) -> None:
        super().__init__(message)
        self.place = place


class Unfit(Exception):
    """The expression is not one that a claim can be made of: a sentence that says why."""

    def __init__(self, message: str, place: s.Expr | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.place, self.hint = place, hint


@dataclass(frozen=True, slots=True)
class Number:
    """A number, or the interval in which it lies at the stated confidence (`low < high` only then)."""

    value: Exact
    low: Exact
    high: Exact

    @classmethod
    def exactly(cls, value: Exact) -> Number:
        return cls(value, value, value)

    @property
    def is_exact(self) -> bool:
        return self.low == self.high

    def __str__(self) -> str:
        if self.is_exact:
            return shown(self.value)
        return f"{shown(self.value)} (between {shown(self.low)} and {shown(self.high)})"


def shown(value: Exact) -> str:
    if isinstance(value, Fraction) and value.denominator == 1:
        return str(value.numerator)
    return str(value) if isinstance(value, int) else f"{float(value):.10g}"


def _power(a: Exact, b: Exact) -> Exact:
    if not isinstance(b, int) or isinstance(a, float) or abs(b) >= 10_000:
        return math.pow(a, b) if a >= 0 or float(b).is_integer() else math.nan
    if a == 0 and b < 0:
        return math.inf
    power: Fraction = Fraction(a) ** b
    return power


def _divide(a: Exact, b: Exact) -> Exact:
    if b == 0:
        return math.nan
    if isinstance(a, float) or isinstance(b, float):
        return float(a) / float(b)
    return Fraction(a) / Fraction(b)


_EXACT: dict[str, Callable[[Any, Any], Exact]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _divide,
    "//": operator.floordiv,
    "%": operator.mod,
    "**": _power,
}


def arithmetic(op: str, a: Number, b: Number) -> Number:
    """An operation on numbers or intervals; of intervals, the ends over all corners (exact for + - * /)."""
    function = _EXACT[op]
    if a.is_exact and b.is_exact:
        return Number.exactly(function(a.value, b.value))
    corners = [function(x, y) for x in (a.low, a.high) for y in (b.low, b.high)]
    if op == "/" and b.low <= 0 <= b.high:
        return Number(function(a.value, b.value), -math.inf, math.inf)
    return Number(function(a.value, b.value), min(corners), max(corners))


def absolute(a: Number) -> Number:
    value, one, other = _magnitude(a.value), _magnitude(a.low), _magnitude(a.high)
    low: Exact = 0 if a.low <= 0 <= a.high else min(one, other)
    return Number(value, low, max(one, other))


def _magnitude(value: Exact) -> Exact:
    return -value if value < 0 else value


def negative(a: Number) -> Number:
    return Number(-a.value, -a.high, -a.low)


def _slack(a: Number, b: Number, tolerance: float | None) -> float:
    if tolerance is not None:
        return tolerance
    size = max(1.0, *(abs(float(v)) for v in (a.low, a.high, b.low, b.high) if math.isfinite(v)))
    return TOLERANCE * size


def _margin(a: Number, b: Number) -> float:
    """What two exact numbers may differ by and still count as equal in a strict comparison."""
    if not (a.is_exact and b.is_exact):
        return 0.0
    sizes = [abs(float(v)) for v in (a.value, b.value)]
    return 1e-12 * max(sizes) if all(map(math.isfinite, sizes)) else 0.0


def compare(op: str, a: Number, b: Number, tolerance: float | None = None) -> bool:
    """Whether a comparison holds; of intervals, whether it may hold."""
    slack = _slack(a, b, tolerance)
    match op:
        case "==":
            return bool(a.low <= b.high + slack and b.low <= a.high + slack)
        case "!=":
            return not (a.is_exact and b.is_exact) or not compare("==", a, b, tolerance)
        case "<":
            return bool(a.low < b.high - _margin(a, b))
        case "<=":
            return bool(a.low <= b.high + slack)
        case ">":
            return compare("<", b, a, tolerance)
        case _:
            return compare("<=", b, a, tolerance)
