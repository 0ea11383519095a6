"""Rules that operators share: types, promotion, linearity, and bounds.

Rounding to nearest never turns the order of two numbers round. So where an operation grows, or falls, with each of its
arguments, its values at the corners, worked out as the run time does, bound all of its values.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from taskspec.language.expressions.ir import Apply, Const
from taskspec.language.expressions.types import (
    EVERYTHING,
    HUGE,
    INF,
    Args,
    Interval,
    Kind,
    NoElement,
    Range,
    Type,
    join,
)

TypeRule = Callable[[tuple[Type, ...]], Type | str]
"""Result type from argument types, or a sentence about what is wrong."""
Promote = Callable[[Sequence[Kind], Kind], Sequence[Kind]]
"""The kinds that an operator works on, from the kinds of its arguments and of its result; nothing is ever demoted."""
Bounds = Callable[[Args, Apply], Interval]
_FACTORS = 10_000
"""Products of more elements are not followed factor by factor."""


# -- types --------------------------------------------------------------------------------------------------------


def elementwise(kind: Callable[[tuple[Type, ...]], Kind | str]) -> TypeRule:
    """Apply to elements: all shapes are equal, scalars stretch."""

    def rule(types: tuple[Type, ...]) -> Type | str:
        shapes = [t.shape for t in types if t.shape]
        if len(set(shapes)) > 1:
            return f"the shapes {' and '.join(str(list(x)) for x in shapes)} do not match element by element"
        result = kind(types)
        if isinstance(result, str):
            return result
        return Type(result, shapes[0] if shapes else ())

    return rule


def _conditions_to(result: Kind) -> Callable[[tuple[Type, ...]], Kind | str]:
    def kind(types: tuple[Type, ...]) -> Kind | str:
        for t in types:
            if t.kind is not Kind.BOOL:
                return f"a condition is needed, not {t.with_article}"
        return result

    return kind


def _choose(types: tuple[Type, ...]) -> Kind | str:
    condition, *branches = types
    if condition.kind is not Kind.BOOL:
        return f"a condition is needed, not {condition.with_article}"
    return join(*(t.kind for t in branches))


arithmetic = elementwise(lambda types: join(Kind.INT, *(t.kind for t in types)))
real = elementwise(lambda types: Kind.REAL)
to_integer = elementwise(lambda types: Kind.INT)
truth = elementwise(_conditions_to(Kind.INT))
compare = elementwise(lambda types: Kind.BOOL)
logical = elementwise(_conditions_to(Kind.BOOL))
choose = elementwise(_choose)


def reduction(kind: Callable[[Kind], Kind | str], empty: bool = True) -> TypeRule:
    """Reduce all elements to one; `empty` says whether there is a value for no elements."""

    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if t.is_scalar:
            return f"a vector is needed, not {t.with_article}"
        if not empty and t.size == 0:
            raise NoElement("smallest and no largest element")
        result = kind(t.kind)
        if isinstance(result, str):
            return result
        return Type(result)

    return rule


def vector(kind: Callable[[Kind], Kind]) -> TypeRule:
    """Map a vector to another of the same length."""

    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if len(t.shape) != 1:
            return f"a vector is needed, not {t.with_article if t.is_scalar else 'a matrix'}"
        return Type(kind(t.kind), t.shape)

    return rule


def conditions(result: Kind) -> Callable[[Kind], Kind | str]:
    """Take a vector of conditions."""
    return lambda kind: result if kind is Kind.BOOL else f"a vector of conditions is needed, not of {kind}s"


def number(kind: Kind) -> Kind:
    """Kind of a number; a condition counts as 0 or 1."""
    return join(Kind.INT, kind)


# -- promotion ----------------------------------------------------------------------------------------------------


def to_result(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return [result] * len(kinds)


def as_they_are(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return kinds


# -- where a value is linear in what its arguments are linear in -------------------------------------------------------


def never(below: Sequence[bool]) -> bool:
    return False


def every(below: Sequence[bool]) -> bool:
    """Hold for sums, and for what only chooses elements."""
    return True


def unless_second(below: Sequence[bool]) -> bool:
    return not below[1]


# -- bounds -------------------------------------------------------------------------------------------------------


def everything(args: Args, node: Apply) -> Interval:
    return EVERYTHING


def fixed(low: float, high: float) -> Bounds:
    return lambda args, node: (low, high)


def same(args: Args, node: Apply) -> Interval:
    """Bound an operator that chooses elements of its first argument."""
    return args[0][:2]


def union(args: Args, node: Apply) -> Interval:
    """Bound an operator whose value is one of its arguments."""
    return min(a.low for a in args), max(a.high for a in args)


def place(args: Args, node: Apply) -> Interval:
    """Bounds of a place among the elements of the first argument."""
    return 0, max(0, node.args[0].type.size - 1)


def _corners(function: Callable[[float, float], float], args: Args) -> Interval:
    values = []
    for a, b in itertools.product(args[0][:2], args[1][:2]):
        values.append(function(a, b))
    return min(values), max(values)


def _mul(a: float, b: float) -> float:
    if a == 0 or b == 0:
        return 0
    return a * b


def product(args: Args, node: Apply) -> Interval:
    low, high = _corners(_mul, args)
    if len(node.args) == 2 and node.args[0] is node.args[1]:  # a square
        low = max(low, 0)
    return low, high


def quotient(args: Args, node: Apply) -> Interval:
    if args[1].holds_zero() or not args[1].bounded:
        return EVERYTHING
    return _corners(lambda a, b: a / b, args)


def floor_quotient(args: Args, node: Apply) -> Interval:
    integral = node.type.kind is Kind.INT
    if not (args[0].bounded and args[1].bounded):
        return EVERYTHING
    if args[1].holds_zero():
        most = max(abs(args[0].low), abs(args[0].high))
        if integral:
            return (-most, most)
        return EVERYTHING
    low, high = _corners(lambda a, b: a // b, args)
    if not integral:  # wider by what a quotient that is too large for its last digits may be off
        low -= abs(low) * 2**-50 * (abs(low) >= 2**50)
        high += abs(high) * 2**-50 * (abs(high) >= 2**50)
    return low, high


def remainder(args: Args, node: Apply) -> Interval:
    a, b = args[0][:2]
    c, d = args[1][:2]
    gap = 0
    if node.type.kind is Kind.INT:
        gap = 1
    if c > 0:
        if gap and a >= 0 and b < c:
            return (a, b)
        return (0, d - gap)
    if d < 0:
        return c + gap, 0
    if gap:
        return (min(0, c + 1), max(0, d - 1))
    return EVERYTHING


def extreme(pick: Callable[[float, float], float]) -> Bounds:
    """Bound an extreme of two ints, or of two reals; if one may be nan, the other is taken then.

    It counts as such unless it is a constant, also where it is known to be a number: how many words a draw of Poisson takes
    follows from the bound of its rate, and `docs/reference/seeding.md` states this rule.
    """

    def rule(args: Args, node: Apply) -> Interval:
        a, b = args
        candidates = [(pick(a.low, b.low), pick(a.high, b.high))]
        if node.type.kind is Kind.REAL:
            for i, other in ((0, b), (1, a)):
                if not isinstance(node.args[i], Const):
                    candidates.append(other[:2])
        return min(low for low, _ in candidates), max(high for _, high in candidates)

    return rule


def magnitude(args: Args, node: Apply) -> Interval:
    ends = (abs(args[0].low), abs(args[0].high))
    return 0 if args[0].holds_zero() else min(ends), max(ends)


def increasing(function: Callable[[float], float], ulps: int = 0) -> Bounds:
    """Bound an increasing function of reals, which libraries compute to within `ulps`."""

    def rule(args: Args, node: Apply) -> Interval:
        low, high = map(function, args[0][:2])
        for _ in range(ulps):
            low = math.nextafter(low, -INF)
            high = math.nextafter(high, INF)
        return low, high

    return rule


def to_int(function: Callable[[float], int]) -> Bounds:
    """Bound a monotone function to ints, 0 for nan: saturating where the bounds are finite."""

    def rule(args: Args, node: Apply) -> Interval:
        low, high = args[0][:2]
        if math.isfinite(low):
            low = function(low)
        if math.isfinite(high):
            high = function(high)
        if args[0].finite:
            return (low, high)
        return (min(low, 0), max(high, 0))

    return rule


def _sum_of(value: float, n: int) -> float:
    if isinstance(value, int) or n == 0:
        return _mul(value, n)
    with np.errstate(over="ignore"):
        return float(np.add.accumulate(np.full(n, value))[-1])


def total(args: Args, node: Apply) -> Interval:
    n = node.args[0].type.size
    return _sum_of(args[0].low, n), _sum_of(args[0].high, n)


def running(args: Args, node: Apply) -> Interval:
    low, high = total(args, node)
    return min(args[0].low, low), max(args[0].high, high)


def power(args: Args, node: Apply) -> Interval:
    """Bound the product of all elements, multiplied, one after the other."""
    n = node.args[0].type.size
    if n == 0:
        return (1, 1)
    if not args[0].bounded or n > _FACTORS:
        return EVERYTHING
    beyond = INF if node.type.kind is Kind.REAL else HUGE  # a real product may overflow; a wide int is refused
    edge: Interval = args[0][:2]
    for _ in range(n - 1):
        wider = product([Range(*edge), args[0]], node)
        if wider == edge:
            return edge
        edge = wider
        if max(map(abs, edge)) > HUGE:
            return (0 if args[0].low >= 0 else -beyond), beyond
    return edge


# -- when values are finite numbers -------------------------------------------------------------------------------


def stays_finite(args: Args, result: Interval) -> bool:
    return all(a.finite for a in args)


def bounded(args: Args, result: Interval) -> bool:
    return stays_finite(args, result) and all(map(math.isfinite, result))


def divided(args: Args, result: Interval) -> bool:
    return bounded(args, result) and not args[1].holds_zero()


def nowhere(args: Args, result: Interval) -> bool:
    return False
