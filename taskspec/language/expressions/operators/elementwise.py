"""Elementwise operators: arithmetic, elementary functions, comparisons and conditions."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from taskspec.language.expressions.operators import rules
from taskspec.language.expressions.operators.entry import (
    ENCLOSED,
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
from taskspec.language.expressions.types import INF, INT_MAX, Args, Interval, Kind

# -- arithmetic, minimum and maximum -------------------------------------------------------------------------------

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
        if _is_int(a, b):
            return 0
        return div(a, b)
    if not _is_int(a, b) and not (math.isfinite(a) and math.isfinite(b)):
        return math.nan
    return a // b


def mod(a: Number, b: Number) -> Number:
    if b == 0:
        if _is_int(a, b):
            return 0
        return math.nan
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
        if odd:
            return math.copysign(math.inf, a)
        return math.inf


def sign(a: Number) -> Number:
    kind = int
    if not isinstance(a, bool):
        kind = type(a)
    return kind((a > 0) - (a < 0))


def min2(a: Number, b: Number) -> Number:
    if a <= b or b != b:
        return a
    return b


def max2(a: Number, b: Number) -> Number:
    if a >= b or b != b:
        return a
    return b


def _extreme(
    name: str, reference: Callable[[Any, Any], Any], sign: str, whole: str, nonzero: str, pick: Callable[[float, float], float],
) -> Operator:  # fmt: skip
    return Operator(
        name=name, rule=rules.arithmetic, reference=reference, samples=PAIRS + NANS, elements=Elements.CHOSEN, commutative=True,
        scalar=Scalar(f"({{0}} if {{0}} {sign} {{1}} else {{1}})",
                      real=f"({{0}} if {{0}} {sign} {{1}} or {{1}} != {{1}} else {{1}})"),
        array=Array(f"xp.{whole}({{0}}, {{1}})", real=f"rt.{name}({{0}}, {{1}})", nonzero=f"xp.{nonzero}({{0}}, {{1}})"),
        kernel=Kernel(real=f"{name}({{0}}, {{1}})", whole=f"select({{0}} {sign} {{1}}, {{0}}, {{1}})"),
        bounds=rules.extreme(pick),
    )  # fmt: skip


ARITHMETIC = (
    Operator(
        name="add", commutative=True, rule=rules.arithmetic, reference=lambda a, b: a + b, samples=PAIRS + NANS,
        scalar=Scalar("({0} + {1})"), array=Array("({0} + {1})"),
        bounds=lambda a, n: (a[0].low + a[1].low, a[0].high + a[1].high), finite=rules.bounded,
        linear=rules.every, rational=True, wraps=True,
        infix=Infix("+", "add", 5, "{0} + {1}", "Sum.", Brackets(Level.SUM, (Level.SUM,), lead=True)),
    ),
    Operator(
        name="sub", rule=rules.arithmetic, reference=lambda a, b: a - b, samples=PAIRS + NANS,
        scalar=Scalar("({0} - {1})"), array=Array("({0} - {1})"),
        bounds=lambda a, n: (a[0].low - a[1].high, a[0].high - a[1].low), finite=rules.bounded,
        linear=rules.every, rational=True, wraps=True,
        infix=Infix("-", "sub", 5, "{0} - {1}", "Difference.", Brackets(Level.SUM, (Level.SUM, Level.BIG), lead=True)),
    ),
    Operator(
        name="mul", commutative=True, rule=rules.arithmetic, reference=lambda a, b: a * b, samples=PAIRS + NANS,
        scalar=Scalar("({0} * {1})"), array=Array("({0} * {1})"),
        bounds=rules.product, finite=rules.bounded, linear=lambda below: sum(below) == 1,
        rational=True, wraps=True,
        infix=Infix(
            "*", "mul", 6, r"{0} \cdot {1}", "Product.", Brackets(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True)
        ),
    ),
    Operator(
        name="neg", rule=rules.arithmetic, reference=lambda a: -a, samples=((3,), (-2.5,), (0,), (math.nan,)),
        scalar=Scalar("(-{0})"), array=Array("(-{0})"),
        bounds=lambda a, n: (-a[0].high, -a[0].low), linear=rules.every, rational=True, wraps=True,
    ),
    Operator(
        name="div", rule=rules.real, reference=div, samples=PAIRS + ZEROS + NANS,
        scalar=Scalar("({0} / {1} if {1} else div({0}, {1}))", divides="({0} / {1})", names={"div": div}),
        array=Array("({0} / {1})"), kernel=Kernel("({0} / {1})"),
        bounds=rules.quotient, finite=rules.divided, linear=rules.unless_second, rational=True,
        infix=Infix(
            "/", "div", 6, r"\frac{{0}}{{1}}", "Real division; two ints give an exact fraction.",
            Brackets(Level.FACTOR, (Level.SCOPE,), lead=True),
        ),
    ),
    Operator(
        name="floordiv", rule=rules.arithmetic, reference=floordiv,
        samples=PAIRS + ZEROS + NANS[:1],
        scalar=Scalar("({0} // {1} if {1} else 0)", real="floordiv({0}, {1})", divides="({0} // {1})",
                      names={"floordiv": floordiv}),
        array=Array("rt.floordiv({0}, {1})"), kernel=Kernel(real="floordiv_real({0}, {1})", whole="floordiv_int({0}, {1})"),
        bounds=rules.floor_quotient, finite=rules.divided, wraps=True,
        infix=Infix(
            "//", "floordiv", 6, r"\left\lfloor {0} / {1} \right\rfloor", "Division rounded down.",
            Brackets(Level.ATOM, (Level.PRODUCT, Level.FACTOR), lead=True),
        ),
    ),
    Operator(
        name="mod", rule=rules.arithmetic, reference=mod,
        samples=PAIRS + ZEROS + NANS[:1],
        scalar=Scalar("({0} % {1} if {1} else 0)", real="({0} % {1} if {1} else nan)", divides="({0} % {1})"),
        array=Array("rt.mod({0}, {1})"), kernel=Kernel(real="mod_real({0}, {1})", whole="mod_int({0}, {1})"),
        bounds=rules.remainder, finite=rules.divided,
        infix=Infix(
            "%", "mod", 6, r"{0} \bmod {1}", "Remainder, with the sign of the divisor.",
            Brackets(Level.REMAINDER, (Level.FACTOR,)),
        ),
    ),
    Operator(
        name="pow", rule=rules.real, reference=pow_,
        samples=((2.0, 0.5), (-8.0, 3.0), (-8.0, 0.5), (0.0, 0.0), (0.0, -1.0), (10.0, 400.0), (1.5, -2.0), (math.nan, 0.0)),
        scalar=Scalar("pow_({0}, {1})", names={"pow_": pow_}), array=Array("rt.pow({0}, {1})"),
        finite=rules.nowhere, precise=False,
        infix=Infix("**", "pow", 8, "{0}^{{1}}", "Power.", Brackets(Level.POWER, (Level.ATOM, Level.SCOPE))),
    ),
    Operator(
        name="abs", rule=rules.arithmetic, reference=abs, samples=((3,), (-3,), (-2.5,), (math.nan,)),
        scalar=Scalar("abs({0})"), array=Array("xp.abs({0})"),
        kernel=Kernel("abs({0})", whole="select({0} < 0, -{0}, {0})"),
        bounds=rules.magnitude, wraps=True,
        function=Function(
            "abs", ("x",), r"\lvert {0} \rvert", "Absolute value.", ((-3,), (2.5,), (INTS,)), applies("abs")
        ),
    ),
    Operator(
        name="sign", rule=rules.arithmetic, reference=sign,
        samples=((3,), (-3,), (0,), (-2.5,), (0.0,), (math.nan,)),
        scalar=Scalar("sign({0})", names={"sign": sign}), array=Array("rt.sign({0})"),
        kernel=Kernel(real="(f64({0} > 0.0) - f64({0} < 0.0))", whole="(i32({0} > 0) - i32({0} < 0))"),
        bounds=rules.to_int(sign),
        function=Function("sign", ("x",), r"\operatorname{sign}({0})", "-1, 0 or 1.", ((-3,), (0,), (2.5,)), applies("sign")),
    ),
    _extreme("min2", min2, "<=", "minimum", "fmin", min),
    _extreme("max2", max2, ">=", "maximum", "fmax", max),
)  # fmt: skip


# -- rounding, and conversion of conditions and ints --------------------------------------------------------------


def _saturating(function: Callable[[Any], int]) -> Callable[[Any], int]:
    """To the nearest int that every backend holds; nan becomes 0."""

    def saturated(x: Any) -> int:
        if -INT_MAX <= x <= INT_MAX:
            return function(x)
        if x != x:
            return 0
        if x > 0:
            return INT_MAX
        return -INT_MAX

    return saturated


def _rounding(
    name: str, function: Callable[[Any], int], latex: str, doc: str, samples: tuple[tuple[float, ...], ...],
    examples: tuple[tuple[Any, ...], ...], local: str,
) -> Operator:  # fmt: skip
    reference = _saturating(function)
    return Operator(
        name=name, rule=rules.to_integer, promote=rules.as_they_are, reference=reference, samples=samples,
        scalar=Scalar(local + "({0})", names={local: reference}), array=Array(f"rt.to_int(xp.{name}({{0}}))"),
        bounds=rules.to_int(reference), rounds=True, function=Function(name, ("x",), latex, doc, examples, applies(name)),
    )  # fmt: skip


ROUNDING = (
    _rounding("floor", math.floor, r"\lfloor {0} \rfloor", "Rounded down to an int.", REALS, ((2.7,), (-2.1,), (MIXED,)),
              "floor"),
    _rounding("ceil", math.ceil, r"\lceil {0} \rceil", "Rounded up to an int.", REALS, ((2.2,), (-2.9,)), "ceil"),
    _rounding("round", round, r"\operatorname{round}({0})", "Nearest int, halves to even.",
              (*REALS, (0.5,), (1.5,), (-2.5,)), ((2.5,), (-2.6,)), "round_"),
    Operator(
        name="to_int", rule=rules.truth, promote=rules.as_they_are, reference=int, samples=((True,), (False,)),
        scalar=Scalar("(1 if {0} else 0)"), array=Array("rt.as_int({0})"), kernel=Kernel("i32({0})"), bounds=rules.same,
    ),
    Operator(
        name="to_real", rule=rules.real, promote=rules.as_they_are, reference=float,
        samples=((True,), (False,), (3,), (-4,)),
        scalar=Scalar("float({0})"), array=Array("rt.as_real({0})"), kernel=Kernel("f64({0})"), bounds=rules.same,
        linear=rules.every,
    ),
)  # fmt: skip


# -- elementary functions of reals --------------------------------------------------------------------------------


def _total(function: Callable[[float], float]) -> Callable[[float], float]:
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
    if x == 0:
        return -math.inf
    if x > 0:
        return math.log(x)
    return math.nan


def _root(args: Args, node: Any) -> Interval:
    return _real_root(args[0].low), _real_root(args[0].high)


def _real_root(x: float) -> float:
    if x < INF:
        return math.sqrt(max(0.0, x))
    return INF


def _elementary(
    name: str, reference: Callable[[float], float], latex: str, doc: str, array: str | None = None,
    examples: tuple[tuple[float, ...], ...] = ((0.5,), (-2.0,)), brackets: Brackets = ENCLOSED, in_kernels: bool = True,
    **fields: Any,
) -> Operator:  # fmt: skip
    """Entry of a function of one real; kernels take the function of Python's `math`, or their own."""
    template = name + "({0})"
    return Operator(
        name=name, rule=rules.real, reference=reference, samples=(*REALS, *fields.pop("samples", ())),
        scalar=Scalar(template, names={name: reference}), array=Array(array or f"xp.{template}"),
        kernel=Kernel(names=(name,) if in_kernels else ()),
        function=Function(name, ("x",), latex, doc, examples, applies(name), brackets=brackets), **fields,
    )  # fmt: skip


ELEMENTARY = (
    _elementary("sqrt", _total(math.sqrt), r"\sqrt{{0}}", "Square root.", examples=((2.0,), (9,), (-1.0,)), bounds=_root,
                finite=lambda args, value: args[0].finite and args[0].low >= 0),
    _elementary("exp", exp, r"e^{{0}}", "Exponential.", examples=((0.5,), (1000.0,)), samples=((800.0,), (-800.0,)),
                bounds=rules.fixed(0, INF), finite=lambda args, value: args[0].finite and args[0].high < 700,
                precise=False, brackets=Brackets(Level.POWER, (Level.SCOPE,))),
    _elementary("log", log, r"\log({0})", "Natural logarithm.", examples=((0.5,), (0.0,)), precise=False,
                finite=lambda args, value: args[0].finite and args[0].low > 0),
    _elementary("sin", _total(math.sin), r"\sin({0})", "Sine, in radians.", in_kernels=False, bounds=rules.fixed(-1, 1),
                precise=False),
    _elementary("cos", _total(math.cos), r"\cos({0})", "Cosine, in radians.", in_kernels=False, bounds=rules.fixed(-1, 1),
                precise=False),
    _elementary("tan", _total(math.tan), r"\tan({0})", "Tangent, in radians.", finite=rules.nowhere, precise=False),
    _elementary("tanh", math.tanh, r"\tanh({0})", "Hyperbolic tangent.", bounds=rules.fixed(-1, 1), precise=False),
    _elementary("asinh", math.asinh, r"\operatorname{arsinh}({0})", "Inverse hyperbolic sine.", "xp.arcsinh({0})",
                bounds=rules.increasing(math.asinh, ulps=4), precise=False),
    Operator(
        name="atan2", rule=rules.real, reference=math.atan2,
        samples=(*((float(a), float(b)) for a, b in PAIRS), (0.0, 0.0), (1.0, 0.0)),
        scalar=Scalar("atan2({0}, {1})", names={"atan2": math.atan2}), array=Array("xp.arctan2({0}, {1})"),
        kernel=Kernel(names=("atan2",)), bounds=rules.fixed(-math.pi, math.pi), precise=False,
        function=Function(
            "atan2", ("y", "x"), r"\operatorname{atan2}({0}, {1})", "Angle of the point (x, y), in radians.",
            ((0.5, -1.0),), applies("atan2"),
        ),
    ),
)  # fmt: skip


# -- comparisons, conditions, and choices between values -----------------------------------------------------------


def _comparison(
    symbol: str, name: str, reference: Callable[[Any, Any], Any], latex: str, doc: str, equality: bool = False
) -> Operator:
    template = f"({{0}} {symbol} {{1}})"
    least = Kind.BOOL if equality else Kind.INT  # what is ordered is a number
    return Operator(
        name=name, rule=rules.compare, promote=lambda kinds, result: [max(least, *kinds)] * len(kinds),
        reference=lambda a, b: bool(reference(a, b)), samples=PAIRS + NANS + LOGIC * equality,
        scalar=Scalar(template), array=Array(template), elements=Elements.RANKED, commutative=equality,
        infix=Infix(symbol, name, 4, latex, doc),
    )  # fmt: skip


LOGICAL = (
    _comparison("==", "eq", operator.eq, "{0} = {1}", "Equal; comparisons can be chained.", equality=True),
    _comparison("!=", "ne", operator.ne, r"{0} \neq {1}", "Different.", equality=True),
    _comparison("<", "lt", operator.lt, "{0} < {1}", "Less."),
    _comparison("<=", "le", operator.le, r"{0} \leq {1}", "Less or equal."),
    Operator(
        name="not", rule=rules.logical, promote=rules.as_they_are, reference=lambda a: not a,
        samples=((True,), (False,)), scalar=Scalar("(not {0})"), array=Array("xp.logical_not({0})"),
        kernel=Kernel("({0} == False)"),
        infix=Infix("not", "not", 3, r"\lnot {0}", "The condition does not hold.", Brackets(Level.NOT, (Level.ATOM,))),
    ),
    Operator(
        name="and", commutative=True, rule=rules.logical, promote=rules.as_they_are, reference=lambda a, b: bool(a and b),
        samples=LOGIC, scalar=Scalar("({0} and {1})"), array=Array("xp.logical_and({0}, {1})"), kernel=Kernel("({0} & {1})"),
        infix=Infix("and", "and", 2, r"{0} \land {1}", "Both conditions hold.", Brackets(Level.AND, (Level.NOT,))),
    ),
    Operator(
        name="or", commutative=True, rule=rules.logical, promote=rules.as_they_are, reference=lambda a, b: bool(a or b),
        samples=LOGIC, scalar=Scalar("({0} or {1})"), array=Array("xp.logical_or({0}, {1})"), kernel=Kernel("({0} | {1})"),
        # Two different connectives side by side are easier to read with brackets.
        infix=Infix("or", "or", 1, r"{0} \lor {1}", "Either condition holds.", Brackets(Level.OR, (Level.NOT,))),
    ),
    Operator(
        name="where", elements=Elements.MOVED, indices=(0,), rule=rules.choose,
        promote=lambda kinds, result: [kinds[0], result, result],
        reference=lambda condition, a, b: a if condition else b,
        samples=((True, 1, 2), (False, 1, 2), (True, 1.5, -2.0), (False, 1.5, -2.0)),
        scalar=Scalar("({1} if {0} else {2})"), array=Array("xp.where({0}, {1}, {2})"), kernel=Kernel("select({0}, {1}, {2})"),
        bounds=lambda args, node: rules.union(args[1:], node), linear=lambda below: not below[0],
        function=Function(
            "where", ("condition", "x", "y"), r"\begin{cases}{1} & \text{if } {0}\\ {2} & \text{otherwise}\end{cases}",
            "x where the condition holds, else y; element by element.", ((True, 1, 2.5), ((True, False, True), INTS, 0)),
            applies("where"), moved=range(1, 3),
        ),
    ),
)  # fmt: skip

TABLE = (*ARITHMETIC, *ELEMENTARY, *ROUNDING, *LOGICAL)


FUNCTIONS = (
    Function("clip", ("x", "low", "high"), r"\operatorname{clip}({0}, {1}, {2})", "x moved into [low, high].",
             ((5, 0, 3), (-1.5, 0, 3), (MIXED, -1, 1)),
             lambda b, args: b.apply("min2", b.apply("max2", args[0], args[1]), args[2])),
)  # fmt: skip
"""Functions that compose several operators."""
