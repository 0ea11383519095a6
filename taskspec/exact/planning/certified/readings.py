"""How floats are read as rationals: at their exact value, or as the short number that was probably written.

`0.1` in a spec is a float a little above one tenth. What the program pays is the float, what the author means is the
tenth; a claim is decided only where both readings agree.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

PLAIN = 2**20
"""Floats with a denominator up to this are read as they are."""
SHORT = 10_000
"""The largest denominator of a fraction that is recognised."""
DIGITS = 15
_ULPS = Fraction(4, 2**53)


class Inexact(Exception):
    """A number that is known as a float only, or too many of them for rational arithmetic."""


class Reader:
    """Floats as rationals by one of the two readings; `ambiguous` once they differed."""

    def __init__(self, as_written: bool = False) -> None:
        self.as_written, self.ambiguous = as_written, False

    def __call__(self, value: float | Fraction) -> Fraction:
        """A number that an author wrote, or that the program pays. Inexact: an infinity, or nan."""
        if not isinstance(value, float):
            return Fraction(value)
        if not math.isfinite(value):
            raise Inexact
        exact, short = Fraction(value), written(value)
        if exact == short:
            return exact
        self.ambiguous = True
        return short if self.as_written else exact

    def computed(self, value: float) -> Fraction:
        """A probability that was computed in floats. Inexact: one that no short fraction explains."""
        found = self(value)
        if written(value).denominator > PLAIN:
            raise Inexact
        return found


@lru_cache(maxsize=100_000)
def written(value: float) -> Fraction:
    """The short fraction or decimal that a finite float stands for; its exact value where there is none."""
    exact = Fraction(value)
    if exact.denominator <= PLAIN and abs(exact) < 2**53:
        return exact
    size = abs(exact)
    if size < 2**53:
        simple = simplest(size * (1 - _ULPS), size * (1 + _ULPS))
        if simple.denominator <= SHORT:
            return simple if exact > 0 else -simple
    mantissa = repr(value).lower().partition("e")[0]
    if len(mantissa.strip("-0").replace(".", "").strip("0")) <= DIGITS:
        return Fraction(repr(value))
    return exact


def simplest(low: Fraction, high: Fraction) -> Fraction:
    """The fraction of the smallest denominator between two positive numbers, by their continued fractions."""
    whole = math.floor(low)
    if whole == low:
        return Fraction(whole)
    if whole + 1 <= high:
        return Fraction(whole + 1)
    return whole + 1 / simplest(1 / (high - whole), 1 / (low - whole))
