"""What becomes of all elements of a vector together: sums, counts, extremes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from taskspec.lang.ir import Node
from taskspec.lang.operators import bounding, signatures
from taskspec.lang.operators.entry import (
    INTS,
    MASKS,
    MIXED,
    NAN_VECTORS,
    VECTORS,
    Array,
    Brackets,
    Build,
    Elements,
    Function,
    Level,
    NodeMaker,
    Operator,
    Scalar,
    applies,
    no_axes,
)
from taskspec.lang.operators.signatures import as_they_are, conditions, number, reduction
from taskspec.lang.types import Kind

Number = Any
Vector = Sequence[Number]


def sum_(x: Vector) -> Number:
    return reduce(lambda a, b: a + b, x) if x else 0


def _best(better: Callable[[Number, Number], bool], x: Vector) -> int:
    """Index of the best element, the first of equals; nan never beats anything and loses to everything."""
    best = 0
    for i, value in enumerate(x):
        if better(value, x[best]) or (x[best] != x[best] and value == value):
            best = i
    return best


def argmin(x: Vector) -> int:
    return _best(lambda a, b: a < b, x)


def argmax(x: Vector) -> int:
    return _best(lambda a, b: a > b, x)


def min_(x: Vector) -> Number:
    return x[argmin(x)]


def max_(x: Vector) -> Number:
    return x[argmax(x)]


def _extreme(two: str, many: str) -> Build:
    """Of the arguments one after the other, or of the elements of a single one."""

    def build(b: NodeMaker, args: list[Node]) -> Node:
        if len(args) == 1:
            return b.apply(many, args[0])
        result = args[0]
        for arg in args[1:]:
            result = b.apply(two, result, arg)
        return result

    return build


def _of_several(axes: Sequence[int]) -> int:
    """Of one vector the best element, of several arguments the better ones element by element."""
    return 0 if len(axes) == 1 else max(axes)


_BIG = Brackets(Level.BIG, (Level.BIG,))
_QUANTIFIED = Brackets(Level.SCOPE, (Level.ATOM,))
_SEVERAL = ((3, 2), (1.5, -2, 4), (INTS,), (MIXED,))

TABLE = (
    Operator(
        name="sum", rule=reduction(number), from_count=lambda b, total, size: total,
        reference=sum_,
        samples=VECTORS, elementwise=False,
        scalar=Scalar("sum_({0})", chain=(" + ", "0"), names={"sum_": sum_}), array=Array("rt.sum({0})"),
        bounds=bounding.total, finite=bounding.bounded, linear=signatures.every, whole=True, wraps=True,
        function=Function("sum", ("x",), r"\textstyle\sum {0}", "Sum of all elements.", ((INTS,), (MIXED,), ((True, False),)),
                          applies("sum"), brackets=_BIG, axes=no_axes, whole=True),
    ),
    Operator(
        name="prod", rule=reduction(number), reference=math.prod,
        samples=VECTORS, elementwise=False,
        scalar=Scalar("prod({0})", chain=(" * ", "1"), names={"prod": math.prod}), array=Array("rt.prod({0})"),
        bounds=bounding.power, finite=bounding.bounded, whole=True, wraps=True,
        function=Function("prod", ("x",), r"\textstyle\prod {0}", "Product of all elements.", ((INTS,), (MIXED,)),
                          applies("prod"), brackets=_BIG, axes=no_axes, whole=True),
    ),
    Operator(
        name="any", rule=reduction(conditions(Kind.BOOL)), from_count=lambda b, total, size: b.apply("lt", b.scalar(0), total),
        promote=as_they_are, reference=any,
        samples=MASKS, elementwise=False,
        scalar=Scalar("any({0})", chain=(" or ", "False")), array=Array("rt.any({0})"),
        function=Function("any", ("x",), r"\exists\,{0}", "Whether any element is true.", (((True, False),),), applies("any"),
                          brackets=_QUANTIFIED, axes=no_axes, whole=True),
    ),
    Operator(
        name="all", rule=reduction(conditions(Kind.BOOL)), from_count=lambda b, total, size: b.apply("eq", total, b.scalar(size)),
        promote=as_they_are, reference=all,
        samples=MASKS, elementwise=False,
        scalar=Scalar("all({0})", chain=(" and ", "True")), array=Array("rt.all({0})"),
        function=Function("all", ("x",), r"\forall\,{0}", "Whether all elements are true.", (((True, False),), ((True, True),)),
                          applies("all"), brackets=_QUANTIFIED, axes=no_axes, whole=True),
    ),
    Operator(
        name="count", rule=reduction(conditions(Kind.INT)), from_count=lambda b, total, size: total,
        promote=as_they_are, reference=sum_,
        samples=MASKS, elementwise=False,
        scalar=Scalar("sum_({0})", chain=(" + ", "0")), array=Array("rt.count({0})"),
        bounds=lambda args, node: (0, node.args[0].type.size),
        function=Function("count", ("x",), r"\#\{{0}\}", "Number of true elements.", (((True, False, True),),), applies("count"),
                          axes=no_axes, whole=True),
    ),
    Operator(
        name="min", elements=Elements.CHOSEN, rule=reduction(number, empty=False), reference=min_,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("min_({0})", whole="min({0})", names={"min_": min_}), array=Array("rt.min({0})"),
        bounds=bounding.same, whole=True,
        function=Function("min", ("x", "*rest"), r"\min({*})", "Smallest of the arguments, or of one vector's elements.",
                          _SEVERAL, _extreme("min2", "min"), axes=_of_several),
    ),
    Operator(
        name="max", elements=Elements.CHOSEN, rule=reduction(number, empty=False), reference=max_,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("max_({0})", whole="max({0})", names={"max_": max_}), array=Array("rt.max({0})"),
        bounds=bounding.same, whole=True,
        function=Function("max", ("x", "*rest"), r"\max({*})", "Largest of the arguments, or of one vector's elements.",
                          _SEVERAL, _extreme("max2", "max"), axes=_of_several),
    ),
    Operator(
        name="argmin", elements=Elements.RANKED, rule=reduction(lambda k: Kind.INT, empty=False), reference=argmin,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("argmin({0})", names={"argmin": argmin}), array=Array("rt.argmin({0})"), bounds=bounding.place,
        function=Function("argmin", ("x",), r"\operatorname{arg\,min}({0})",
                          "Index of the smallest element, the first of equals.", ((INTS,), ((1, 0, 0),)), applies("argmin"),
                          axes=no_axes, whole=True),
    ),
    Operator(
        name="argmax", elements=Elements.RANKED, rule=reduction(lambda k: Kind.INT, empty=False), reference=argmax,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("argmax({0})", names={"argmax": argmax}), array=Array("rt.argmax({0})"), bounds=bounding.place,
        function=Function("argmax", ("x",), r"\operatorname{arg\,max}({0})",
                          "Index of the largest element, the first of equals.", ((INTS,), ((0, 1, 1),)), applies("argmax"),
                          axes=no_axes, whole=True),
    ),
)  # fmt: skip
