"""Operators that move, order or reduce elements, and functions that compose several operators."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate, chain
from typing import Any

from taskspec.base.named import entries_by_name
from taskspec.language.expressions.ir import Apply, Const, Node
from taskspec.language.expressions.operators import rules
from taskspec.language.expressions.operators.entry import (
    ENCLOSED,
    INTS,
    MASKS,
    MIXED,
    NAN_VECTORS,
    ROWS,
    VECTORS,
    Array,
    Axes,
    Brackets,
    Build,
    Elements,
    Function,
    Infix,
    Level,
    Linear,
    NodeMaker,
    Operator,
    OperatorEntry,
    Scalar,
    applies,
    no_axes,
    of_first,
)
from taskspec.language.expressions.operators.rules import as_they_are, conditions, number, reduction, vector
from taskspec.language.expressions.types import INT, Args, Interval, Kind, Refused, Type, join

# -- operators that move elements ---------------------------------------------------------------------------------
#
# Their result type follows from static arguments as well, so they have a reference on tuples here, and each backend
# arranges elements in its own way. `index`, `put` and `swap` take indices that are in range (`Builder.position`).
# Vectors are nested by rows; flat tuples are row-major.

Flat = tuple[Any, ...]


def strided(shape: tuple[int, ...]) -> int:
    """Count the elements of a step along the first axis."""
    return math.prod(shape[1:])


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure(OperatorEntry):
    """One operator whose result type follows from static values as well; its reference is on flat row-major tuples.

    `samples` are arguments (numbers, or tuples nested by rows) and static values.
    """

    rule: Callable[[tuple[Type, ...], tuple[int, ...]], Type]
    reference: Callable[[Sequence[Flat], tuple[Type, ...], tuple[int, ...]], Flat]
    bounds: Callable[[Args, Apply], Interval] = rules.same
    linear: Linear = rules.every
    elements: Elements = Elements.MOVED


def _rows(flat: Flat, shape: tuple[int, ...], indices: Iterable[int] | None = None) -> list[Flat]:
    step = strided(shape)
    chosen = range(shape[0]) if indices is None else indices
    return [flat[i * step : (i + 1) * step] for i in chosen]


def _join(rows: Sequence[Flat]) -> Flat:
    return tuple(chain.from_iterable(rows))


def _concat_type(types: tuple[Type, ...], static: tuple[int, ...]) -> Type:
    return Type(join(*(t.kind for t in types)), (sum(t.shape[0] for t in types), *types[0].shape[1:]))


def _slice(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    start, count, step = static
    return _join(_rows(args[0], types[0].shape, (start + k * step for k in range(count))))


def _index(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    return _join(_rows(args[0], types[0].shape, args[1]))


def _put_row(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
    rows = _rows(args[0], types[0].shape)
    rows[args[1][0]] = args[2]
    return _join(rows)


def _swap_rows(args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...]) -> Flat:
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

STRUCTURES: dict[str, Structure] = entries_by_name((
    # Arguments of one shape, stacked.
    Structure(
        name="vector", rule=lambda t, s: Type(join(*(x.kind for x in t)), (len(t), *t[0].shape)),
        reference=lambda a, t, s: _join(a), bounds=rules.union,
        samples=(((1, 2, 3), ()), ((_V, _R), ()), ((_M, _M), ()), ((_LONG, _LONG), ()), ((True, 0.5), ())),
    ),
    # Arguments laid end to end.
    Structure(
        name="concat", rule=_concat_type, reference=lambda a, t, s: _join(a), bounds=rules.union,
        samples=(((_V, (9,)), ()), ((_M, _M), ()), ((_R, _LONG), ()), ((_LONG, _V), ())),
    ),
    # Static (start, count, step) along the first axis.
    Structure(
        name="slice", rule=lambda t, s: Type(t[0].kind, (s[1], *t[0].shape[1:])), reference=_slice,
        samples=(((_V,), (1, 2, 1)), ((_V,), (3, 4, -1)), ((_M,), (2, 2, -2)), ((_LONG,), (0, 7, 3)), ((_LONG,), (19, 20, -1)),
                 ((_WIDE,), (2, 3, -1)), ((_WIDE,), (1, 2, 1))),
    ),
    # Static (index,) along the first axis.
    Structure(
        name="element", rule=lambda t, s: Type(t[0].kind, t[0].shape[1:]),
        reference=lambda a, t, s: _rows(a[0], t[0].shape)[s[0]],
        samples=(((_V,), (2,)), ((_M,), (1,)), ((_LONG,), (19,)), ((_WIDE,), (2,))),
    ),
    # The same elements, in shape `static`.
    Structure(
        name="reshape", rule=lambda t, s: Type(t[0].kind, s), reference=lambda a, t, s: a[0],
        samples=(((_V,), (2, 2)), ((_M,), (6,)), ((_LONG,), (5, 4)), ((2.5,), (1,))),
    ),
    # A scalar repeated in shape `static`.
    Structure(
        name="fill", rule=lambda t, s: Type(t[0].kind, s), reference=lambda a, t, s: a[0] * Type(Kind.INT, s).size,
        samples=(((2,), (3,)), ((math.nan,), (2, 2)), ((True,), (30,))),
    ),
    # Rows of the first argument at the indices of the second.
    Structure(
        name="index", rule=lambda t, s: Type(t[0].kind, t[1].shape + t[0].shape[1:]), reference=_index,
        linear=rules.unless_second, indices=(1,),
        samples=(((_V, 3), ()), ((_R, 2), ()), ((_M, 1), ()), ((_V, (3, 0, 0)), ()), ((_M, (2, 0)), ()), ((_LONG, 19), ()),
                 ((_LONG, (1, 19)), ()), ((_WIDE, 2), ()), ((_WIDE, (0, 2)), ()), ((_LONG, tuple(range(20))), ())),
    ),
    # The vector with the element at an index replaced.
    Structure(
        name="put", rule=lambda t, s: Type(join(t[0].kind, t[2].kind), t[0].shape), reference=_put_row,
        bounds=lambda args, node: rules.union((args[0], args[2]), node), linear=rules.never, indices=(1,),
        samples=(((_V, 1, 9), ()), ((_R, 0, math.nan), ()), ((_M, 2, (8, 9)), ()), ((_LONG, 19, -1), ()),
                 ((_WIDE, 1, _LONG), ())),
    ),
    # The vector with two elements exchanged.
    Structure(
        name="swap", rule=lambda t, s: t[0], reference=_swap_rows, linear=rules.never, indices=(1, 2), commutative=True,
        samples=(((_V, 0, 3), ()), ((_R, 1, 1), ()), ((_M, 0, 2), ()), ((_LONG, 19, 0), ()), ((_WIDE, 0, 2), ())),
    ),
))  # fmt: skip


# Vectors to vectors of the same length.


def sort(x: Vector) -> list[Any]:
    """Sort reals, with nan last and zeros without a sign."""
    return [x[i] or abs(x[i]) for i in argsort(x)]


def argsort(x: Vector) -> list[int]:
    return sorted(range(len(x)), key=lambda i: (x[i] != x[i], 0 if x[i] != x[i] else x[i]))


def _quick_sort(x: Vector) -> list[Any]:
    ordered = sorted(v + 0.0 for v in x)
    if any(v != v for v in ordered):
        return sort(x)
    return ordered


def _quick_argsort(x: Vector) -> list[int]:
    if any(v != v for v in x):
        return argsort(x)
    return sorted(range(len(x)), key=x.__getitem__)


# -- reductions, and vectors to vectors ---------------------------------------------------------------------------

Number = Any
Vector = Sequence[Number]


def sum_(x: Vector) -> Number:
    if x:
        return reduce(lambda a, b: a + b, x)
    return 0


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
    """Reduce the arguments one after the other, or the elements of a single one."""

    def build(b: NodeMaker, args: list[Node]) -> Node:
        if len(args) == 1:
            return b.apply(many, args[0])
        result = args[0]
        for arg in args[1:]:
            result = b.apply(two, result, arg)
        return result

    return build


def _of_several(axes: Sequence[int]) -> int:
    if len(axes) == 1:
        return 0
    return max(axes)


_BIG = Brackets(Level.BIG, (Level.BIG,))
_QUANTIFIED = Brackets(Level.SCOPE, (Level.ATOM,))


def _whole_vector(
    name: str, latex: str, doc: str, examples: tuple[tuple[Any, ...], ...], scalar: Scalar | None = None,
    axes: Axes = no_axes, brackets: Brackets = ENCLOSED, **fields: Any,
) -> Operator:  # fmt: skip
    fields.setdefault("samples", VECTORS)
    return Operator(
        name=name, elementwise=False, scalar=scalar or Scalar(name + "({0})", names={name: fields["reference"]}),
        array=Array(f"rt.{name}({{0}})"), **fields,
        function=Function(name, ("x",), latex, doc, examples, applies(name), axes=axes, brackets=brackets, whole=True),
    )  # fmt: skip


def _extreme_of(name: str, reference: Callable[[Vector], Number], doc: str) -> Operator:
    return Operator(
        name=name, elements=Elements.CHOSEN, rule=reduction(number, empty=False), reference=reference,
        samples=VECTORS + NAN_VECTORS, elementwise=False,
        scalar=Scalar(f"{name}_({{0}})", whole=f"{name}({{0}})", names={f"{name}_": reference}),
        array=Array(f"rt.{name}({{0}})"), bounds=rules.same,
        function=Function(name, ("x", "*rest"), rf"\{name}({{*}})", doc, ((3, 2), (1.5, -2, 4), (INTS,), (MIXED,)),
                          _extreme(f"{name}2", name), axes=_of_several),
    )  # fmt: skip


REDUCTIONS = (
    _whole_vector("sum", r"\textstyle\sum {0}", "Sum of all elements.", ((INTS,), (MIXED,), ((True, False),)),
                  Scalar("sum_({0})", chain=(" + ", "0"), names={"sum_": sum_}), rule=reduction(number), reference=sum_,
                  from_count=lambda b, total, size: total, bounds=rules.total, finite=rules.bounded, linear=rules.every,
                  wraps=True, brackets=_BIG),
    _whole_vector("prod", r"\textstyle\prod {0}", "Product of all elements.", ((INTS,), (MIXED,)),
                  Scalar("prod({0})", chain=(" * ", "1"), names={"prod": math.prod}), rule=reduction(number),
                  reference=math.prod, bounds=rules.power, finite=rules.bounded, wraps=True, brackets=_BIG),
    _whole_vector("any", r"\exists\,{0}", "Whether any element is true.", (((True, False),),),
                  Scalar("any({0})", chain=(" or ", "False")), rule=reduction(conditions(Kind.BOOL)), reference=any,
                  from_count=lambda b, total, size: b.apply("lt", b.scalar(0), total), promote=as_they_are, samples=MASKS,
                  brackets=_QUANTIFIED),
    _whole_vector("all", r"\forall\,{0}", "Whether all elements are true.", (((True, False),), ((True, True),)),
                  Scalar("all({0})", chain=(" and ", "True")), rule=reduction(conditions(Kind.BOOL)), reference=all,
                  from_count=lambda b, total, size: b.apply("eq", total, b.scalar(size)), promote=as_they_are, samples=MASKS,
                  brackets=_QUANTIFIED),
    _whole_vector("count", r"\#\{{0}\}", "Number of true elements.", (((True, False, True),),),
                  Scalar("sum_({0})", chain=(" + ", "0")), rule=reduction(conditions(Kind.INT)), reference=sum_,
                  from_count=lambda b, total, size: total, promote=as_they_are, samples=MASKS,
                  bounds=lambda args, node: (0, node.args[0].type.size)),
    _extreme_of("min", min_, "Smallest of the arguments, or of one vector's elements."),
    _extreme_of("max", max_, "Largest of the arguments, or of one vector's elements."),
    _whole_vector("argmin", r"\operatorname{arg\,min}({0})", "Index of the smallest element, the first of equals.",
                  ((INTS,), ((1, 0, 0),)), rule=reduction(lambda k: Kind.INT, empty=False), reference=argmin,
                  samples=VECTORS + NAN_VECTORS, elements=Elements.RANKED, bounds=rules.place),
    _whole_vector("argmax", r"\operatorname{arg\,max}({0})", "Index of the largest element, the first of equals.",
                  ((INTS,), ((0, 1, 1),)), rule=reduction(lambda k: Kind.INT, empty=False), reference=argmax,
                  samples=VECTORS + NAN_VECTORS, elements=Elements.RANKED, bounds=rules.place),
)  # fmt: skip

SORTING = (
    _whole_vector("sort", r"\operatorname{sort}({0})", "Elements in ascending order.", ((INTS,), (MIXED,)),
                  Scalar("sort({0})", whole="sorted({0})", names={"sort": _quick_sort}), of_first, rule=vector(lambda k: k),
                  promote=as_they_are, reference=sort, samples=VECTORS + NAN_VECTORS, elements=Elements.CHOSEN,
                  bounds=rules.same),
    _whole_vector("argsort", r"\operatorname{argsort}({0})", "Indices that sort the vector.",
                  ((INTS,), (MIXED,), ((1, 0, 1, 0),)), Scalar("argsort({0})", names={"argsort": _quick_argsort}), of_first,
                  rule=vector(lambda k: Kind.INT), promote=as_they_are, reference=argsort, samples=VECTORS + NAN_VECTORS,
                  elements=Elements.RANKED, bounds=rules.place),
    _whole_vector("cumsum", r"\operatorname{cumsum}({0})", "Running sums.", ((INTS,), (MIXED,)), axes=of_first,
                  rule=vector(number), reference=lambda x: list(accumulate(x)), bounds=rules.running,
                  finite=rules.bounded, wraps=True),
)  # fmt: skip


# -- functions that compose several operators ---------------------------------------------------------------------


def _product(b: NodeMaker, args: list[Node]) -> Node:
    """Multiply: two vectors give a number, a matrix and a vector a vector, two matrices a matrix."""
    x, y = args
    if not all(1 <= len(a.type.shape) <= 2 for a in args):
        wrong = next(a for a in args if not 1 <= len(a.type.shape) <= 2)
        raise Refused(f"`dot` needs vectors or matrices, not {wrong.type}")
    if x.type.shape[-1] != y.type.shape[0]:
        shapes = " and ".join(str(list(a.type.shape)) for a in args)
        raise Refused(f"`dot` needs rows as long as columns: the shapes {shapes} do not match", "E307")
    rows = [x]
    if len(x.type.shape) == 2:
        rows = [b.structure("element", [x], (i,)) for i in range(x.type.shape[0])]
    columns = [y]
    if len(y.type.shape) == 2:
        height, width = y.type.shape
        flat = b.structure("reshape", [y], (height * width,))
        columns = [b.structure("slice", [flat], (j, height, width)) for j in range(width)]
    products = []
    for row in rows:
        for column in columns:
            products.append(b.apply("sum", b.apply("mul", row, column)))
    shape = (*x.type.shape[:-1], *y.type.shape[1:])
    if shape:
        return b.structure("reshape", [b.structure("vector", products)], shape)
    return products[0]


def _need_vector(name: str, node: Node) -> int:
    if node.type.is_scalar:
        raise Refused(f"`{name}` needs a vector, not a single {node.type}")
    return node.type.shape[0]


def _need_index(name: str, node: Node) -> Node:
    if not node.type.is_scalar or node.type.kind is Kind.REAL:
        raise Refused(f"`{name}` needs an int as index, not {node.type}", hint="`floor(x)` gives an int")
    return node


def at(b: NodeMaker, name: str, x: Node, index: Node) -> Node:
    """Bring an index into the first axis of x."""
    return b.position(b.cast(_need_index(name, index), Kind.INT), _need_vector(name, x))


def _reverse(b: NodeMaker, args: list[Node]) -> Node:
    n = _need_vector("reverse", args[0])
    if n:
        return b.structure("slice", args, (n - 1, n, -1))
    return args[0]


def _concat(b: NodeMaker, args: list[Node]) -> Node:
    parts = []
    for a in args:
        if a.type.is_scalar:
            parts.append(b.structure("reshape", [a], (1,)))
        else:
            parts.append(a)
    if len({a.type.shape[1:] for a in parts if a.type.shape != (0,)}) > 1:
        raise Refused("the parts of `concat` have different row shapes", "E307")
    return b.structure("concat", parts)


def _put(b: NodeMaker, args: list[Node]) -> Node:
    x, index, value = args
    axes = x.type.shape
    if len(axes) > 1 and index.type.shape == (len(axes),):
        number: Node = b.scalar(0)
        for k, length in enumerate(axes):
            i = b.position(b.cast(_need_index("put", b.structure("element", [index], (k,))), Kind.INT), length)
            number = b.apply("add", b.apply("mul", number, b.scalar(length)), i)
        flat = b.structure("reshape", [x], (x.type.size,))
        return b.structure("reshape", [_put(b, [flat, number, value])], axes)
    i = at(b, "put", x, index)
    value = b.stretch(value, x.type.shape[1:])
    if value.type.shape != x.type.shape[1:]:
        raise Refused(f"`put` cannot place {value.type} in {x.type}", "E307")
    kind = max(x.type.kind, value.type.kind)
    return b.structure("put", [b.cast(x, kind), i, b.cast(value, kind)])


def _reshape(b: NodeMaker, args: list[Node]) -> Node:
    x, shape = args
    assert isinstance(shape, Const)
    if shape.type.kind is Kind.REAL or len(shape.type.shape) > 1 or min(shape.flat, default=-1) < 0:
        raise Refused("the shape of `reshape` is one or several sizes")
    _need_vector("reshape", x)
    lengths = tuple(map(int, shape.flat))
    if math.prod(lengths) != x.type.size:
        raise Refused(f"`reshape` cannot arrange {x.type.size} elements as {list(lengths)}", "E307")
    return b.structure("reshape", [x], lengths)


def _swap(b: NodeMaker, args: list[Node]) -> Node:
    x, i, j = args
    return b.structure("swap", [x, at(b, "swap", x, i), at(b, "swap", x, j)])


def _onehot(b: NodeMaker, args: list[Node]) -> Node:
    index, n = args
    assert isinstance(n, Const)
    if n.type != INT or n.value < 0:
        raise Refused("`onehot` needs an int as length, 0 or more")
    b.check_size((n.value,))
    positions = b.const(tuple(range(n.value)), Type(Kind.INT, (n.value,)))
    return b.cast(b.apply("eq", positions, _need_index("onehot", index)), Kind.INT)


FUNCTIONS = (
    Function("dot", ("x", "y"), r"{0} \cdot {1}", "Inner product of vectors; product of a matrix with a vector, or a matrix.",
             ((INTS, MIXED), (ROWS, (1, 1)), ((1, 2), ROWS), (ROWS, ROWS)), _product,
             brackets=Brackets(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True), axes=lambda axes: sum(axes) - 2,
             whole=True),
    Function("norm1", ("x",), r"\lVert {0} \rVert_1", "Sum of absolute values.", ((INTS,), (MIXED,)),
             lambda b, args: b.apply("sum", b.apply("abs", args[0])), axes=no_axes,
             whole=True),
    Function("norm2", ("x",), r"\lVert {0} \rVert_2", "Euclidean length.", ((INTS,), (MIXED,)),
             lambda b, args: b.apply("sqrt", b.apply("sum", b.apply("mul", args[0], args[0]))), axes=no_axes, whole=True),
    Function("concat", ("x", "*rest"), r"({*})", "Vectors (or single values) joined into one.",
             ((INTS, INTS), (INTS, 7), (1.5, INTS)), _concat, moved=range(1000), axes=lambda axes: max(1, *axes), whole=True),
    Function("reverse", ("x",), r"\operatorname{reverse}({0})", "Elements in the opposite order.", ((INTS,),), _reverse,
             moved=range(1), axes=of_first, whole=True),
    Function("swap", ("x", "i", "j"), r"\operatorname{swap}_{{1},{2}}({0})", "The vector with elements i and j exchanged.",
             ((INTS, 0, 2), (MIXED, 1, 1), (INTS, 1, 9)), _swap, indices=(1, 2), moved=range(1), axes=of_first, whole=True),
    Function("put", ("x", "i", "value"), r"{0}[{1} \leftarrow {2}]",
             "The vector with element i replaced; the matrix with row i, or with element (i, j) as `i`.",
             ((INTS, 1, 9), (MIXED, 0, 9), (INTS, 7, 0.5), (ROWS, 1, INTS[:2]), (ROWS, (1, 1), 0.5)), _put, indices=(1,),
             moved=range(0, 3, 2), brackets=Brackets(Level.ATOM, (Level.ATOM, Level.SCOPE)), axes=of_first, whole=True),
    Function("reshape", ("x", "shape"), r"\operatorname{reshape}_{{1}}({0})", "The same elements in another shape, row by row.",
             (((1, 2, 3, 4), (2, 2)), (ROWS, 4)), _reshape, static=(1,), moved=range(1),
             axes=lambda axes: 1 + axes[1], whole=True),
    Function("onehot", ("i", "n"), r"e_{{0}}", "Zeros of length n with a 1 at i; all zeros when i is outside.",
             ((1, 3), (5, 3)), _onehot, static=(1,), axes=lambda axes: 1, whole=True),
    Function("len", ("x",), r"\lvert {0} \rvert", "Number of rows, a constant.", ((INTS,),),
             lambda b, args: b.scalar(_need_vector("len", args[0])), axes=no_axes, whole=True),
)  # fmt: skip

INFIX = (
    Infix(">", "gt", 4, "{0} > {1}", "Greater."),
    Infix(">=", "ge", 4, r"{0} \geq {1}", "Greater or equal."),
    Infix("in", "in", 4, r"{0} \in {1}", "Equal to one of the values written out."),
    Infix("not in", "not in", 4, r"{0} \notin {1}", "Equal to none of the values written out."),
)

TABLE = (*REDUCTIONS, *SORTING)
