"""Probabilities of the outcomes of draws: as floats, with bounds on their errors, and as rationals."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.ir import Const, Draw, draws
from taskspec.language.expressions.types import Expression
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.expressions.variates.choices import row_table
from taskspec.language.expressions.variates.entry import both

UNIT = 2.0**-53
"""The relative error of one rounded operation."""
COMPUTED = 8 * UNIT
"""The error allowed for a probability that an expression computes, as `1 - s / 10`."""
TAIL = 1e-20
"""More than the probability of the outcomes that are left out of a draw of infinitely many."""


class Floats:
    """Probabilities as float64."""

    def argument(self, draw: Draw, arg: Array) -> Array:
        return arg

    def otherwise(self, draw: Draw, p: Array) -> Array:
        written = draw.args[0]
        if not isinstance(written, Const):
            return np.asarray(1 - p)
        exact = [float(1 - Fraction(v)) if 0 < v < 1 else 1 - one for v, one in zip(written.flat, p.flat, strict=True)]
        return np.array(exact).reshape(p.shape)

    def ratio(self, part: Array, whole: Array) -> Array:
        return np.asarray(part / whole, dtype=np.float64)

    def times(self, a: Array, b: Array) -> Array:
        return both(a, b)


FLOATS = Floats()


@dataclass(frozen=True, slots=True)
class Slack:
    """Bounds on those errors of the probabilities of outcomes that come from the probabilities of draws.

    `relative` is that of every outcome, `absolute` is added to each for probabilities that are computed at run time;
    outcomes of probability `missing` together were left out, and pay at most `beyond` in size.
    """

    relative: float = 0.0
    absolute: float = 0.0
    missing: float = 0.0
    beyond: float = 0.0

    @classmethod
    def of(cls, expressions: Iterable[Expression], reward: Expression | None = None) -> Slack:
        """Return the bounds for outcomes of all draws in some expressions together, which may enter a reward."""
        relative = 0.0
        absolute = 0.0
        missing = 0.0
        for draw in draws(expressions):
            outcomes = VARIATES[draw.base].outcomes
            assert outcomes is not None, draw.base
            relative += outcomes.steps(draw) * UNIT
            is_written = not outcomes.weighted or isinstance(draw.args[0], Const)
            if not is_written and not (outcomes.by_row and row_table(draw.args[0]) is not None):
                absolute += COMPUTED * outcomes.inputs(draw)
            if outcomes.tail:
                missing += TAIL * draw.type.size
        beyond = 0.0
        if missing and reward is not None:
            beyond = max(map(abs, bounds(reward, {})))
        return cls(relative, absolute, missing, beyond)


# -- floats as rationals ----------------------------------------------------------------------------------------------
#
# Floats are read at their exact value, or as the short number that was probably written. `0.1` in a spec is a float a little
# above one tenth. What the program pays is the float, what the author means is the tenth; a claim is decided only where both
# readings agree.

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
        self.as_written = as_written
        self.ambiguous = False

    def __call__(self, value: float | Fraction) -> Fraction:
        """Return a number that an author wrote, or that the program pays. Inexact: an infinity, or nan."""
        if not isinstance(value, float):
            return Fraction(value)
        if not math.isfinite(value):
            raise Inexact
        exact = Fraction(value)
        short = written(value)
        if exact == short:
            return exact
        self.ambiguous = True
        if self.as_written:
            return short
        return exact

    def computed(self, value: float) -> Fraction:
        """Return a probability that was computed in floats. Inexact: one that no short fraction explains."""
        fraction = self(value)
        if written(value).denominator > PLAIN:
            raise Inexact
        return fraction


@lru_cache(maxsize=100_000)
def written(value: float) -> Fraction:
    """Return the short fraction or decimal that rounds to a finite float; its exact value where there is none."""
    exact = Fraction(value)
    size = abs(exact)
    if exact.denominator <= PLAIN and size < 2**53:
        return exact
    if size < 2**53:
        simple = simplest(size * (1 - _ULPS), size * (1 + _ULPS))
        if simple.denominator <= SHORT:
            if exact > 0:
                return simple
            return -simple
    mantissa = repr(value).lower().partition("e")[0]
    if len(mantissa.strip("-0").replace(".", "").strip("0")) <= DIGITS:
        return Fraction(repr(value))
    return exact


def simplest(low: Fraction, high: Fraction) -> Fraction:
    """Return the fraction of the smallest denominator between two positive numbers, by their continued fractions."""
    whole = math.floor(low)
    if whole == low:
        return Fraction(whole)
    if whole + 1 <= high:
        return Fraction(whole + 1)
    return whole + 1 / simplest(1 / (high - whole), 1 / (low - whole))


# -- probabilities as rationals ---------------------------------------------------------------------------------------


class ExactProbabilities:
    """Probabilities of draws as rationals: the arithmetic that `transitions.branches` is given."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader

    def argument(self, draw: Draw, arg: Array) -> Array:
        p = draw.args[0]
        outcomes = VARIATES[draw.base].outcomes
        if outcomes is None or outcomes.tail:
            raise Inexact
        if isinstance(p, Const):
            return objects(list(map(self.reader, p.flat))).reshape(*p.type.shape, 1)
        looked_up = row_table(p)
        if looked_up is None or not outcomes.by_row:
            return objects(list(map(self.reader.computed, arg.reshape(-1).tolist()))).reshape(arg.shape)
        table = looked_up[0]  # its rows in the numbers that they were written with
        k = table.type.shape[-1]
        known: dict[tuple[float, ...], list[Fraction]] = {}
        for first in range(0, len(table.flat), k):
            row = table.flat[first : first + k]
            known.setdefault(tuple(map(float, row)), list(map(self.reader, row)))
        flat: list[Fraction] = []
        for column in arg.T.tolist():
            flat += known[tuple(column)]
        return objects(flat).reshape(arg.shape[1], k).T

    def otherwise(self, draw: Draw, p: Array) -> Array:
        return np.asarray(1 - p)

    def ratio(self, part: Array, whole: Array) -> Array:
        shape = np.broadcast_shapes(part.shape, whole.shape)
        pairs = [*zip(np.broadcast_to(part, shape).flat, np.broadcast_to(whole, shape).flat, strict=True)]
        known = {(p, w): Fraction(int(p), int(w)) for p, w in set(pairs)}  # there are few, of many outcomes
        return objects([known[pair] for pair in pairs]).reshape(shape)

    def times(self, a: Array, b: Array) -> Array:
        if a.shape == (1,) and a[0] == 1:
            return b
        return np.asarray(a * b)


def objects(values: list[Any]) -> Array:
    """Return numbers of any kind as an array."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
