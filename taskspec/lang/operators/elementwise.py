"""Elementwise operators: arithmetic, elementary functions, comparisons and conditions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taskspec.lang.operators import rules
from taskspec.lang.operators.entry import (
    INTS,
    LOGIC,
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
from taskspec.lang.operators.rules import (
    arithmetic,
    as_they_are,
    but_the_first,
    choose,
    compare,
    logical,
    real,
    to_common,
    to_integer,
    to_numbers,
    truth,
)
from taskspec.lang.types import EVERYTHING, INF, INT_MAX, Args, Interval

# ---------- arithmetic
# Arithmetic of numbers, minimum and maximum, rounding, and conversion to ints.

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


ARITHMETIC = (
    Operator(
        name="add", commutative=True, rule=arithmetic, reference=lambda a, b: a + b, samples=PAIRS + NANS,
        scalar=Scalar("({0} + {1})"), array=Array("({0} + {1})"),
        bounds=lambda a, n: (a[0].low + a[1].low, a[0].high + a[1].high), finite=rules.bounded,
        linear=rules.every, rational=True, whole=True, wraps=True,
        infix=Infix("+", "add", 5, "{0} + {1}", "Sum.", Brackets(Level.SUM, (Level.SUM,), lead=True)),
    ),
    Operator(
        name="sub", rule=arithmetic, reference=lambda a, b: a - b, samples=PAIRS + NANS,
        scalar=Scalar("({0} - {1})"), array=Array("({0} - {1})"),
        bounds=lambda a, n: (a[0].low - a[1].high, a[0].high - a[1].low), finite=rules.bounded,
        linear=rules.every, rational=True, whole=True, wraps=True,
        infix=Infix("-", "sub", 5, "{0} - {1}", "Difference.", Brackets(Level.SUM, (Level.SUM, Level.BIG), lead=True)),
    ),
    Operator(
        name="mul", commutative=True, rule=arithmetic, reference=lambda a, b: a * b, samples=PAIRS + NANS,
        scalar=Scalar("({0} * {1})"), array=Array("({0} * {1})"),
        bounds=rules.product, finite=rules.bounded, linear=rules.one, rational=True, whole=True, wraps=True,
        infix=Infix(
            "*", "mul", 6, r"{0} \cdot {1}", "Product.", Brackets(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True)
        ),
    ),
    Operator(
        name="neg", rule=arithmetic, reference=lambda a: -a, samples=((3,), (-2.5,), (0,), (math.nan,)),
        scalar=Scalar("(-{0})"), array=Array("(-{0})"),
        bounds=lambda a, n: (-a[0].high, -a[0].low), linear=rules.every, rational=True, whole=True, wraps=True,
    ),
    Operator(
        name="div", rule=real, reference=div, samples=PAIRS + ZEROS + NANS,
        scalar=Scalar("({0} / {1} if {1} else div({0}, {1}))", divides="({0} / {1})", names={"div": div}),
        array=Array("({0} / {1})"), kernel=Kernel("({0} / {1})"),
        bounds=rules.quotient, finite=rules.divided, linear=rules.unless_second, rational=True,
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
        bounds=rules.floor_quotient, finite=rules.divided, whole=True, wraps=True,
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
        bounds=rules.remainder, finite=rules.divided, whole=True,
        infix=Infix(
            "%", "mod", 6, r"{0} \bmod {1}", "Remainder, with the sign of the divisor.",
            Brackets(Level.REMAINDER, (Level.FACTOR,)),
        ),
    ),
    Operator(
        name="pow", rule=real, reference=pow_,
        samples=((2.0, 0.5), (-8.0, 3.0), (-8.0, 0.5), (0.0, 0.0), (0.0, -1.0), (10.0, 400.0), (1.5, -2.0), (math.nan, 0.0)),
        scalar=Scalar("pow_({0}, {1})", names={"pow_": pow_}), array=Array("rt.pow({0}, {1})"),
        finite=rules.nowhere, precise=False,
        infix=Infix("**", "pow", 8, "{0}^{{1}}", "Power.", Brackets(Level.POWER, (Level.ATOM, Level.SCOPE))),
    ),
    Operator(
        name="abs", rule=arithmetic, reference=abs, samples=((3,), (-3,), (-2.5,), (math.nan,)),
        scalar=Scalar("abs({0})"), array=Array("xp.abs({0})"),
        kernel=Kernel("abs({0})", whole="select({0} < 0, -{0}, {0})"),
        bounds=rules.magnitude, whole=True, wraps=True,
        function=Function(
            "abs", ("x",), r"\lvert {0} \rvert", "Absolute value.", ((-3,), (2.5,), (INTS,)), applies("abs")
        ),
    ),
    Operator(
        name="sign", rule=arithmetic, reference=sign,
        samples=((3,), (-3,), (0,), (-2.5,), (0.0,), (math.nan,)),
        scalar=Scalar("sign({0})", names={"sign": sign}), array=Array("rt.sign({0})"),
        kernel=Kernel(real="(f64({0} > 0.0) - f64({0} < 0.0))", whole="(i32({0} > 0) - i32({0} < 0))"),
        bounds=rules.to_int(sign), whole=True,
        function=Function("sign", ("x",), r"\operatorname{sign}({0})", "-1, 0 or 1.", ((-3,), (0,), (2.5,)), applies("sign")),
    ),
    Operator(
        name="min2", rule=arithmetic, reference=min2, samples=PAIRS + NANS,
        elements=Elements.CHOSEN, commutative=True,
        scalar=Scalar("({0} if {0} <= {1} else {1})", real="({0} if {0} <= {1} or {1} != {1} else {1})"),
        array=Array("xp.minimum({0}, {1})", real="rt.min2({0}, {1})", nonzero="xp.fmin({0}, {1})"),
        kernel=Kernel(real="min2({0}, {1})", whole="select({0} <= {1}, {0}, {1})"),
        bounds=rules.extreme(min), whole=True,
    ),
    Operator(
        name="max2", rule=arithmetic, reference=max2, samples=PAIRS + NANS,
        elements=Elements.CHOSEN, commutative=True,
        scalar=Scalar("({0} if {0} >= {1} else {1})", real="({0} if {0} >= {1} or {1} != {1} else {1})"),
        array=Array("xp.maximum({0}, {1})", real="rt.max2({0}, {1})", nonzero="xp.fmax({0}, {1})"),
        kernel=Kernel(real="max2({0}, {1})", whole="select({0} >= {1}, {0}, {1})"),
        bounds=rules.extreme(max), whole=True,
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
        bounds=rules.to_int(floor), rounds=True,
        function=Function("floor", ("x",), r"\lfloor {0} \rfloor", "Rounded down to an int.", ((2.7,), (-2.1,), (MIXED,)),
                          applies("floor")),
    ),
    Operator(
        name="ceil", rule=to_integer, promote=as_they_are, reference=ceil, samples=REALS,
        scalar=Scalar("ceil({0})", names={"ceil": ceil}), array=Array("rt.to_int(xp.ceil({0}))"),
        bounds=rules.to_int(ceil), rounds=True,
        function=Function("ceil", ("x",), r"\lceil {0} \rceil", "Rounded up to an int.", ((2.2,), (-2.9,)), applies("ceil")),
    ),
    Operator(
        name="round", rule=to_integer, promote=as_they_are, reference=round_,
        samples=(*REALS, (0.5,), (1.5,), (-2.5,)),
        scalar=Scalar("round_({0})", names={"round_": round_}), array=Array("rt.to_int(xp.round({0}))"),
        bounds=rules.to_int(round_), rounds=True,
        function=Function("round", ("x",), r"\operatorname{round}({0})", "Nearest int, halves to even.", ((2.5,), (-2.6,)),
                          applies("round")),
    ),
    Operator(
        name="to_int", rule=truth, promote=as_they_are, reference=int, samples=((True,), (False,)),
        scalar=Scalar("(1 if {0} else 0)"), array=Array("rt.as_int({0})"), kernel=Kernel("i32({0})"), bounds=rules.same,
    ),
    Operator(
        name="to_real", rule=real, promote=as_they_are, reference=float,
        samples=((True,), (False,), (3,), (-4,)),
        scalar=Scalar("float({0})"), array=Array("rt.as_real({0})"), kernel=Kernel("f64({0})"), bounds=rules.same,
        linear=rules.every, whole=True,
    ),
)  # fmt: skip


# ---------- elementary
# Elementary functions of reals.

_PLACES = ((0.5,), (-2.0,))


def _total(function: Callable[[float], float]) -> Callable[[float], float]:
    """Return the function with nan where it is not defined."""

    def total(x: Any) -> float:
        try:
            return function(x)
        except ValueError:
            return math.nan

    return total


def exp(x: Any) -> float:
    try:
        return math.exp(x)
    except OverflowError:
        return math.inf


def log(x: Any) -> float:
    return math.log(x) if x > 0 else (-math.inf if x == 0 else math.nan)


sqrt, sin, cos, tan = map(_total, (math.sqrt, math.sin, math.cos, math.tan))


def _root(args: Args, node: Any) -> Interval:
    low, high = (math.sqrt(max(0.0, x)) if x < INF else INF for x in args[0][:2])
    return low, high


ELEMENTARY = (
    Operator(
        name="sqrt", rule=real, reference=sqrt, samples=REALS,
        scalar=Scalar("sqrt({0})", names={"sqrt": sqrt}), array=Array("xp.sqrt({0})"), kernel=Kernel(names=("sqrt",)),
        bounds=_root, finite=lambda args, found: args[0].finite and args[0].low >= 0,
        function=Function("sqrt", ("x",), r"\sqrt{{0}}", "Square root.", ((2.0,), (9,), (-1.0,)), applies("sqrt")),
    ),
    Operator(
        name="exp", rule=real, reference=exp, samples=(*REALS, (800.0,), (-800.0,)),
        scalar=Scalar("exp({0})", names={"exp": exp}), array=Array("xp.exp({0})"), kernel=Kernel(names=("exp",)),
        bounds=rules.fixed(0, INF), finite=lambda args, found: args[0].finite and args[0].high < 700, precise=False,
        function=Function(
            "exp", ("x",), r"e^{{0}}", "Exponential.", ((0.5,), (1000.0,)), applies("exp"),
            brackets=Brackets(Level.POWER, (Level.SCOPE,)),
        ),
    ),
    Operator(
        name="log", rule=real, reference=log, samples=REALS,
        scalar=Scalar("log({0})", names={"log": log}), array=Array("xp.log({0})"), kernel=Kernel(names=("log",)),
        bounds=rules.fixed(*EVERYTHING), finite=lambda args, found: args[0].finite and args[0].low > 0, precise=False,
        function=Function("log", ("x",), r"\log({0})", "Natural logarithm.", ((0.5,), (0.0,)), applies("log")),
    ),
    Operator(
        name="sin", rule=real, reference=sin, samples=REALS,
        scalar=Scalar("sin({0})", names={"sin": sin}), array=Array("xp.sin({0})"),
        bounds=rules.fixed(-1, 1), precise=False,
        function=Function("sin", ("x",), r"\sin({0})", "Sine, in radians.", _PLACES, applies("sin")),
    ),
    Operator(
        name="cos", rule=real, reference=cos, samples=REALS,
        scalar=Scalar("cos({0})", names={"cos": cos}), array=Array("xp.cos({0})"),
        bounds=rules.fixed(-1, 1), precise=False,
        function=Function("cos", ("x",), r"\cos({0})", "Cosine, in radians.", _PLACES, applies("cos")),
    ),
    Operator(
        name="tan", rule=real, reference=tan, samples=REALS,
        scalar=Scalar("tan({0})", names={"tan": tan}), array=Array("xp.tan({0})"), kernel=Kernel(names=("tan",)),
        finite=rules.nowhere, precise=False,
        function=Function("tan", ("x",), r"\tan({0})", "Tangent, in radians.", _PLACES, applies("tan")),
    ),
    Operator(
        name="tanh", rule=real, reference=math.tanh, samples=REALS,
        scalar=Scalar("tanh({0})", names={"tanh": math.tanh}), array=Array("xp.tanh({0})"), kernel=Kernel(names=("tanh",)),
        bounds=rules.fixed(-1, 1), precise=False,
        function=Function("tanh", ("x",), r"\tanh({0})", "Hyperbolic tangent.", _PLACES, applies("tanh")),
    ),
    Operator(
        name="asinh", rule=real, reference=math.asinh, samples=REALS,
        scalar=Scalar("asinh({0})", names={"asinh": math.asinh}), array=Array("xp.arcsinh({0})"),
        kernel=Kernel(names=("asinh",)), bounds=rules.increasing(math.asinh, ulps=4), precise=False,
        function=Function(
            "asinh", ("x",), r"\operatorname{arsinh}({0})", "Inverse hyperbolic sine.", _PLACES, applies("asinh")
        ),
    ),
    Operator(
        name="atan2", rule=real, reference=math.atan2,
        samples=(*tuple((float(a), float(b)) for a, b in PAIRS), (0.0, 0.0), (1.0, 0.0)),
        scalar=Scalar("atan2({0}, {1})", names={"atan2": math.atan2}), array=Array("xp.arctan2({0}, {1})"),
        kernel=Kernel(names=("atan2",)), bounds=rules.fixed(-math.pi, math.pi), precise=False,
        function=Function(
            "atan2", ("y", "x"), r"\operatorname{atan2}({0}, {1})", "Angle of the point (x, y), in radians.",
            ((0.5, -1.0),), applies("atan2"),
        ),
    ),
)  # fmt: skip


# ---------- logic
# Comparisons, conditions, and choices between values.


def where(condition: Any, a: Any, b: Any) -> Any:
    return a if condition else b


LOGICAL = (
    Operator(
        name="eq", rule=compare, promote=to_common, reference=lambda a, b: bool(a == b),
        samples=PAIRS + NANS + LOGIC, scalar=Scalar("({0} == {1})"), array=Array("({0} == {1})"),
        elements=Elements.RANKED, commutative=True,
        infix=Infix("==", "eq", 4, "{0} = {1}", "Equal; comparisons can be chained."),
    ),
    Operator(
        name="ne", rule=compare, promote=to_common, reference=lambda a, b: bool(a != b),
        samples=PAIRS + NANS + LOGIC, scalar=Scalar("({0} != {1})"), array=Array("({0} != {1})"),
        elements=Elements.RANKED, commutative=True,
        infix=Infix("!=", "ne", 4, r"{0} \neq {1}", "Different."),
    ),
    Operator(
        name="lt", rule=compare, promote=to_numbers, reference=lambda a, b: bool(a < b), samples=PAIRS + NANS,
        scalar=Scalar("({0} < {1})"), array=Array("({0} < {1})"),
        elements=Elements.RANKED, infix=Infix("<", "lt", 4, "{0} < {1}", "Less."),
    ),
    Operator(
        name="le", rule=compare, promote=to_numbers, reference=lambda a, b: bool(a <= b),
        samples=PAIRS + NANS, scalar=Scalar("({0} <= {1})"), array=Array("({0} <= {1})"),
        elements=Elements.RANKED, infix=Infix("<=", "le", 4, r"{0} \leq {1}", "Less or equal."),
    ),
    Operator(
        name="not", rule=logical, promote=as_they_are, reference=lambda a: not a,
        samples=((True,), (False,)), scalar=Scalar("(not {0})"), array=Array("xp.logical_not({0})"),
        kernel=Kernel("({0} == False)"),
        infix=Infix("not", "not", 3, r"\lnot {0}", "The condition does not hold.", Brackets(Level.NOT, (Level.ATOM,))),
    ),
    Operator(
        name="and", commutative=True, rule=logical, promote=as_they_are, reference=lambda a, b: bool(a and b),
        samples=LOGIC, scalar=Scalar("({0} and {1})"), array=Array("xp.logical_and({0}, {1})"), kernel=Kernel("({0} & {1})"),
        infix=Infix("and", "and", 2, r"{0} \land {1}", "Both conditions hold.", Brackets(Level.AND, (Level.NOT,))),
    ),
    Operator(
        name="or", commutative=True, rule=logical, promote=as_they_are, reference=lambda a, b: bool(a or b),
        samples=LOGIC, scalar=Scalar("({0} or {1})"), array=Array("xp.logical_or({0}, {1})"), kernel=Kernel("({0} | {1})"),
        # Two different connectives side by side are easier to read with brackets.
        infix=Infix("or", "or", 1, r"{0} \lor {1}", "Either condition holds.", Brackets(Level.OR, (Level.NOT,))),
    ),
    Operator(
        name="where", elements=Elements.MOVED, indices=(0,), rule=choose, promote=but_the_first, reference=where,
        samples=((True, 1, 2), (False, 1, 2), (True, 1.5, -2.0), (False, 1.5, -2.0)),
        scalar=Scalar("({1} if {0} else {2})"), array=Array("xp.where({0}, {1}, {2})"), kernel=Kernel("select({0}, {1}, {2})"),
        bounds=lambda args, node: rules.union(args[1:], node), linear=rules.unless_first, whole=True,
        function=Function(
            "where", ("condition", "x", "y"), r"\begin{cases}{1} & \text{if } {0}\\ {2} & \text{otherwise}\end{cases}",
            "x where the condition holds, else y; element by element.", ((True, 1, 2.5), ((True, False, True), INTS, 0)),
            applies("where"),
        ),
    ),
)  # fmt: skip

TABLE = (*ARITHMETIC, *ELEMENTARY, *ROUNDING, *LOGICAL)
