"""Numbers known to lie between two rationals, for sure or with some confidence."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

End = Fraction | float
"""A rational, or an infinity, which says that nothing is known on that side."""
EQUAL = Fraction(1, 10**9)
"""The relative difference up to which two numbers count as equal."""
MOST_BITS = 1_000_000
"""The length of numbers that powers may have."""
SMALLEST = 2.0**-1022
"""The smallest float that is rounded by no more than half a unit of its last place."""


CONFIDENCE = 0.95
"""The probability with which an interval of samples contains the mean, unless another is asked for."""


class NoNumber(Exception):
    """An operation that has no value, or one too large to write out: a sentence that says why."""


@dataclass(frozen=True, slots=True)
class Enclosure:
    """A number between `low` and `high`, both included; exact where these are equal."""

    low: End
    high: End

    @classmethod
    def exactly(cls, value: Fraction | float) -> Enclosure:
        """Return a known number. NoNumber: nan."""
        if value != value:
            raise NoNumber("this is not a number")
        if value in (math.inf, -math.inf):
            end = value
        else:
            end = Fraction(value)
        return cls(end, end)

    @classmethod
    def around(cls, value: float, error: float) -> Enclosure:
        """Return everything within a computed error of a float. NoNumber: nan."""
        if value != value or error != error:
            raise NoNumber("this is not a number")
        if not (math.isfinite(value) and math.isfinite(error)):
            return cls(-math.inf, math.inf)
        return cls(Fraction(value) - Fraction(error), Fraction(value) + Fraction(error))

    @property
    def is_exact(self) -> bool:
        return self.low == self.high

    @property
    def value(self) -> float:
        """The float nearest to the middle."""
        if isinstance(self.low, Fraction) and isinstance(self.high, Fraction):
            return rounded((self.low + self.high) / 2)
        if self.is_exact:
            return float(self.low)
        return math.nan

    @property
    def error(self) -> float:
        """The largest distance of `value` from the number, rounded up; 0 where `value` is the number itself."""
        value = self.value
        if value in (self.low, self.high) and self.is_exact:
            return 0.0
        if not math.isfinite(value):
            return math.inf
        most = max(Fraction(value) - self.low, self.high - Fraction(value))
        return math.nextafter(rounded(most), math.inf)

    @property
    def ends(self) -> tuple[float, float]:
        """Floats that the number lies between, rounded outwards."""
        low = rounded(self.low)
        if low > self.low:
            low = math.nextafter(low, -math.inf)
        high = rounded(self.high)
        if high < self.high:
            high = math.nextafter(high, math.inf)
        return low, high

    def hull(self, other: Enclosure) -> Enclosure:
        return Enclosure(min(self.low, other.low), max(self.high, other.high))

    def __str__(self) -> str:
        if self.is_exact:
            return digits(self.low)
        if self.error <= 1e-10 * abs(self.value):
            return digits(self.value)
        return f"between {digits(self.low)} and {digits(self.high)}"


def rounded(value: End) -> float:
    """Return the nearest float; an infinity beyond the largest."""
    try:
        return float(value)
    except OverflowError:
        if value > 0:
            return math.inf
        return -math.inf


def digits(value: End, count: int = 10) -> str:
    """Return a number in a few significant digits, whole numbers in full."""
    if isinstance(value, Fraction) and value.denominator == 1 and abs(value) < 10**17:
        return str(value.numerator)
    return f"{rounded(value):.{count}g}"


# -- arithmetic -------------------------------------------------------------------------------------------------------

_MONOTONE: dict[str, Callable[[Fraction, Fraction], Fraction | int]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "//": operator.floordiv,
}
"""Operators that are monotone in each argument, so that the extremes over an enclosure are at its ends."""


def arithmetic(op: str, a: Enclosure, b: Enclosure) -> Enclosure:
    """Return the result of an operation on two numbers."""
    if op == "**":
        return _power(a, b)
    low, high, other_low, other_high = _finite(a.low, a.high, b.low, b.high)
    if op in ("/", "//", "%") and other_low <= 0 <= other_high:
        raise NoNumber("this divides by zero" if b.is_exact else "this may divide by zero")
    if op == "%":
        whole = arithmetic("//", a, b)
        if whole.is_exact:
            return arithmetic("-", a, arithmetic("*", b, whole))
        return Enclosure(min(Fraction(0), other_low), max(Fraction(0), other_high))
    corners = [Fraction(_MONOTONE[op](x, y)) for x in (low, high) for y in (other_low, other_high)]
    return Enclosure(min(corners), max(corners))


def _finite(*ends: End) -> list[Fraction]:
    found = [e for e in ends if isinstance(e, Fraction)]
    if len(found) < len(ends):
        raise NoNumber("infinity cannot be computed with")
    return found


def _power(a: Enclosure, b: Enclosure) -> Enclosure:
    low, high, exponent, _ = _finite(a.low, a.high, b.low, b.high)
    if not b.is_exact:
        raise NoNumber("an exponent must be known exactly")
    if exponent.denominator != 1:
        return _root(low, high, exponent)
    n = exponent.numerator
    if n < 0:
        return arithmetic("/", Enclosure.exactly(1), _power(a, Enclosure.exactly(-n)))
    size = max((abs(x.numerator) | x.denominator).bit_length() for x in (low, high))
    if size * n > MOST_BITS and size > 1:
        raise NoNumber("this power is too large to write out")
    ends = sorted((low**n, high**n))
    if n and n % 2 == 0 and low <= 0 <= high:
        ends[0] = Fraction(0)
    return Enclosure(*ends)


def _root(low: Fraction, high: Fraction, exponent: Fraction) -> Enclosure:
    if low < 0 or (low == 0 and exponent < 0):
        raise NoNumber("this power is not a number")
    found = []
    for base in (low, high):
        try:
            power = math.pow(rounded(base), float(exponent))
        except (OverflowError, ValueError):  # a base that is rounded to 0
            power = math.inf
        if base and not (SMALLEST <= rounded(base) < math.inf and SMALLEST <= power < math.inf):
            raise NoNumber("this power is too large to write out, or too small")
        found.append(Fraction(power))
    margin = Fraction(1, 2**50) * (1 + abs(exponent))
    return Enclosure(min(found) * (1 - margin), max(found) * (1 + margin))


def negative(a: Enclosure) -> Enclosure:
    return Enclosure(-a.high, -a.low)


def absolute(a: Enclosure) -> Enclosure:
    if a.low >= 0:
        return a
    if a.high <= 0:
        return negative(a)
    return Enclosure(Fraction(0), max(-a.low, a.high))


# -- comparisons ------------------------------------------------------------------------------------------------------


def compare(op: str, a: Enclosure, b: Enclosure, tolerance: Fraction | None = None) -> bool | None:
    """Return whether a comparison holds; None where it is undecided.

    `==` holds of numbers that differ by at most `tolerance`, or by 1e-9 of the larger one's size without one. `<=` allows
    for `tolerance` as well, where it is given, and `<` for nothing.
    """
    match op:
        case "==":
            return _equal(a, b, tolerance)
        case "!=":
            is_equal = _equal(a, b, tolerance)
            if is_equal is None:
                return None
            return not is_equal
        case "<":
            return _decided(a.high < b.low, a.low >= b.high)
        case "<=":
            slack = tolerance or Fraction(0)
            return _decided(a.high <= b.low + slack, a.low > b.high + slack)
        case ">":
            return compare("<", b, a)
        case _:
            return compare("<=", b, a, tolerance)


def _decided(is_true: bool, is_false: bool) -> bool | None:
    if is_true:
        return True
    if is_false:
        return False
    return None


def _equal(a: Enclosure, b: Enclosure, tolerance: Fraction | None) -> bool | None:
    if any(isinstance(end, float) for end in (a.low, a.high, b.low, b.high)):
        if a.is_exact and b.is_exact:
            return a.low == b.low
        return _decided(False, a.high < b.low or b.high < a.low)
    farthest = max(a.high - b.low, b.high - a.low)
    nearest = max(a.low - b.high, b.low - a.high, Fraction(0))
    if tolerance is not None:
        return _decided(farthest <= tolerance, nearest > tolerance)
    a = absolute(a)
    b = absolute(b)
    return _decided(farthest <= EQUAL * max(a.low, b.low), nearest > EQUAL * max(a.high, b.high))


def mean_interval(mean: float, error: float, count: int, low: float, high: float, confidence: float) -> Enclosure:
    """Return a confidence interval for the mean of independent numbers between `low` and `high`.

    It holds for every distribution with bounds. The normal approximation fails for rare outcomes: a return of a million with
    probability 1e-6 leaves no trace in a thousand episodes.

    Source: the narrower of Hoeffding's bound (1963) and the empirical Bernstein bound (Maurer and Pontil 2009, theorem 4),
    each at half the risk.

    Args:
        mean, error: of the sample; `error` is its standard error.
        count: the size of the sample.
        low, high: the bounds of the numbers.
        confidence: the probability with which the interval contains the mean.
    """
    width = high - low
    risk = 1 - confidence
    if not math.isfinite(width):
        return Enclosure(-math.inf, math.inf)
    reach = width * math.sqrt(math.log(4 / risk) / (2 * count))
    if count > 1:
        log = math.log(8 / risk)
        reach = min(reach, error * math.sqrt(2 * log) + 7 * width * log / (3 * (count - 1)))
    interval = Enclosure.around(mean, reach * (1 + 1e-9) + 1e-9 * abs(mean))
    return Enclosure(max(interval.low, Enclosure.exactly(low).low), min(interval.high, Enclosure.exactly(high).high))
