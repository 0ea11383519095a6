"""Arithmetic of numbers, minimum and maximum, rounding, and conversion to ints."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taskspec.lang.operators import bounding, signatures
from taskspec.lang.operators.entry import (
    INTS,
    MIXED,
    NANS,
    PAIRS,
    REALS,
    ZEROS,
    Array,
    Brackets,
    Elements,
    Function,
    Infix,
    Kernel,
    Level,
    Operator,
    Scalar,
    applies,
)
from taskspec.lang.operators.signatures import arithmetic, as_they_are, real, to_integer, truth
from taskspec.lang.types import INT_MAX

Number = Any  # bool, int, float or Fraction


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


def sign(a: Number) -> Number:
    kind = type(a) if not isinstance(a, bool) else int
    return kind((a > 0) - (a < 0))


def min2(a: Number, b: Number) -> Number:
    return a if a <= b or b != b else b


def max2(a: Number, b: Number) -> Number:
    return a if a >= b or b != b else b


TABLE = (
    Operator(
        name="add", commutative=True, rule=arithmetic, reference=lambda a, b: a + b, samples=PAIRS + NANS,
        scalar=Scalar("({0} + {1})"), array=Array("({0} + {1})"),
        bounds=lambda a, n: (a[0].low + a[1].low, a[0].high + a[1].high), finite=bounding.bounded,
        linear=signatures.every, rational=True, whole=True, wraps=True,
        infix=Infix("+", "add", 5, "{0} + {1}", "Sum.", Brackets(Level.SUM, (Level.SUM,), lead=True)),
    ),
    Operator(
        name="sub", rule=arithmetic, reference=lambda a, b: a - b, samples=PAIRS + NANS,
        scalar=Scalar("({0} - {1})"), array=Array("({0} - {1})"),
        bounds=lambda a, n: (a[0].low - a[1].high, a[0].high - a[1].low), finite=bounding.bounded,
        linear=signatures.every, rational=True, whole=True, wraps=True,
        infix=Infix("-", "sub", 5, "{0} - {1}", "Difference.", Brackets(Level.SUM, (Level.SUM, Level.BIG), lead=True)),
    ),
    Operator(
        name="mul", commutative=True, rule=arithmetic, reference=lambda a, b: a * b, samples=PAIRS + NANS,
        scalar=Scalar("({0} * {1})"), array=Array("({0} * {1})"),
        bounds=bounding.product, finite=bounding.bounded, linear=signatures.one, rational=True, whole=True, wraps=True,
        infix=Infix(
            "*", "mul", 6, r"{0} \cdot {1}", "Product.", Brackets(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True)
        ),
    ),
    Operator(
        name="neg", rule=arithmetic, reference=lambda a: -a, samples=((3,), (-2.5,), (0,), (math.nan,)),
        scalar=Scalar("(-{0})"), array=Array("(-{0})"),
        bounds=lambda a, n: (-a[0].high, -a[0].low), linear=signatures.every, rational=True, whole=True, wraps=True,
    ),
    Operator(
        name="div", rule=real, reference=div, samples=PAIRS + ZEROS + NANS,
        scalar=Scalar("({0} / {1} if {1} else div({0}, {1}))", divides="({0} / {1})", names={"div": div}),
        array=Array("({0} / {1})"), kernel=Kernel("({0} / {1})"),
        bounds=bounding.quotient, finite=bounding.divided, linear=signatures.unless_second, rational=True,
        infix=Infix(
            "/", "div", 6, r"\frac{{0}}{{1}}", "Real division; two ints give an exact fraction.",
            Brackets(Level.FACTOR, (Level.SCOPE,), lead=True),
        ),
    ),
    Operator(
        name="floordiv", rule=arithmetic, reference=floordiv,
        samples=PAIRS + ZEROS + NANS[:1],
        scalar=Scalar("({0} // {1} if {1} else 0)", real="floordiv({0}, {1})", divides="({0} // {1})",
                      names={"floordiv": floordiv}),
        array=Array("rt.floordiv({0}, {1})"), kernel=Kernel(real="floordiv_real({0}, {1})", whole="floordiv_int({0}, {1})"),
        bounds=bounding.floor_quotient, finite=bounding.divided, whole=True, wraps=True,
        infix=Infix(
            "//", "floordiv", 6, r"\left\lfloor {0} / {1} \right\rfloor", "Division rounded down.",
            Brackets(Level.ATOM, (Level.PRODUCT, Level.FACTOR), lead=True),
        ),
    ),
    Operator(
        name="mod", rule=arithmetic, reference=mod,
        samples=PAIRS + ZEROS + NANS[:1],
        scalar=Scalar("({0} % {1} if {1} else 0)", real="({0} % {1} if {1} else nan)", divides="({0} % {1})"),
        array=Array("rt.mod({0}, {1})"), kernel=Kernel(real="mod_real({0}, {1})", whole="mod_int({0}, {1})"),
        bounds=bounding.remainder, finite=bounding.divided, whole=True,
        infix=Infix(
            "%", "mod", 6, r"{0} \bmod {1}", "Remainder, with the sign of the divisor.",
            Brackets(Level.REMAINDER, (Level.FACTOR,)),
        ),
    ),
    Operator(
        name="pow", rule=real, reference=pow_,
        samples=((2.0, 0.5), (-8.0, 3.0), (-8.0, 0.5), (0.0, 0.0), (0.0, -1.0), (10.0, 400.0), (1.5, -2.0), (math.nan, 0.0)),
        scalar=Scalar("pow_({0}, {1})", names={"pow_": pow_}), array=Array("rt.pow({0}, {1})"),
        finite=bounding.nowhere, precise=False,
        infix=Infix("**", "pow", 8, "{0}^{{1}}", "Power.", Brackets(Level.POWER, (Level.ATOM, Level.SCOPE))),
    ),
    Operator(
        name="abs", rule=arithmetic, reference=abs, samples=((3,), (-3,), (-2.5,), (math.nan,)),
        scalar=Scalar("abs({0})"), array=Array("xp.abs({0})"),
        kernel=Kernel("abs({0})", whole="select({0} < 0, -{0}, {0})"),
        bounds=bounding.magnitude, whole=True, wraps=True,
        function=Function(
            "abs", ("x",), r"\lvert {0} \rvert", "Absolute value.", ((-3,), (2.5,), (INTS,)), applies("abs")
        ),
    ),
    Operator(
        name="sign", rule=arithmetic, reference=sign,
        samples=((3,), (-3,), (0,), (-2.5,), (0.0,), (math.nan,)),
        scalar=Scalar("sign({0})", names={"sign": sign}), array=Array("rt.sign({0})"),
        kernel=Kernel(real="(f64({0} > 0.0) - f64({0} < 0.0))", whole="(i32({0} > 0) - i32({0} < 0))"),
        bounds=bounding.to_int(sign), whole=True,
        function=Function("sign", ("x",), r"\operatorname{sign}({0})", "-1, 0 or 1.", ((-3,), (0,), (2.5,)), applies("sign")),
    ),
    Operator(
        name="min2", rule=arithmetic, reference=min2, samples=PAIRS + NANS,
        elements=Elements.CHOSEN, commutative=True,
        scalar=Scalar("({0} if {0} <= {1} else {1})", real="({0} if {0} <= {1} or {1} != {1} else {1})"),
        array=Array("xp.minimum({0}, {1})", real="rt.min2({0}, {1})", nonzero="xp.fmin({0}, {1})"),
        kernel=Kernel(real="min2({0}, {1})", whole="select({0} <= {1}, {0}, {1})"),
        bounds=bounding.extreme(min), whole=True,
    ),
    Operator(
        name="max2", rule=arithmetic, reference=max2, samples=PAIRS + NANS,
        elements=Elements.CHOSEN, commutative=True,
        scalar=Scalar("({0} if {0} >= {1} else {1})", real="({0} if {0} >= {1} or {1} != {1} else {1})"),
        array=Array("xp.maximum({0}, {1})", real="rt.max2({0}, {1})", nonzero="xp.fmax({0}, {1})"),
        kernel=Kernel(real="max2({0}, {1})", whole="select({0} >= {1}, {0}, {1})"),
        bounds=bounding.extreme(max), whole=True,
    ),
)  # fmt: skip


# Rounding, and conversion of conditions and ints.


def _saturating(function: Callable[[Any], int]) -> Callable[[Any], int]:
    """To the nearest int that every backend holds; nan becomes 0."""

    def saturated(x: Any) -> int:
        if -INT_MAX <= x <= INT_MAX:
            return function(x)
        return 0 if x != x else INT_MAX if x > 0 else -INT_MAX

    return saturated


floor = _saturating(math.floor)
ceil = _saturating(math.ceil)
round_ = _saturating(round)


ROUNDING = (
    Operator(
        name="floor", rule=to_integer, promote=as_they_are, reference=floor, samples=REALS,
        scalar=Scalar("floor({0})", names={"floor": floor}), array=Array("rt.to_int(xp.floor({0}))"),
        bounds=bounding.to_int(floor), rounds=True,
        function=Function("floor", ("x",), r"\lfloor {0} \rfloor", "Rounded down to an int.", ((2.7,), (-2.1,), (MIXED,)),
                          applies("floor")),
    ),
    Operator(
        name="ceil", rule=to_integer, promote=as_they_are, reference=ceil, samples=REALS,
        scalar=Scalar("ceil({0})", names={"ceil": ceil}), array=Array("rt.to_int(xp.ceil({0}))"),
        bounds=bounding.to_int(ceil), rounds=True,
        function=Function("ceil", ("x",), r"\lceil {0} \rceil", "Rounded up to an int.", ((2.2,), (-2.9,)), applies("ceil")),
    ),
    Operator(
        name="round", rule=to_integer, promote=as_they_are, reference=round_,
        samples=(*REALS, (0.5,), (1.5,), (-2.5,)),
        scalar=Scalar("round_({0})", names={"round_": round_}), array=Array("rt.to_int(xp.round({0}))"),
        bounds=bounding.to_int(round_), rounds=True,
        function=Function("round", ("x",), r"\operatorname{round}({0})", "Nearest int, halves to even.", ((2.5,), (-2.6,)),
                          applies("round")),
    ),
    Operator(
        name="to_int", rule=truth, promote=as_they_are, reference=int, samples=((True,), (False,)),
        scalar=Scalar("(1 if {0} else 0)"), array=Array("rt.as_int({0})"), kernel=Kernel("i32({0})"), bounds=bounding.same,
    ),
    Operator(
        name="to_real", rule=real, promote=as_they_are, reference=float,
        samples=((True,), (False,), (3,), (-4,)),
        scalar=Scalar("float({0})"), array=Array("rt.as_real({0})"), kernel=Kernel("f64({0})"), bounds=bounding.same,
        linear=signatures.every, whole=True,
    ),
)  # fmt: skip
