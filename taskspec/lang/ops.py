"""The operator table: one entry per operator of the typed core, the single source of everything known about it.

Each entry gives the type rule, an obvious Python reference (what the operator *means*, used by the interpreter),
the lane form (scalar Python, also what Numba compiles), the array form (over a namespace `xp`, batch axis last),
its mathematics, its documentation and sample inputs on which all forms are tested against the reference.

Every operator is total. The awkward points are decided here once, for every backend:
reals follow IEEE 754 (1/0 is inf, 0/0 and sqrt(-1) are nan); an int divided by 0 with `//` or `%` gives 0;
`min`, `max`, `argmin`, `argmax` pass over nan and give the first of equals, 0.0 and -0.0 included; `sort` puts nan last
and takes the sign from zeros, so that their order does not matter; `argsort` is stable; sums begin with the first element;
reals become ints by saturating at +-(2**31 - 1), nan becomes 0. An index is moved into range before it is used
(`Builder.position`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taskspec.lang import reference as ref
from taskspec.lang.types import BOOL, INT, REAL, Kind, Type, join

Rule = Callable[[tuple[Type, ...]], Type | str]
"""Result type from argument types, or a sentence that says what is wrong."""


@dataclass(frozen=True, slots=True)
class Op:
    """One operator of the core.

    `lane` and `array` are templates over `{0}`, `{1}`, ... For an elementwise operator they are scalar
    expressions, applied per element (lanes) or broadcast (arrays). `lane_divides` is the shorter form that holds where the
    second argument is never 0.
    """

    name: str
    rule: Rule
    reference: Callable[..., Any]
    lane: str
    array: str
    doc: str
    samples: tuple[tuple[Any, ...], ...]
    elementwise: bool = True
    lane_divides: str | None = None
    real_lane: str | None = None  # where reals need another form than ints (nan)
    real_array: str | None = None
    array_nonzero: str | None = None  # of reals, where an argument is a constant other than 0: so no 0.0 meets a -0.0


def broadcast(types: tuple[Type, ...]) -> tuple[int, ...] | None:
    """The common shape of elementwise arguments: all equal, scalars stretching; None when they disagree."""
    shapes = {t.shape for t in types if t.shape != ()}
    if len(shapes) > 1:
        return None
    return shapes.pop() if shapes else ()


def _elementwise(kind: Callable[[tuple[Type, ...]], Kind | str]) -> Rule:
    def rule(types: tuple[Type, ...]) -> Type | str:
        shape = broadcast(types)
        if shape is None:
            shapes = " and ".join(str(list(t.shape)) for t in types if t.shape)
            return f"the shapes {shapes} do not match element by element"
        result = kind(types)
        return result if isinstance(result, str) else Type(result, shape)

    return rule


def _arithmetic(types: tuple[Type, ...]) -> Kind:
    return join(Kind.INT, *(t.kind for t in types))


arithmetic = _elementwise(_arithmetic)
real = _elementwise(lambda types: Kind.REAL)
to_integer = _elementwise(lambda types: Kind.INT)
truth = _elementwise(
    lambda types: Kind.INT if types[0].kind is Kind.BOOL else f"a condition is needed, not {_a(types[0])}"
)
compare = _elementwise(lambda types: Kind.BOOL)


def _logical(types: tuple[Type, ...]) -> Kind | str:
    wrong = [t for t in types if t.kind is not Kind.BOOL]
    return f"a condition is needed, not {_a(wrong[0])}" if wrong else Kind.BOOL


def _a(t: Type) -> str:
    return f"an {t}" if str(t)[0] in "aeiou" else f"a {t}"


logical = _elementwise(_logical)


def _choose(types: tuple[Type, ...]) -> Kind | str:
    condition, *branches = types
    if condition.kind is not Kind.BOOL:
        return f"a condition is needed, not {_a(condition)}"
    return join(*(t.kind for t in branches))


choose = _elementwise(_choose)


def _reduction(kind: Callable[[Kind], Kind | str], empty: bool = True) -> Rule:
    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if t.is_scalar:
            return f"a vector is needed, not {_a(t)}"
        if not empty and t.size == 0:
            return "an empty vector has no such element"
        result = kind(t.kind)
        return result if isinstance(result, str) else Type(result)

    return rule


def _need_bool(kind: Kind) -> Kind | str:
    return Kind.BOOL if kind is Kind.BOOL else f"a vector of conditions is needed, not of {kind}s"


def _counted(kind: Kind) -> Kind | str:
    return Kind.INT if kind is Kind.BOOL else f"a vector of conditions is needed, not of {kind}s"


def _number(kind: Kind) -> Kind:
    return join(Kind.INT, kind)


def _vector(kind: Callable[[Kind], Kind]) -> Rule:
    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if len(t.shape) != 1:
            return f"a vector is needed, not {_a(t)}" if t.is_scalar else "a vector is needed, not a matrix"
        return Type(kind(t.kind), t.shape)

    return rule


_PAIRS = (
    (1, 2),
    (-7, 2),
    (7, -2),
    (0, 5),
    (-3, -3),
    (1.5, -0.25),
    (0.0, 3.0),
    (-2.5, 0.75),
    (2, 0.5),
)
_ZEROS = ((1, 0), (0, 0), (-4, 0), (1.0, 0.0), (0.0, 0.0), (-1.0, 0.0))
_NANS = (
    (math.nan, 1.0),
    (1.0, math.nan),
    (math.nan, math.nan),
    (math.inf, 1.0),
    (-math.inf, math.nan),
)
_REALS = (
    (0.0,),
    (0.5,),
    (-1.25,),
    (3.7,),
    (-100.0,),
    (math.inf,),
    (-math.inf,),
    (math.nan,),
    (1e9,),
    (2.5,),
    (-0.5,),
)
_LOGIC = ((True, True), (True, False), (False, True), (False, False))
_VECTORS = (
    ((3, 1, 2),),
    ((1, 1, 0, 1),),
    ((5,),),
    ((2.5, -1.0, 2.5, 0.0),),
    ((-1.0, math.inf, -math.inf),),
)
_NAN_VECTORS = (((math.nan, 1.0, 3.0),), ((1.0, math.nan, 3.0, 3.0),), ((math.nan, math.nan),))
_MASKS = (((True, False, True),), ((False,),), ((True, True),))
_BIG = ((800.0,), (-800.0,))

TABLE: tuple[Op, ...] = (
    # arithmetic
    Op("add", arithmetic, ref.add, "({0} + {1})", "({0} + {1})", "Sum.", _PAIRS + _NANS),
    Op("sub", arithmetic, ref.sub, "({0} - {1})", "({0} - {1})", "Difference.", _PAIRS + _NANS),
    Op("mul", arithmetic, ref.mul, "({0} * {1})", "({0} * {1})", "Product.", _PAIRS + _NANS),
    Op("neg", arithmetic, ref.neg, "(-{0})", "(-{0})", "Negation.", ((3,), (-2.5,), (0,), (math.nan,))),
    Op("div", real, ref.div, "({0} / {1} if {1} else div({0}, {1}))", "({0} / {1})", "Real division, IEEE at zero.",
       _PAIRS + _ZEROS + _NANS, lane_divides="({0} / {1})"),
    Op("floordiv", arithmetic, ref.floordiv, "({0} // {1} if {1} else 0)", "rt.floordiv({0}, {1})",
       "Division rounded down; an int by 0 is 0.", _PAIRS + _ZEROS + _NANS[:1], lane_divides="({0} // {1})",
       real_lane="floordiv({0}, {1})"),
    Op("mod", arithmetic, ref.mod, "({0} % {1} if {1} else 0)", "rt.mod({0}, {1})",
       "Remainder with the sign of the divisor; an int by 0 is 0.", _PAIRS + _ZEROS + _NANS[:1],
       lane_divides="({0} % {1})", real_lane="({0} % {1} if {1} else nan)"),
    Op("pow", real, ref.pow_, "pow_({0}, {1})", "rt.pow({0}, {1})",
       "Power of reals (C's pow; a negative base with a fraction is nan).",
       ((2.0, 0.5), (-8.0, 3.0), (-8.0, 0.5), (0.0, 0.0), (0.0, -1.0), (10.0, 400.0), (1.5, -2.0), (math.nan, 0.0))),
    Op("abs", arithmetic, ref.abs_, "abs({0})", "xp.abs({0})", "Absolute value.", ((3,), (-3,), (-2.5,), (math.nan,))),
    Op("sign", arithmetic, ref.sign, "sign({0})", "rt.sign({0})", "-1, 0 or 1; 0 for nan.",
       ((3,), (-3,), (0,), (-2.5,), (0.0,), (math.nan,))),
    Op("min2", arithmetic, ref.min2, "({0} if {0} <= {1} else {1})", "xp.minimum({0}, {1})", "The smaller of two.",
       _PAIRS + _NANS, real_lane="({0} if {0} <= {1} or {1} != {1} else {1})", real_array="rt.min2({0}, {1})",
       array_nonzero="xp.fmin({0}, {1})"),
    Op("max2", arithmetic, ref.max2, "({0} if {0} >= {1} else {1})", "xp.maximum({0}, {1})", "The larger of two.",
       _PAIRS + _NANS, real_lane="({0} if {0} >= {1} or {1} != {1} else {1})", real_array="rt.max2({0}, {1})",
       array_nonzero="xp.fmax({0}, {1})"),
    # elementary functions
    Op("sqrt", real, ref.sqrt, "sqrt({0})", "xp.sqrt({0})", "Square root; nan below 0.", _REALS),
    Op("exp", real, ref.exp, "exp({0})", "xp.exp({0})", "Exponential; inf on overflow.", _REALS + _BIG),
    Op("log", real, ref.log, "log({0})", "xp.log({0})", "Natural logarithm; -inf at 0, nan below.", _REALS),
    Op("sin", real, ref.sin, "sin({0})", "xp.sin({0})", "Sine (radians); nan at infinity.", _REALS),
    Op("cos", real, ref.cos, "cos({0})", "xp.cos({0})", "Cosine (radians); nan at infinity.", _REALS),
    Op("tan", real, ref.tan, "tan({0})", "xp.tan({0})", "Tangent (radians); nan at infinity.", _REALS),
    Op("tanh", real, ref.tanh, "tanh({0})", "xp.tanh({0})", "Hyperbolic tangent.", _REALS),
    Op("atan2", real, ref.atan2, "atan2({0}, {1})", "xp.arctan2({0}, {1})", "Angle of the point (x, y) as atan2(y, x).",
       (*tuple((float(a), float(b)) for a, b in _PAIRS), (0.0, 0.0), (1.0, 0.0))),
    # rounding and conversion
    Op("floor", to_integer, ref.floor, "floor({0})", "rt.to_int(xp.floor({0}))", "Rounded down, as an int.", _REALS),
    Op("ceil", to_integer, ref.ceil, "ceil({0})", "rt.to_int(xp.ceil({0}))", "Rounded up, as an int.", _REALS),
    Op("round", to_integer, ref.round_, "round_({0})", "rt.to_int(xp.round({0}))",
       "Rounded to the nearest int, halves to even.", (*_REALS, (0.5,), (1.5,), (-2.5,))),
    Op("to_int", truth, ref.to_int, "(1 if {0} else 0)", "rt.as_int({0})", "A condition as 0 or 1.",
       ((True,), (False,))),
    Op("to_real", real, ref.to_real, "float({0})", "rt.as_real({0})", "An int or a condition as a real.",
       ((True,), (False,), (3,), (-4,))),
    # comparison and logic
    Op("eq", compare, ref.eq, "({0} == {1})", "({0} == {1})", "Equal.", _PAIRS + _NANS + _LOGIC),
    Op("ne", compare, ref.ne, "({0} != {1})", "({0} != {1})", "Not equal.", _PAIRS + _NANS + _LOGIC),
    Op("lt", compare, ref.lt, "({0} < {1})", "({0} < {1})", "Less.", _PAIRS + _NANS),
    Op("le", compare, ref.le, "({0} <= {1})", "({0} <= {1})", "Less or equal.", _PAIRS + _NANS),
    Op("not", logical, ref.not_, "(not {0})", "xp.logical_not({0})", "Negation of a condition.", ((True,), (False,))),
    Op("and", logical, ref.and_, "({0} and {1})", "xp.logical_and({0}, {1})", "Both conditions.", _LOGIC),
    Op("or", logical, ref.or_, "({0} or {1})", "xp.logical_or({0}, {1})", "Either condition.", _LOGIC),
    Op("where", choose, ref.where, "({1} if {0} else {2})", "xp.where({0}, {1}, {2})",
       "The second argument where the first holds, else the third.",
       ((True, 1, 2), (False, 1, 2), (True, 1.5, -2.0), (False, 1.5, -2.0))),
    # reductions of all elements
    Op("sum", _reduction(_number), ref.sum_, "sum_({0})", "rt.sum({0})", "Sum of all elements, left to right; 0 if none.",
       _VECTORS, elementwise=False),
    Op("prod", _reduction(_number), ref.prod, "prod({0})", "rt.prod({0})", "Product of all elements; 1 if none.",
       _VECTORS, elementwise=False),
    Op("any", _reduction(_need_bool), ref.any_, "any({0})", "rt.any({0})", "Whether some element holds.", _MASKS,
       elementwise=False),
    Op("all", _reduction(_need_bool), ref.all_, "all({0})", "rt.all({0})", "Whether every element holds.", _MASKS,
       elementwise=False),
    Op("count", _reduction(_counted), ref.sum_, "sum_({0})", "rt.count({0})", "How many elements hold.", _MASKS,
       elementwise=False),
    Op("min", _reduction(_number, empty=False), ref.min_, "min_({0})", "rt.min({0})", "Smallest element.",
       _VECTORS + _NAN_VECTORS, elementwise=False),
    Op("max", _reduction(_number, empty=False), ref.max_, "max_({0})", "rt.max({0})", "Largest element.",
       _VECTORS + _NAN_VECTORS, elementwise=False),
    Op("argmin", _reduction(lambda k: Kind.INT, empty=False), ref.argmin, "argmin({0})", "rt.argmin({0})",
       "Index of the smallest element, the first of equals.", _VECTORS + _NAN_VECTORS, elementwise=False),
    Op("argmax", _reduction(lambda k: Kind.INT, empty=False), ref.argmax, "argmax({0})", "rt.argmax({0})",
       "Index of the largest element, the first of equals.", _VECTORS + _NAN_VECTORS, elementwise=False),
    # vectors to vectors
    Op("sort", _vector(lambda k: k), ref.sort, "sort({0})", "rt.sort({0})", "Elements in ascending order.",
       _VECTORS + _NAN_VECTORS, elementwise=False),
    Op("argsort", _vector(lambda k: Kind.INT), ref.argsort, "argsort({0})", "rt.argsort({0})",
       "Indices that sort the vector, stably.", _VECTORS + _NAN_VECTORS, elementwise=False),
    Op("cumsum", _vector(_number), ref.cumsum, "cumsum({0})", "rt.cumsum({0})", "Running sums.", _VECTORS,
       elementwise=False),
)  # fmt: skip

OPS: dict[str, Op] = {op.name: op for op in TABLE}
"""Operators with a type rule on argument types alone, by name. Structure (vectors, indexing) is in `lang.structure`."""

__all__ = ["BOOL", "INT", "OPS", "REAL", "TABLE", "Op", "broadcast"]
