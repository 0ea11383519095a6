"""Operations on constants, worked out when a task is built, by the references of the operator table."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from taskspec.lang.evaluate import Flat, apply_flat
from taskspec.lang.ir import Const, Node, plain
from taskspec.lang.operators import Operator
from taskspec.lang.types import INT, REAL, Kind, Refused, Type
from taskspec.limits import Limits


def folded(name: str, args: Sequence[Node], static: tuple[int, ...], result: Type) -> Flat:
    """The elements of an operation on constants. Fractions that are compared with floats are floats: 0.1 is 1 / 10."""
    constants = [a for a in args if isinstance(a, Const)]
    flats = [c.flat for c in constants]
    reals = [c.flat for c in constants if c.type.kind is Kind.REAL]  # a table of ints may have a million of them
    if result.kind is not Kind.REAL and any(isinstance(v, float) for flat in reals for v in flat):
        flats = [tuple(map(plain, flat)) for flat in flats]
    return apply_flat(name, flats, tuple(c.type for c in constants), static, result)


def rational(op: Operator, args: Sequence[Node], result: Type) -> Flat | None:
    """Arithmetic on whole numbers and fractions, which stay exact until they meet a float; None for other operations."""
    if not op.rational or result.kind is not Kind.REAL or not all(isinstance(a, Const) for a in args):
        return None
    flats = [a.flat for a in args if isinstance(a, Const)]
    if any(isinstance(v, float) for flat in flats for v in flat) or (op.name == "div" and not all(flats[1])):
        return None
    fractions = [tuple(Fraction(v) for v in flat) for flat in flats]
    values = apply_flat(op.name, fractions, tuple(a.type for a in args), (), result)
    if any(max(v.numerator.bit_length(), v.denominator.bit_length()) > Limits.bits for v in values):
        return None
    return values


def power(base: Const, exponent: Const) -> tuple[Any, Type] | None:
    """`base ** exponent` of single numbers where it is exact; None where it is for the run time's reals.

    Raises:
        Refused: (E314) for one too large to write out.
    """
    b, e = base.value, exponent.value
    if exponent.type.kind is Kind.REAL or (base.type.kind is Kind.REAL and not isinstance(b, Fraction)):
        return None
    if b == 0 and e < 0:
        return float("inf"), REAL
    if max(abs(Fraction(b).numerator), Fraction(b).denominator).bit_length() * abs(e) > Limits.bits * 4:
        raise Refused("this power is too large to write out", "E314")
    value = Fraction(b) ** int(e)
    integral = base.type.kind is not Kind.REAL and e >= 0
    return (int(value), INT) if integral else (value, REAL)
