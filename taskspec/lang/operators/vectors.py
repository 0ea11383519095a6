"""Vectors to vectors of the same length."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

from taskspec.lang.operators import bounding
from taskspec.lang.operators.entry import Array, Function, Operator, Scalar, applies, of_first
from taskspec.lang.operators.samples import INTS, MIXED, NAN_VECTORS, VECTORS
from taskspec.lang.operators.signatures import as_they_are, number, vector
from taskspec.lang.types import Kind

Vector = Sequence[Any]


def sort(x: Vector) -> list[Any]:
    """Of reals, with nan last and zeros without a sign."""
    return [x[i] or abs(x[i]) for i in argsort(x)]


def argsort(x: Vector) -> list[int]:
    return sorted(range(len(x)), key=lambda i: (x[i] != x[i], 0 if x[i] != x[i] else x[i]))


def cumsum(x: Vector) -> list[Any]:
    return list(accumulate(x))


def _quick_sort(x: Vector) -> list[Any]:
    ordered = sorted(v + 0.0 for v in x)
    return sort(x) if any(v != v for v in ordered) else ordered


def _quick_argsort(x: Vector) -> list[int]:
    return argsort(x) if any(v != v for v in x) else sorted(range(len(x)), key=x.__getitem__)


TABLE = (
    Operator(
        name="sort", rule=vector(lambda k: k), promote=as_they_are, reference=sort,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("sort({0})", whole="sorted({0})", names={"sort": _quick_sort}), array=Array("rt.sort({0})"),
        bounds=bounding.same, whole=True,
        function=Function("sort", ("x",), r"\operatorname{sort}({0})", "Elements in ascending order.", ((INTS,), (MIXED,)),
                          applies("sort"), axes=of_first, whole=True),
    ),
    Operator(
        name="argsort", rule=vector(lambda k: Kind.INT), promote=as_they_are, reference=argsort,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("argsort({0})", names={"argsort": _quick_argsort}), array=Array("rt.argsort({0})"), bounds=bounding.place,
        function=Function("argsort", ("x",), r"\operatorname{argsort}({0})", "Indices that sort the vector.",
                          ((INTS,), (MIXED,), ((1, 0, 1, 0),)), applies("argsort"), axes=of_first, whole=True),
    ),
    Operator(
        name="cumsum", rule=vector(number), reference=cumsum, samples=VECTORS, elementwise=False,
        scalar=Scalar("cumsum({0})", names={"cumsum": cumsum}), array=Array("rt.cumsum({0})"),
        bounds=bounding.running, finite=bounding.bounded, whole=True, wraps=True,
        function=Function("cumsum", ("x",), r"\operatorname{cumsum}({0})", "Running sums.", ((INTS,), (MIXED,)),
                          applies("cumsum"), axes=of_first, whole=True),
    ),
)  # fmt: skip
