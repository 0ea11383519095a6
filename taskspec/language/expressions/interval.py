"""Interval reasoning over core nodes, and their normal forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, children, draws, plain, walk
from taskspec.language.expressions.operators import Elements, Operator, OperatorEntry, entry_of
from taskspec.language.expressions.types import (
    EVERYTHING,
    HUGE,
    INF,
    INT_MAX,
    INT_WIDEST,
    Args,
    Expression,
    Interval,
    Kind,
    Range,
    Role,
)
from taskspec.language.expressions.variates import VARIATES

# There are two kinds. `bounds` follow the arithmetic of float64, each operation rounded as the run time rounds it: they serve
# proofs, spaces and widths. `certain` bounds rest on integer arithmetic alone, so that they hold in any precision of reals, on
# every backend, and even if a real has left its declared range: only these may drop an index clamp or a zero guard.
#
# Sound, not tight: an operator without a rule gives (-inf, inf). Nan is outside every interval's promise: bounds speak of the
# numbers only, and `Range.finite` says whether there is nothing else.


def bounds(root: Expression, known: dict[int, Range]) -> Interval:
    """Bounds of a node; `known` (by node id) carries results from call to call."""
    return ranges(root, known)[:2]


def ranges(root: Expression, known: dict[int, Range], rule: Callable[[Node, Args], Range] | None = None) -> Range:
    """Range of a node, worked out bottom-up by `rule` (`step` unless it is given)."""
    rule = rule or step
    if id(root) not in known:
        for node in walk([root], known):
            known[id(node)] = rule(node, [known[id(c)] for c in children(node)])
    return known[id(root)]


def step(node: Node, args: Args) -> Range:
    """Range of a node from the ranges of its arguments."""
    match node:
        case Const():
            return _constant(node)
        case Read(role=role):
            edge: Interval = (0, 1)
            if node.type.kind is not Kind.BOOL:
                edge = _tidy((node.low, node.high), node.type.kind)
            # States, actions and times are numbers; a variable may stand for any value.
            return Range(*edge, role not in (Role.VARIABLE, Role.PARAMETER) or all(map(math.isfinite, edge)))
        case Draw():
            return Range(*_tidy(VARIATES[node.base].bounds(node, args), node.type.kind))
        case Apply(type=t) if t.kind is Kind.BOOL:
            return Range(0, 1)
        case Apply(op=op):
            entry = entry_of(op)
            interval = _tidy(entry.bounds(args, node), node.type.kind)
            return Range(*interval, node.type.kind is Kind.INT or entry.finite(args, interval))


def certain(root: Node, known: dict[int, Range]) -> Interval:
    """Bounds by integer arithmetic alone: nothing is known of a real, nor of an int that may leave 64 bits."""
    return ranges(root, known, _certain_step)[:2]


SINGLE = 2.0**-21
"""Relative error bound of float32 operations that are not correctly rounded (8 ulp)."""


def single(root: Node) -> Interval:
    """Bounds that hold in single floats as well, in which JAX computes."""
    return ranges(root, {}, single_step)[:2]


def single_step(node: Node, args: Args) -> Range:
    """`step` in single floats."""
    edges = step(node, args)
    if node.type.kind is not Kind.REAL:
        return edges
    if isinstance(node, Apply) and not _is_nearest(entry_of(node.op), args, edges):
        terms = max((c.type.size for c in children(node)), default=1)
        cancels = terms > 1 and any(a.low < 0 < a.high for a in args)
        low = abs(edges.low)
        high = abs(edges.high)
        if cancels:
            low = high = max(low, high)
        if not math.isinf(low + high):
            edges = edges._replace(low=edges.low - SINGLE * terms * low, high=edges.high + SINGLE * terms * high)
    return rounded(edges)


def rounded(edges: Range) -> Range:
    """Round a range of reals to single floats; rounding keeps their order."""
    with np.errstate(over="ignore"):
        return edges._replace(low=float(np.float32(edges.low)), high=float(np.float32(edges.high)))


def _is_nearest(op: OperatorEntry, args: Args, edges: Range) -> bool:
    if not isinstance(op, Operator):
        return True
    if op.elementwise:
        return op.precise
    return edges[:2] == args[0][:2]


def _certain_step(node: Node, args: Args) -> Range:
    edges = step(node, args)
    match node:
        case Apply(op=op) if entry_of(op).rounds:
            return Range(-INT_MAX, INT_MAX)
        case _ if node.type.kind is Kind.REAL:
            return Range(*EVERYTHING, False)
        case Draw() | Read(role=Role.TIME):  # counts, which stay within 32 bits
            return Range(edges.low, min(edges.high, INT_MAX))
        case Apply(op=op) if entry_of(op).wraps and max(-edges.low, edges.high) > INT_WIDEST:
            return Range(*EVERYTHING)
        case _:
            return edges


def _tidy(edge: Interval, kind: Kind) -> Interval:
    """Without nan, and without ints so large that computing with them takes long."""
    low, high = edge
    low = min(low, HUGE)
    high = max(high, -HUGE)
    if not low >= -HUGE:
        low = -INF
    if not high <= HUGE:
        high = INF
    if kind is Kind.REAL:
        return float(low), float(high)
    if not math.isinf(low):
        low = math.floor(low)
    if not math.isinf(high):
        high = math.ceil(high)
    return low, high


@lru_cache(maxsize=4096)
def _constant(node: Const) -> Range:
    """Range of a constant; cached, as tables are asked about often and may have a million elements."""
    if not node.type.size:
        return Range(*_tidy((0, 0), node.type.kind))
    if node.type.kind is not Kind.REAL:
        return Range(*_tidy((min(node.flat), max(node.flat)), node.type.kind), True)
    flat = list(map(plain, node.flat))
    numbers = [v for v in flat if v == v]
    edge = EVERYTHING
    if numbers:
        edge = (min(numbers), max(numbers))
    return Range(*_tidy(edge, node.type.kind), all(map(math.isfinite, flat)))


# -- normal forms: equal numbers for expressions that compute the same in the same way, whoever built them -------------


class NormalForms:
    """Numbers for nodes, the same number for the same form; two builders may have made them.

    Operands that may change places are put in order, `x >= n` where x is at most n counts as `x == n`, and draws are
    identified by their rank in the order of drawing.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], int] = {}

    def all(self, roots: Iterable[Expression]) -> list[int]:
        """Give numbers to the forms of some nodes."""
        roots = list(roots)
        rank = {draw.site: i for i, draw in enumerate(draws(roots))}
        numbers: dict[int, int] = {}
        edges: dict[int, Range] = {}
        for node in walk(roots):
            key = _key(node, numbers, rank, edges)
            numbers[id(node)] = self._known.setdefault(key, len(self._known))
        return [numbers[id(node)] for node in roots]


def _key(node: Node, numbers: dict[int, int], rank: dict[int, int], edges: dict[int, Range]) -> tuple[Any, ...]:
    match node:
        case Const():
            return ("const", node.type, tuple(map(_number, node.flat)))
        case Read(role=role, name=name, low=low, high=high):
            return ("read", role, name, node.type, low, high)
        case Draw(base=base, args=args, site=site):
            return ("draw", base, node.type, rank[site], tuple(numbers[id(a)] for a in args))
        case Apply(op=op, args=args, static=static):
            are_ints = all(a.type.kind is not Kind.REAL for a in args)
            if op == "le" and are_ints and bounds(args[0], edges)[0] >= bounds(args[1], edges)[1]:
                op = "eq"  # it can hold by equality alone
            return ("apply", op, node.type, static, _operands(op, args, numbers))


def _operands(op: str, args: tuple[Node, ...], numbers: dict[int, int]) -> tuple[int, ...]:
    operands = tuple(numbers[id(a)] for a in args)
    entry = entry_of(op)
    if not entry.commutative:
        return operands
    # Of 0 and -0 the first is taken, so that the order of two reals that may both be zero matters.
    may_be_zeros = all(a.type.kind is Kind.REAL and not (isinstance(a, Const) and all(a.flat)) for a in args)
    if entry.elements is Elements.CHOSEN and may_be_zeros:
        return operands
    first = min(entry.indices, default=0)
    return (*operands[:first], *sorted(operands[first:]))


def _number(value: Any) -> str:
    """Text of a constant's number; a fraction and a float of the same value are one, 0 and -0 are two."""
    if isinstance(value, Fraction) and abs(value) < 2**1000 and value == float(value):
        value = float(value)
    return repr(value)
