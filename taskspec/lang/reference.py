"""What each operator means, in plain Python on scalars and tuples: slow, obvious, and what every backend is tested against."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from taskspec.lang.types import INT_MAX

Number = Any  # bool, int, float or Fraction
Vector = Sequence[Number]


def add(a: Number, b: Number) -> Number:
    return a + b


def sub(a: Number, b: Number) -> Number:
    return a - b


def mul(a: Number, b: Number) -> Number:
    return a * b


def neg(a: Number) -> Number:
    return -a


def _is_int(*values: Number) -> bool:
    return all(isinstance(v, int) for v in values)


def div(a: Number, b: Number) -> Number:
    if b != 0:
        return a / b
    if a == 0 or a != a:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def floordiv(a: Number, b: Number) -> Number:
    if b == 0:
        return 0 if _is_int(a, b) else div(a, b)
    if not _is_int(a, b) and not (math.isfinite(a) and math.isfinite(b)):
        return math.nan
    return a // b


def mod(a: Number, b: Number) -> Number:
    if b == 0:
        return 0 if _is_int(a, b) else math.nan
    if not _is_int(a, b) and not math.isfinite(a):
        return math.nan
    return a % b


def pow_(a: Number, b: Number) -> float:
    try:
        return math.pow(a, b)
    except (OverflowError, ValueError):
        if a != 0 and not (float(b).is_integer() or a > 0):
            return math.nan
        odd = float(b).is_integer() and b % 2 == 1
        return math.copysign(math.inf, a) if odd else math.inf


def abs_(a: Number) -> Number:
    return abs(a)


def sign(a: Number) -> Number:
    kind = type(a) if not isinstance(a, bool) else int
    return kind((a > 0) - (a < 0))


def min2(a: Number, b: Number) -> Number:
    return a if a <= b or b != b else b


def max2(a: Number, b: Number) -> Number:
    return a if a >= b or b != b else b


def _total(function: Callable[[float], float], a: Number) -> float:
    try:
        return function(a)
    except ValueError:
        return math.nan


def sqrt(a: Number) -> float:
    return _total(math.sqrt, a)


def exp(a: Number) -> float:
    try:
        return math.exp(a)
    except OverflowError:
        return math.inf


def log(a: Number) -> float:
    return -math.inf if a == 0 else _total(math.log, a)


def sin(a: Number) -> float:
    return _total(math.sin, a)


def cos(a: Number) -> float:
    return _total(math.cos, a)


def tan(a: Number) -> float:
    return _total(math.tan, a)


def tanh(a: Number) -> float:
    return math.tanh(a)


def atan2(y: Number, x: Number) -> float:
    return math.atan2(y, x)


def _saturate(function: Callable[[Number], int], a: Number) -> int:
    if a != a:
        return 0
    if not -INT_MAX <= a <= INT_MAX:
        return INT_MAX if a > 0 else -INT_MAX
    return function(a)


def floor(a: Number) -> int:
    return _saturate(math.floor, a)


def ceil(a: Number) -> int:
    return _saturate(math.ceil, a)


def round_(a: Number) -> int:
    return _saturate(round, a)


def to_int(a: Number) -> int:
    return int(a)


def to_real(a: Number) -> float:
    return float(a)


def eq(a: Number, b: Number) -> bool:
    return bool(a == b)


def ne(a: Number, b: Number) -> bool:
    return bool(a != b)


def lt(a: Number, b: Number) -> bool:
    return bool(a < b)


def le(a: Number, b: Number) -> bool:
    return bool(a <= b)


def not_(a: Number) -> bool:
    return not a


def and_(a: Number, b: Number) -> bool:
    return bool(a and b)


def or_(a: Number, b: Number) -> bool:
    return bool(a or b)


def where(condition: Number, a: Number, b: Number) -> Number:
    return a if condition else b


def sum_(x: Vector) -> Number:
    return reduce(add, x) if x else 0


def prod(x: Vector) -> Number:
    return math.prod(x)


def any_(x: Vector) -> bool:
    return any(x)


def all_(x: Vector) -> bool:
    return all(x)


def _fold(better: Callable[[Number, Number], bool], x: Vector) -> int:
    """Index of the best element, the first of equals; nan never beats anything and loses to everything."""
    best = 0
    for i, value in enumerate(x):
        if better(value, x[best]) or (x[best] != x[best] and value == value):
            best = i
    return best


def argmin(x: Vector) -> int:
    return _fold(lambda a, b: a < b, x)


def argmax(x: Vector) -> int:
    return _fold(lambda a, b: a > b, x)


def min_(x: Vector) -> Number:
    return x[argmin(x)]


def max_(x: Vector) -> Number:
    return x[argmax(x)]


def _order(x: Vector) -> list[int]:
    return sorted(range(len(x)), key=lambda i: (x[i] != x[i], 0 if x[i] != x[i] else x[i]))


def sort(x: Vector) -> tuple[Number, ...]:
    return tuple(x[i] or abs(x[i]) for i in _order(x))  # no -0.0


def argsort(x: Vector) -> tuple[int, ...]:
    return tuple(_order(x))


def cumsum(x: Vector) -> tuple[Number, ...]:
    return tuple(sum_(x[: i + 1]) for i in range(len(x)))
