"""Elementary functions of reals."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taskspec.lang.operators import bounding
from taskspec.lang.operators.entry import (
    PAIRS,
    REALS,
    Array,
    Brackets,
    Function,
    Kernel,
    Level,
    Operator,
    Scalar,
    applies,
)
from taskspec.lang.operators.signatures import real
from taskspec.lang.types import EVERYTHING, INF, Args, Interval

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


TABLE = (
    Operator(
        name="sqrt", rule=real, reference=sqrt, samples=REALS,
        scalar=Scalar("sqrt({0})", names={"sqrt": sqrt}), array=Array("xp.sqrt({0})"), kernel=Kernel(names=("sqrt",)),
        bounds=_root, finite=lambda args, found: args[0].finite and args[0].low >= 0,
        function=Function("sqrt", ("x",), r"\sqrt{{0}}", "Square root.", ((2.0,), (9,), (-1.0,)), applies("sqrt")),
    ),
    Operator(
        name="exp", rule=real, reference=exp, samples=(*REALS, (800.0,), (-800.0,)),
        scalar=Scalar("exp({0})", names={"exp": exp}), array=Array("xp.exp({0})"), kernel=Kernel(names=("exp",)),
        bounds=bounding.fixed(0, INF), finite=lambda args, found: args[0].finite and args[0].high < 700, precise=False,
        function=Function(
            "exp", ("x",), r"e^{{0}}", "Exponential.", ((0.5,), (1000.0,)), applies("exp"),
            brackets=Brackets(Level.POWER, (Level.SCOPE,)),
        ),
    ),
    Operator(
        name="log", rule=real, reference=log, samples=REALS,
        scalar=Scalar("log({0})", names={"log": log}), array=Array("xp.log({0})"), kernel=Kernel(names=("log",)),
        bounds=bounding.fixed(*EVERYTHING), finite=lambda args, found: args[0].finite and args[0].low > 0, precise=False,
        function=Function("log", ("x",), r"\log({0})", "Natural logarithm.", ((0.5,), (0.0,)), applies("log")),
    ),
    Operator(
        name="sin", rule=real, reference=sin, samples=REALS,
        scalar=Scalar("sin({0})", names={"sin": sin}), array=Array("xp.sin({0})"),
        bounds=bounding.fixed(-1, 1), precise=False,
        function=Function("sin", ("x",), r"\sin({0})", "Sine, in radians.", _PLACES, applies("sin")),
    ),
    Operator(
        name="cos", rule=real, reference=cos, samples=REALS,
        scalar=Scalar("cos({0})", names={"cos": cos}), array=Array("xp.cos({0})"),
        bounds=bounding.fixed(-1, 1), precise=False,
        function=Function("cos", ("x",), r"\cos({0})", "Cosine, in radians.", _PLACES, applies("cos")),
    ),
    Operator(
        name="tan", rule=real, reference=tan, samples=REALS,
        scalar=Scalar("tan({0})", names={"tan": tan}), array=Array("xp.tan({0})"), kernel=Kernel(names=("tan",)),
        finite=bounding.nowhere, precise=False,
        function=Function("tan", ("x",), r"\tan({0})", "Tangent, in radians.", _PLACES, applies("tan")),
    ),
    Operator(
        name="tanh", rule=real, reference=math.tanh, samples=REALS,
        scalar=Scalar("tanh({0})", names={"tanh": math.tanh}), array=Array("xp.tanh({0})"), kernel=Kernel(names=("tanh",)),
        bounds=bounding.fixed(-1, 1), precise=False,
        function=Function("tanh", ("x",), r"\tanh({0})", "Hyperbolic tangent.", _PLACES, applies("tanh")),
    ),
    Operator(
        name="asinh", rule=real, reference=math.asinh, samples=REALS,
        scalar=Scalar("asinh({0})", names={"asinh": math.asinh}), array=Array("xp.arcsinh({0})"),
        kernel=Kernel(names=("asinh",)), bounds=bounding.increasing(math.asinh, ulps=4), precise=False,
        function=Function(
            "asinh", ("x",), r"\operatorname{arsinh}({0})", "Inverse hyperbolic sine.", _PLACES, applies("asinh")
        ),
    ),
    Operator(
        name="atan2", rule=real, reference=math.atan2,
        samples=(*tuple((float(a), float(b)) for a, b in PAIRS), (0.0, 0.0), (1.0, 0.0)),
        scalar=Scalar("atan2({0}, {1})", names={"atan2": math.atan2}), array=Array("xp.arctan2({0}, {1})"),
        kernel=Kernel(names=("atan2",)), bounds=bounding.fixed(-math.pi, math.pi), precise=False,
        function=Function(
            "atan2", ("y", "x"), r"\operatorname{atan2}({0}, {1})", "Angle of the point (x, y), in radians.",
            ((0.5, -1.0),), applies("atan2"),
        ),
    ),
)  # fmt: skip
