"""Subscripts: elements, rows and slices, and what becomes of an index that lies outside.

One rule, for elements as for `put` and `swap`: an index that is known before the task runs counts from the end when it is
negative; one that depends on the state, the action, the time or a draw is moved to the nearest end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker, ClampedIndex, varies
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Node, Role, reads
from taskspec.lang.scope import Scope
from taskspec.lang.types import Kind, Shape, Type


def subscript(checker: BaseChecker, expr: s.Subscript, scope: Scope) -> Node:
    """`x[i]`, `x[i, j]`, `x[a:b]`, `x[:, j]`: constant indices are checked, others are brought into range."""
    node = checker.numeric(expr.value, scope)
    if len(expr.indices) > len(node.type.shape):
        what = "a single value" if node.type.is_scalar else f"a vector of {len(node.type.shape)} axis"
        checker.fail("E307", expr, f"{what} cannot take {len(expr.indices)} indices")
    if len(expr.indices) == 1:
        return _row(checker, node, expr.indices[0], scope)
    return _block(checker, node, expr, scope)


def _row(checker: BaseChecker, node: Node, index: s.Expr | s.Slice, scope: Scope) -> Node:
    b = checker.builder
    n = node.type.shape[0]
    if isinstance(index, s.Slice):
        start, count, step = _slice_bounds(checker, index, n, scope)
        return b.structure("slice", [node], (start, count, step))
    i = _index(checker, index, n, scope)
    if len(i.type.shape) > 1:
        checker.fail("E307", index, "an index is an int or a vector of ints")
    return b.structure("index", [node, i])


def rows_for_an_element(checker: BaseChecker, expr: s.Expr, scope: Scope) -> str | None:
    """Return what to write where a vector with an index for each axis picks rows of a matrix, and so is no place in it."""
    for part in s.below(expr):
        if not isinstance(part, s.Subscript) or len(part.indices) > 1 or isinstance(part.indices[0], s.Slice):
            continue
        value = checker.check(part.value, scope)
        index = checker.check(part.indices[0], scope)
        if value is None or index is None or len(value.node.type.shape) < 2:
            continue
        if index.node.type.shape == (len(value.node.type.shape),):
            at = part.indices[0]
            n = len(value.node.type.shape)
            name = at.place.written
            written = [i.place.written for i in at.items] if isinstance(at, s.Vector) else None
            places = ", ".join(written or [f"{name}[{i}]" for i in range(n)])
            return f"a vector of indices picks rows; one element has an index for each axis: `[{places}]`"
    return None


def _block(checker: BaseChecker, node: Node, expr: s.Subscript, scope: Scope) -> Node:
    """Return what several indices leave of a matrix, an axis for each slice: elements of its rows laid end to end."""
    b = checker.builder
    axes = node.type.shape[: len(expr.indices)]
    jobs = [partial(_places, checker, i, n, scope) for i, n in zip(expr.indices, axes, strict=True)]
    places = checker.each(jobs)
    if any(p.type.shape and not isinstance(i, s.Slice) for i, p in zip(expr.indices, places, strict=True)):
        hint = "pair them in a comprehension: `[m[i, j] for (i, j) in ...]`"
        checker.fail("E307", expr, "each of several indices must be an int or a slice", hint)
    kept = tuple(p.type.size for p in places if p.type.shape)
    flat = b.structure("reshape", [node], (math.prod(axes), *node.type.shape[len(axes) :]))
    found = b.structure("index", [flat, _numbers(b, places, axes, kept)])
    return b.structure("reshape", [found], (*kept, *node.type.shape[len(axes) :]))


def _places(checker: BaseChecker, index: s.Expr | s.Slice, length: int, scope: Scope) -> Node:
    """Return where an index points along one axis: a number, or the numbers of a slice."""
    if not isinstance(index, s.Slice):
        return _index(checker, index, length, scope)
    start, count, step = _slice_bounds(checker, index, length, scope)
    return checker.builder.const(range(start, start + count * step, step), Type(Kind.INT, (count,)))


def _numbers(b: Builder, places: Sequence[Node], axes: Shape, kept: Shape) -> Node:
    """Return where elements stand when rows are laid end to end; those of slices are constants, one after the other."""
    number: Node = b.scalar(0)
    slices = iter(np.indices(kept).reshape(len(kept), math.prod(kept)))
    for place, length in zip(places, axes, strict=True):
        if isinstance(place, Const) and place.type.shape:
            place = b.const([place.flat[k] for k in next(slices)], Type(Kind.INT, (math.prod(kept),)))
        number = b.apply("add", b.apply("mul", number, b.scalar(length)), place)
    return number


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
                    f"index {i} is outside a vector of {length or 'no'} element{'s' * (length != 1)}",
                    f"indices go from 0 to {length - 1}" if length else None,
                )
        return checker.builder.position(node, length)
    return moved(checker, node, length, expr)


def argument(checker: BaseChecker, index: Node, x: Node, expr: s.Expr, scope: Scope) -> Node:
    """Return the argument of a function that is an index of x, or one for each axis; what cannot be one is left to
    the function.
    """
    axes = x.type.shape
    if len(axes) > 1 and index.type.shape == (len(axes),):
        written = expr.items if isinstance(expr, s.Vector) else [expr] * len(axes)
        parts = [checker.builder.structure("element", [index], (k,)) for k in range(len(axes))]
        found = [_argument(checker, *each, scope) for each in zip(parts, axes, written, strict=True)]
        return checker.builder.structure("vector", found)
    return index if x.type.is_scalar else _argument(checker, index, axes[0], expr, scope)


def _argument(checker: BaseChecker, index: Node, length: int, expr: s.Expr, scope: Scope) -> Node:
    known = isinstance(index, Const) and not varies(expr, scope)
    if known or not index.type.is_scalar or index.type.kind is Kind.REAL:
        return index
    return moved(checker, checker.builder.cast(index, Kind.INT), length, expr)


def moved(checker: BaseChecker, index: Node, length: int, expr: s.Expr) -> Node:
    """Return an index that depends on the state, moved to the nearest end of a vector if it lies outside; kept for the lints."""
    if Role.PARAMETER in {role for role, _ in reads([index])}:  # a known one would count from the end
        checker.fail("E312", expr, "an index must be a constant where it depends on parameters")
    found = checker.builder.within(index, 0, length - 1)
    if found is not index:
        checker.moved.setdefault(id(found), ClampedIndex(found, index, length, expr.place))
    return found


def _slice_bounds(checker: BaseChecker, index: s.Slice, length: int, scope: Scope) -> tuple[int, int, int]:
    ends = ((index.start, "i >="), (index.stop, "i <"), (index.step, None))
    parts = [None if part is None else _bound(checker, part, test, scope) for part, test in ends]
    if parts[2] == 0:
        checker.fail("E315", index, "the step of a slice cannot be 0")
    chosen = range(length)[slice(*parts)]
    return chosen.start, len(chosen), chosen.step


def _bound(checker: BaseChecker, expr: s.Expr, test: str | None, scope: Scope) -> int:
    """Return one of the numbers of a slice; `test` is the start of a condition that does the same."""
    inside = f"`[x[i] if {test} {expr.place.written} else 0 for i in range(len(x))]`"
    instead = None if test is None else f"take all and test inside: {inside}"
    return checker.integer(expr, scope, "the bounds of a slice", instead)
