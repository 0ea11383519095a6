"""Rounding, and conversion of conditions and ints."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taskspec.lang.operators import bounding, linearity
from taskspec.lang.operators.entry import Array, Function, Kernel, Operator, Scalar, applies
from taskspec.lang.operators.samples import MIXED, REALS
from taskspec.lang.operators.signatures import as_they_are, real, to_integer, truth
from taskspec.lang.types import INT_MAX


def _saturating(function: Callable[[Any], int]) -> Callable[[Any], int]:
    """To the nearest int that every backend holds; nan becomes 0."""

    def saturated(x: Any) -> int:
        if -INT_MAX <= x <= INT_MAX:
            return function(x)
        return 0 if x != x else INT_MAX if x > 0 else -INT_MAX

    return saturated


floor, ceil, round_ = _saturating(math.floor), _saturating(math.ceil), _saturating(round)


TABLE = (
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
        linear=linearity.every, whole=True,
    ),
)  # fmt: skip
