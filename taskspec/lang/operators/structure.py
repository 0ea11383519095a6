"""Operators that move elements: building, slicing and indexing vectors, and vectors to vectors.

Their result type follows from static arguments as well, so they have a reference on tuples here, and each backend
arranges elements in its own way. `index`, `put` and `swap` take indices that are in range (`Builder.position`).
Vectors are nested by rows; flat tuples are row-major.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any, ClassVar

from taskspec.base.records import dataclass
from taskspec.lang.ir import Apply
from taskspec.lang.operators import bounding, signatures
from taskspec.lang.operators.entry import (
    INTS,
    MIXED,
    NAN_VECTORS,
    VECTORS,
    Array,
    Elements,
    Function,
    Linear,
    Operator,
    Scalar,
    applies,
    never,
    of_first,
    stays_finite,
)
from taskspec.lang.operators.signatures import as_they_are, number, vector
from taskspec.lang.types import Args, Interval, Kind, Type, join

Flat = tuple[Any, ...]


def strided(shape: tuple[int, ...]) -> int:
    """Return elements a step along the first axis."""
    size = 1
    for n in shape[1:]:
        size *= n
    return size


@dataclass(frozen=True, slots=True)
class Structure:
    """One operator: result type from argument types and static values; reference on flat row-major tuples.

    `samples` are arguments (numbers, or tuples nested by rows) and static values on which every form is tested. The other fields
    are those of `Operator`; `commutative` is about the `indices`.
    """

    name: str
    rule: Callable[[tuple[Type, ...], tuple[int, ...]], Type]
    reference: Callable[[Sequence[Flat], tuple[Type, ...], tuple[int, ...]], Flat]
    samples: tuple[tuple[tuple[Any, ...], tuple[int, ...]], ...]
    bounds: Callable[[Args, Apply], Interval] = bounding.same
    linear: Linear = signatures.every
    indices: tuple[int, ...] = ()
    commutative: bool = False
    elements: ClassVar[Elements] = Elements.MOVED
    whole: ClassVar[bool] = True
    wraps: ClassVar[bool] = False
    rounds: ClassVar[bool] = False
    from_count: ClassVar[None] = None

    def finite(self, args: Args, found: Interval) -> bool:
        """Return whether every element is a finite number."""
        return stays_finite(args, found)


def _row(flat: Flat, shape: tuple[int, ...], i: int) -> Flat:
    step = strided(shape)
    return flat[i * step : (i + 1) * step]


def _rows(flat: Flat, shape: tuple[int, ...]) -> list[Flat]:
    step = strided(shape)
    return [flat[i * step : (i + 1) * step] for i in range(shape[0])]


def _join(rows: Sequence[Flat]) -> Flat:
    return tuple(value for row in rows for value in row)


def _vector_type(types: tuple[Type, ...], static: tuple[int, ...]) -> Type:
    return Type(join(*(t.kind for t in types)), (len(types), *types[0].shape))


def _concat_type(types: tuple[Type, ...], static: tuple[int, ...]) -> Type:
    return Type(join(*(t.kind for t in types)), (sum(t.shape[0] for t in types), *types[0].shape[1:]))


def _slice(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    start, count, step = static
    rows = _rows(args[0], types[0].shape)
    return _join([rows[start + k * step] for k in range(count)])


def _index(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    return _join([_row(args[0], types[0].shape, i) for i in args[1]])


def _index_type(types: tuple[Type, ...], static: tuple[int, ...]) -> Type:
    return Type(types[0].kind, types[1].shape + types[0].shape[1:])


def _put(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    rows = _rows(args[0], types[0].shape)
    rows[args[1][0]] = args[2]
    return _join(rows)


def _put_type(types: tuple[Type, ...], static: tuple[int, ...]) -> Type:
    return Type(join(types[0].kind, types[2].kind), types[0].shape)


def _swap(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    rows = _rows(args[0], types[0].shape)
    i = args[1][0]
    j = args[2][0]
    rows[i], rows[j] = rows[j], rows[i]
    return _join(rows)


_V = (3, -1, 2, 7)
_R = (0.5, -2.0, math.nan, 1.5)
_M = ((1, 2), (3, 4), (5, 6))
_LONG = tuple(range(40, 0, -2))
_WIDE = tuple(tuple(range(i, i + 20)) for i in range(3))

STRUCTURES: dict[str, Structure] = {
    entry.name: entry
    for entry in (
        # Arguments of one shape, stacked.
        Structure("vector", _vector_type, lambda a, t, s: _join(a),
                  (((1, 2, 3), ()), ((_V, _R), ()), ((_M, _M), ()), ((_LONG, _LONG), ()), ((True, 0.5), ())),
                  bounding.union),
        # Arguments laid end to end.
        Structure("concat", _concat_type, lambda a, t, s: _join(a),
                  (((_V, (9,)), ()), ((_M, _M), ()), ((_R, _LONG), ()), ((_LONG, _V), ())), bounding.union),
        # Static (start, count, step) along the first axis.
        Structure(
            "slice", lambda t, s: Type(t[0].kind, (s[1], *t[0].shape[1:])), _slice,
            (((_V,), (1, 2, 1)), ((_V,), (3, 4, -1)), ((_M,), (2, 2, -2)), ((_LONG,), (0, 7, 3)), ((_LONG,), (19, 20, -1)),
             ((_WIDE,), (2, 3, -1)), ((_WIDE,), (1, 2, 1))),
        ),
        # Static (index,) along the first axis.
        Structure(
            "element", lambda t, s: Type(t[0].kind, t[0].shape[1:]),
            lambda a, t, s: _row(a[0], t[0].shape, s[0]),
            (((_V,), (2,)), ((_M,), (1,)), ((_LONG,), (19,)), ((_WIDE,), (2,))),
        ),
        # The same elements, in shape `static`.
        Structure("reshape", lambda t, s: Type(t[0].kind, s), lambda a, t, s: a[0],
                  (((_V,), (2, 2)), ((_M,), (6,)), ((_LONG,), (5, 4)), ((2.5,), (1,)))),
        # A scalar repeated in shape `static`.
        Structure(
            "fill", lambda t, s: Type(t[0].kind, s), lambda a, t, s: a[0] * Type(Kind.INT, s).size,
            (((2,), (3,)), ((math.nan,), (2, 2)), ((True,), (30,))),
        ),
        # Rows of the first argument at the indices of the second.
        Structure("index", _index_type, _index,
                  (((_V, 3), ()), ((_R, 2), ()), ((_M, 1), ()), ((_V, (3, 0, 0)), ()), ((_M, (2, 0)), ()), ((_LONG, 19), ()),
                   ((_LONG, (1, 19)), ()), ((_WIDE, 2), ()), ((_WIDE, (0, 2)), ()), ((_LONG, tuple(range(20))), ())),
                  linear=signatures.unless_second, indices=(1,)),
        # The vector with the element at an index replaced.
        Structure("put", _put_type, _put,
                  (((_V, 1, 9), ()), ((_R, 0, math.nan), ()), ((_M, 2, (8, 9)), ()), ((_LONG, 19, -1), ()),
                   ((_WIDE, 1, _LONG), ())), lambda args, node: bounding.union((args[0], args[2]), node), never,
                  indices=(1,)),
        # The vector with two elements exchanged.
        Structure("swap", lambda t, s: t[0], _swap,
                  (((_V, 0, 3), ()), ((_R, 1, 1), ()), ((_M, 0, 2), ()), ((_LONG, 19, 0), ()), ((_WIDE, 0, 2), ())),
                  linear=never, indices=(1, 2), commutative=True),
    )
}  # fmt: skip


# Vectors to vectors of the same length.

Vector = Sequence[Any]


def sort(x: Vector) -> list[Any]:
    """Sort reals, with nan last and zeros without a sign."""
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
        name="sort", elements=Elements.CHOSEN, rule=vector(lambda k: k), promote=as_they_are, reference=sort,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar("sort({0})", whole="sorted({0})", names={"sort": _quick_sort}), array=Array("rt.sort({0})"),
        bounds=bounding.same, whole=True,
        function=Function("sort", ("x",), r"\operatorname{sort}({0})", "Elements in ascending order.", ((INTS,), (MIXED,)),
                          applies("sort"), axes=of_first, whole=True),
    ),
    Operator(
        name="argsort", elements=Elements.RANKED, rule=vector(lambda k: Kind.INT), promote=as_they_are, reference=argsort,
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
