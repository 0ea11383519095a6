"""Operators and functions of single numbers, with their values at awkward points.

Arguments are bools, ints, fractions or floats; results are exact unless a float is among the arguments.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from tests.verification.oracle.reference.values import Number, as_float, both

NAN = math.nan
INT32 = 2**31 - 1


def is_nan(x: Number) -> bool:
    return isinstance(x, float) and math.isnan(x)


def add(x: Number, y: Number) -> Number:
    a, b = both(x, y)
    return a + b


def subtract(x: Number, y: Number) -> Number:
    a, b = both(x, y)
    return a - b


def multiply(x: Number, y: Number) -> Number:
    a, b = both(x, y)
    return a * b


def divide(x: Number, y: Number) -> Number:
    """Real division: of two exact numbers a fraction, else as IEEE 754 has it."""
    a, b = both(x, y)
    if b:
        return a / b if isinstance(a, float) else Fraction(a) / b
    if is_nan(a) or not a:
        return NAN
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def floor_divide(x: Number, y: Number) -> Number:
    """Division rounded down; 0 where an int is divided by 0."""
    a, b = both(x, y)
    if isinstance(a, float):
        quotient = divide(a, b)
        return float(a // b) if math.isfinite(quotient) and b else quotient
    return a // b if b else 0


def modulo(x: Number, y: Number) -> Number:
    """Remainder with the sign of the divisor; 0 where an int is divided by 0."""
    a, b = both(x, y)
    if not isinstance(a, float):
        return a % b if b else 0
    if not b or is_nan(b) or not math.isfinite(a):
        return NAN
    return a % b


def power(x: Number, y: Number) -> Number:
    exact = not isinstance(x, float) and isinstance(y, int)
    if exact:
        return exact_power(x, int(y))
    try:
        return math.pow(as_float(x), as_float(y))
    except OverflowError:
        odd = math.isfinite(y) and int(y) % 2 == 1
        return -math.inf if x < 0 and odd else math.inf
    except ValueError:
        return divide(1, 0) if not x else NAN


def exact_power(x: int | Fraction, y: int) -> Number:
    if y >= 0:
        return x**y
    return divide(1, x**-y)


def negate(x: Number) -> Number:
    return -x


def minimum(x: Number, y: Number) -> Number:
    """The smaller; nan is passed over, and of equals the first wins."""
    if is_nan(x):
        return y
    a, b = both(x, y)
    return y if b < a else x


def maximum(x: Number, y: Number) -> Number:
    if is_nan(x):
        return y
    a, b = both(x, y)
    return y if b > a else x


def clip(x: Number, low: Number, high: Number) -> Number:
    return minimum(maximum(x, low), high)


def to_int(x: Number) -> int:
    """The nearest int from -(2**31 - 1) to 2**31 - 1; 0 for nan."""
    if is_nan(x):
        return 0
    return int(max(-INT32, min(INT32, x)))


def rounding(function: Callable[[Number], int]) -> Callable[[Number], int]:
    def rounded(x: Number) -> int:
        if isinstance(x, int):
            return int(x)
        return to_int(function(x) if math.isfinite(x) else x)

    return rounded


floor = rounding(math.floor)
ceil = rounding(math.ceil)
nearest = rounding(round)


def sign(x: Number) -> int:
    return (x > 0) - (x < 0)


def real_function(function: Callable[..., float]) -> Callable[..., float]:
    """One of the C library's functions, with infinities and nan in place of Python's exceptions."""

    def of_floats(*args: Number) -> float:
        try:
            return function(*map(as_float, args))
        except OverflowError:
            return math.inf
        except ValueError:
            return NAN

    return of_floats


def logarithm(x: Number) -> float:
    return -math.inf if x == 0 else real_function(math.log)(x)
