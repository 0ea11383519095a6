"""The finitely many values that an expression can have, as far as its form tells; some of them may never occur."""

from __future__ import annotations

import math
from itertools import product
from typing import TypeAlias

from taskspec.lang.builder import MOVING, Builder
from taskspec.lang.ir import Apply, Const, Node, children, plain, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.types import Kind, Type

MOST = 256
"""Values that are told apart, at the most."""
TRIED = 4096
"""Combinations of arguments that are worked out for one operation."""
Values: TypeAlias = frozenset[Const] | None
"""What the elements of a node may be; None where that is not known, or too much."""


def values(b: Builder, root: Node) -> Values:
    """The constants that a number may come to; None where there may be others, or too many."""
    known: dict[int, Values] = {}
    for node in walk([root]):
        known[id(node)] = _few(_values(b, node, [known[id(c)] for c in children(node)]))
    return known[id(root)]


def _few(found: Values) -> Values:
    return found if found is not None and len(found) <= MOST else None


def _values(b: Builder, node: Node, args: list[Values]) -> Values:
    match node:
        case Const():
            kind = Type(node.type.kind)
            return frozenset(b.const(v, kind) for v in set(node.flat))
        case Apply(op="where"):
            return _union(args[1:], b, node)
        case Apply(op="index" | "element" | "slice" | "reshape" | "fill" | "swap"):
            return args[0]
        case Apply(op=op) if op in MOVING:
            return _union(args, b, node)
        case Apply(op=op) if op in OPERATORS and OPERATORS[op].elementwise:
            found = _worked_out(b, op, args)
            return _within_bounds(b, node) if found is None else found
        case _:
            return _within_bounds(b, node)


def _union(args: list[Values], b: Builder, node: Node) -> Values:
    if any(a is None for a in args):
        return _within_bounds(b, node)
    return frozenset(_of_kind(b, v, node.type.kind) for a in args if a is not None for v in a)


def _of_kind(b: Builder, value: Const, kind: Kind) -> Const:
    found = b.cast(value, kind)
    assert isinstance(found, Const)
    return found


def _worked_out(b: Builder, op: str, args: list[Values]) -> Values:
    """What an operator gives for all combinations of arguments."""
    if any(a is None for a in args) or math.prod(len(a or ()) for a in args) > TRIED:
        return None
    found = [b.apply(op, *each) for each in product(*(a or () for a in args))]
    return frozenset(v for v in found if isinstance(v, Const))


def _within_bounds(b: Builder, node: Node) -> Values:
    """All that an int or a condition may be, by its bounds."""
    if node.type.kind is Kind.REAL:
        return None
    if node.type.kind is Kind.BOOL:
        return frozenset((b.const(False, Type(Kind.BOOL)), b.const(True, Type(Kind.BOOL))))
    low, high = b.bounds(node)
    if not (math.isfinite(low) and math.isfinite(high) and high - low < MOST):
        return None
    return frozenset(b.const(v, Type(Kind.INT)) for v in range(int(low), int(high) + 1))


def floats(b: Builder, root: Node) -> list[float] | None:
    """The values of a number as floats, in order; None where they are not known to be few and finite."""
    found = values(b, root)
    if found is None:
        return None
    numbers = sorted({float(plain(v.value)) + 0.0 for v in found})
    return numbers if all(map(math.isfinite, numbers)) else None
