"""Functions that compose several operators, or arrange elements; and comparisons that are read as others."""

from __future__ import annotations

import math

from taskspec.lang.ir import Const, Node
from taskspec.lang.operators.entry import (
    INTS,
    MIXED,
    ROWS,
    Brackets,
    Function,
    Infix,
    Level,
    NodeMaker,
    no_axes,
    of_first,
)
from taskspec.lang.types import INT, Kind, Refused, Type


def _clip(b: NodeMaker, args: list[Node]) -> Node:
    x, low, high = args
    return b.apply("min2", b.apply("max2", x, low), high)


def _product(b: NodeMaker, args: list[Node]) -> Node:
    """Multiply: two vectors give a number, a matrix and a vector a vector, two matrices a matrix."""
    x, y = args
    if not all(1 <= len(a.type.shape) <= 2 for a in args):
        wrong = next(a for a in args if not 1 <= len(a.type.shape) <= 2)
        raise Refused(f"`dot` needs vectors or matrices, not {wrong.type}")
    if x.type.shape[-1] != y.type.shape[0]:
        shapes = " and ".join(str(list(a.type.shape)) for a in args)
        raise Refused(f"`dot` needs rows as long as columns: the shapes {shapes} do not match", "E307")
    columns = _columns(b, y) if len(y.type.shape) == 2 else [y]
    rows = [b.structure("element", [x], (i,)) for i in range(x.type.shape[0])] if len(x.type.shape) == 2 else [x]
    found = [b.apply("sum", b.apply("mul", row, column)) for row in rows for column in columns]
    shape = (*x.type.shape[:-1], *y.type.shape[1:])
    return b.structure("reshape", [b.structure("vector", found)], shape) if shape else found[0]


def _columns(b: NodeMaker, x: Node) -> list[Node]:
    rows, columns = x.type.shape
    flat = b.structure("reshape", [x], (rows * columns,))
    return [b.structure("slice", [flat], (j, rows, columns)) for j in range(columns)]


def _norm1(b: NodeMaker, args: list[Node]) -> Node:
    return b.apply("sum", b.apply("abs", args[0]))


def _norm2(b: NodeMaker, args: list[Node]) -> Node:
    return b.apply("sqrt", b.apply("sum", b.apply("mul", args[0], args[0])))


def _need_vector(name: str, node: Node) -> int:
    if node.type.is_scalar:
        raise Refused(f"`{name}` needs a vector, not a single {node.type}")
    return node.type.shape[0]


def _need_index(name: str, node: Node) -> Node:
    if not node.type.is_scalar or node.type.kind is Kind.REAL:
        raise Refused(f"`{name}` needs an int as index, not {node.type}", hint="`floor(x)` gives an int")
    return node


def at(b: NodeMaker, name: str, x: Node, index: Node) -> Node:
    """Return an index into the first axis of x, brought into range."""
    return b.position(b.cast(_need_index(name, index), Kind.INT), _need_vector(name, x))


def _reverse(b: NodeMaker, args: list[Node]) -> Node:
    n = _need_vector("reverse", args[0])
    return b.structure("slice", args, (n - 1, n, -1)) if n else args[0]


def _concat(b: NodeMaker, args: list[Node]) -> Node:
    parts = [b.structure("reshape", [a], (1,)) if a.type.is_scalar else a for a in args]
    if len({a.type.shape[1:] for a in parts if a.type.shape != (0,)}) > 1:
        raise Refused("the parts of `concat` have different row shapes", "E307")
    return b.structure("concat", parts)


def _put(b: NodeMaker, args: list[Node]) -> Node:
    x, index, value = args
    axes = x.type.shape
    if len(axes) > 1 and index.type.shape == (len(axes),):
        return _put_element(b, x, index, value)
    i = at(b, "put", x, index)
    value = b.stretch(value, x.type.shape[1:])
    if value.type.shape != x.type.shape[1:]:
        raise Refused(f"`put` cannot place {value.type} in {x.type}", "E307")
    kind = max(x.type.kind, value.type.kind)
    return b.structure("put", [b.cast(x, kind), i, b.cast(value, kind)])


def _put_element(b: NodeMaker, x: Node, index: Node, value: Node) -> Node:
    """Return one element of a matrix replaced, at an index for each axis."""
    number: Node = b.scalar(0)
    for k, length in enumerate(x.type.shape):
        i = b.position(b.cast(_need_index("put", b.structure("element", [index], (k,))), Kind.INT), length)
        number = b.apply("add", b.apply("mul", number, b.scalar(length)), i)
    flat = b.structure("reshape", [x], (x.type.size,))
    return b.structure("reshape", [_put(b, [flat, number, value])], x.type.shape)


def _reshape(b: NodeMaker, args: list[Node]) -> Node:
    x, shape = args
    assert isinstance(shape, Const)
    if shape.type.kind is Kind.REAL or len(shape.type.shape) > 1 or min(shape.flat, default=-1) < 0:
        raise Refused("the shape of `reshape` is one or several sizes")
    _need_vector("reshape", x)
    lengths = tuple(int(n) for n in shape.flat)
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


def _len(b: NodeMaker, args: list[Node]) -> Node:
    return b.scalar(_need_vector("len", args[0]))


FUNCTIONS = (
    Function("clip", ("x", "low", "high"), r"\operatorname{clip}({0}, {1}, {2})", "x moved into [low, high].",
             ((5, 0, 3), (-1.5, 0, 3), (MIXED, -1, 1)), _clip),
    Function("dot", ("x", "y"), r"{0} \cdot {1}", "Inner product of vectors; product of a matrix with a vector, or a matrix.",
             ((INTS, MIXED), (ROWS, (1, 1)), ((1, 2), ROWS), (ROWS, ROWS)), _product,
             brackets=Brackets(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True), axes=lambda axes: sum(axes) - 2,
             whole=True),
    Function("norm1", ("x",), r"\lVert {0} \rVert_1", "Sum of absolute values.", ((INTS,), (MIXED,)), _norm1, axes=no_axes,
             whole=True),
    Function("norm2", ("x",), r"\lVert {0} \rVert_2", "Euclidean length.", ((INTS,), (MIXED,)), _norm2, axes=no_axes, whole=True),
    Function("concat", ("x", "*rest"), r"({*})", "Vectors (or single values) joined into one.",
             ((INTS, INTS), (INTS, 7), (1.5, INTS)), _concat, axes=lambda axes: max(1, *axes), whole=True),
    Function("reverse", ("x",), r"\operatorname{reverse}({0})", "Elements in the opposite order.", ((INTS,),), _reverse,
             axes=of_first, whole=True),
    Function("swap", ("x", "i", "j"), r"\operatorname{swap}_{{1},{2}}({0})", "The vector with elements i and j exchanged.",
             ((INTS, 0, 2), (MIXED, 1, 1), (INTS, 1, 9)), _swap, indices=(1, 2), axes=of_first, whole=True),
    Function("put", ("x", "i", "value"), r"{0}[{1} \leftarrow {2}]",
             "The vector with element i replaced; the matrix with row i, or with element (i, j) as `i`.",
             ((INTS, 1, 9), (MIXED, 0, 9), (INTS, 7, 0.5), (ROWS, 1, INTS[:2]), (ROWS, (1, 1), 0.5)), _put, indices=(1,),
             brackets=Brackets(Level.ATOM, (Level.ATOM, Level.SCOPE)), axes=of_first, whole=True),
    Function("reshape", ("x", "shape"), r"\operatorname{reshape}_{{1}}({0})", "The same elements in another shape, row by row.",
             (((1, 2, 3, 4), (2, 2)), (ROWS, 4)), _reshape, static=(1,), axes=lambda axes: 1 + axes[1], whole=True),
    Function("onehot", ("i", "n"), r"e_{{0}}", "Zeros of length n with a 1 at i; all zeros when i is outside.",
             ((1, 3), (5, 3)), _onehot, static=(1,), axes=lambda axes: 1, whole=True),
    Function("len", ("x",), r"\lvert {0} \rvert", "Number of rows, a constant.", ((INTS,),), _len, axes=no_axes, whole=True),
)  # fmt: skip

INFIX = (
    Infix(">", "gt", 4, "{0} > {1}", "Greater."),
    Infix(">=", "ge", 4, r"{0} \geq {1}", "Greater or equal."),
    Infix("in", "in", 4, r"{0} \in {1}", "Equal to one of the values written out."),
    Infix("not in", "not in", 4, r"{0} \notin {1}", "Equal to none of the values written out."),
)
