"""Subscripts: elements, rows and slices, and what becomes of an index that lies outside.

One rule, for elements as for `put` and `swap`: an index that is known before the task runs counts from the end when it is
negative; one that depends on the state, the action, the time or a draw is moved to the nearest end.
"""

from __future__ import annotations

from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker, ClampedIndex
from taskspec.lang.ir import Const, Node
from taskspec.lang.late import varies
from taskspec.lang.scope import Scope
from taskspec.lang.types import Kind, Refused


def subscript(checker: BaseChecker, expr: s.Subscript, scope: Scope) -> Node:
    """`x[i]`, `x[i, j]`, `x[a:b]`: constant indices are checked, others are brought into range."""
    node = checker.numeric(expr.value, scope)
    if len(expr.indices) > len(node.type.shape):
        what = "a single value" if node.type.is_scalar else f"a vector of {len(node.type.shape)} axis"
        checker.fail("E307", expr, f"{what} cannot take {len(expr.indices)} indices")
    if len(expr.indices) == 2 and not any(isinstance(i, s.Slice) for i in expr.indices):
        return _cell(checker, node, expr, scope)
    if len(expr.indices) == 1:
        return _row(checker, node, expr.indices[0], scope)
    checker.fail(
        "E307",
        expr,
        "a slice cannot be mixed with other indices",
        "index twice: `x[a:b]`, then `[i]`",
    )


def _row(checker: BaseChecker, node: Node, index: s.Expr | s.Slice, scope: Scope) -> Node:
    b, n = checker.builder, node.type.shape[0]
    if isinstance(index, s.Slice):
        start, count, step = _slice_bounds(checker, index, n, scope)
        return b.structure("slice", [node], (start, count, step))
    i = _index(checker, index, n, scope)
    if len(i.type.shape) > 1:
        checker.fail("E307", index, "an index is an int or a vector of ints")
    return b.structure("index", [node, i])


def _cell(checker: BaseChecker, node: Node, expr: s.Subscript, scope: Scope) -> Node:
    """One element of a matrix, through its rows laid end to end."""
    b, (rows, columns) = checker.builder, node.type.shape[:2]
    i, j = (_index(checker, x, n, scope) for x, n in zip(expr.indices, (rows, columns), strict=True))  # type: ignore[arg-type]
    flat = b.structure("reshape", [node], (rows * columns, *node.type.shape[2:]))
    return b.structure("index", [flat, b.apply("add", b.apply("mul", i, b.scalar(columns)), j)])


def _index(checker: BaseChecker, expr: s.Expr, length: int, scope: Scope) -> Node:
    node = checker.numeric(expr, scope)
    if node.type.kind is Kind.REAL:
        checker.fail("E306", expr, "an index must be an int, not a real", "`floor(x)` gives an int")
    node = checker.builder.cast(node, Kind.INT)
    if isinstance(node, Const) and not varies(expr, scope):
        for i in node.flat:
            if not -length <= i < length:
                checker.fail(
                    "E315",
                    expr,
                    f"index {i} is outside a vector of {length}",
                    f"indices go from 0 to {length - 1}",
                )
        return checker.builder.position(node, length)
    return moved(checker, node, length, expr)


def argument(checker: BaseChecker, index: Node, x: Node, expr: s.Expr, scope: Scope) -> Node:
    """The argument of a function that is an index of x; what cannot be one is left to the function."""
    known = isinstance(index, Const) and not varies(expr, scope)
    if known or x.type.is_scalar or not index.type.is_scalar or index.type.kind is Kind.REAL:
        return index
    return moved(checker, checker.builder.cast(index, Kind.INT), x.type.shape[0], expr)


def moved(checker: BaseChecker, index: Node, length: int, expr: s.Expr) -> Node:
    """An index that depends on the state, moved to the nearest end of a vector if it lies outside; kept for the lints."""
    found = checker.builder.within(index, 0, length - 1)
    if found is not index:
        checker.moved.setdefault(id(found), ClampedIndex(found, index, length, expr.place))
    return found


def _slice_bounds(checker: BaseChecker, index: s.Slice, length: int, scope: Scope) -> tuple[int, int, int]:
    parts = [
        None if part is None else checker.integer(part, scope, "the bounds of a slice")
        for part in (index.start, index.stop, index.step)
    ]
    if parts[2] == 0:
        checker.fail("E315", index, "the step of a slice cannot be 0")
    chosen = range(length)[slice(*parts)]
    if not chosen:
        raise Refused("this slice is empty", "E315")
    return chosen.start, len(chosen), chosen.step
