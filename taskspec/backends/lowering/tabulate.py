"""Expressions over few finite values become tables: one look-up instead of a chain of operations.

Array code pays for every operation on every lane, and twice for the call where lanes are few, so that a transition
of a small finite task is cheapest as a look-up. The tables are worked out by the array forms of the operators.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang import batch
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, rewrite, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.types import Kind, Type

CELLS = 8192
"""Largest table: 64 KiB of 8-byte numbers, which a second-level cache holds beside the lanes."""


@dataclass
class _Tables:
    builder: Builder
    reads: dict[int, frozenset[Read] | None] = field(default_factory=dict)  # by node id; None: not to be tabulated
    made: dict[int, Node] = field(default_factory=dict)


def tabulate(b: Builder, roots: Sequence[Node], cells: int = CELLS) -> tuple[Node, ...]:
    """Return roots with their largest scalar parts over at most `cells` combinations of finite reads as look-ups."""
    roots = folded(b, roots)
    tables = _Tables(b)
    for node in walk(roots):
        tables.reads[id(node)] = _finite_reads(tables, node, cells)
    stack = list(roots)
    seen = set[int]()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if _worthwhile(tables, node):
            tables.made[id(node)] = _table(tables, node)
        else:
            stack.extend(children(node))
    return folded(b, rewrite(roots, lambda n: tables.made.get(id(n)), b.remake))


def _finite_reads(tables: _Tables, node: Node, cells: int) -> frozenset[Read] | None:
    match node:
        case Const():
            return frozenset()
        case Read():
            return frozenset([node]) if node.type.is_scalar and _count(node) <= cells else None
        case Draw():
            return None
        case Apply():
            below = [tables.reads[id(c)] for c in node.args]
            if any(r is None for r in below):
                return None
            joined = frozenset[Read]().union(*(r for r in below if r is not None))
            return joined if _size(joined) <= cells else None


def _count(read: Read) -> float:
    if read.type.kind is Kind.BOOL:
        return 2
    return read.high - read.low + 1 if read.type.kind is Kind.INT else np.inf


def _size(reads: frozenset[Read]) -> float:
    return float(np.prod([float(_count(r)) for r in reads], dtype=float))


def _worthwhile(tables: _Tables, node: Node) -> bool:
    """Return whether a look-up is cheaper: the index takes an operation or two for every read but the first."""
    reads = tables.reads[id(node)]
    if not reads or not isinstance(node, Apply) or not node.type.is_scalar:
        return False
    return sum(isinstance(n, Apply) for n in walk([node])) > 2 * len(reads)


def _table(tables: _Tables, node: Node) -> Node:
    b = tables.builder
    reads = sorted(tables.reads[id(node)] or (), key=lambda r: (r.role.value, r.name))
    counts = [int(_count(r)) for r in reads]
    places = np.indices(counts).reshape(len(reads), -1)
    points = {_key(r): _values(r, place) for r, place in zip(reads, places, strict=True)}
    (values,) = batch.evaluate([node], points)
    cells = np.broadcast_to(values, places.shape[1:]).tolist()
    if len(set(map(repr, cells))) == 1:
        return b.const(cells[0], node.type)
    table = b.const(cells, Type(node.type.kind, (len(cells),)))
    return b.structure("index", [table, _place(b, reads, counts)])


def _key(read: Read) -> tuple[Role, str]:
    return (read.role, read.name)


def _values(read: Read, place: Array) -> Array:
    if read.type.kind is Kind.BOOL:
        return place.astype(np.bool_)
    return place + int(read.low)


def _place(b: Builder, reads: Sequence[Read], counts: Sequence[int]) -> Node:
    """Return the number of the cell: reads as digits, the last one fastest."""
    place: Node = b.scalar(0)
    for read, count in zip(reads, counts, strict=True):
        low = 0 if read.type.kind is Kind.BOOL else int(read.low)
        digit = b.apply("sub", b.cast(read, Kind.INT), b.scalar(low))
        place = b.apply("add", b.apply("mul", place, b.scalar(count)), digit)
    return place


# -- look-ups of look-ups -----------------------------------------------------------------------------------------


def folded(b: Builder, roots: Sequence[Node]) -> tuple[Node, ...]:
    """Return roots with operations on looked-up elements applied to the constant table."""
    done: dict[int, Node] = {}
    for node in walk(roots):
        args = tuple(done[id(c)] for c in children(node))
        same = all(a is c for a, c in zip(args, children(node), strict=True))
        done[id(node)] = _fold(b, node if same else b.remake(node, args))
    return tuple(done[id(root)] for root in roots)


def _fold(b: Builder, node: Node) -> Node:
    match node:
        case Apply(op="index", args=(Apply(op="index", args=(Const() as table, row)), column)) if _is_matrix(
            table, row
        ):
            k = table.type.shape[1]
            flat = b.const(table.flat, Type(table.type.kind, (table.type.size,)))
            place = b.apply("add", b.apply("mul", row, b.scalar(k)), column)
            return b.structure("index", [flat, place])
        case Apply(op="element", args=(Apply(op="index", args=(Const() as table, row)),), static=(k,)) if _is_matrix(
            table, row
        ):
            width = table.type.shape[1]
            column = b.const(table.flat[k::width], Type(table.type.kind, (table.type.shape[0],)))
            return b.structure("index", [column, row])
        case Apply(op="index", args=(Const() as table, Apply(op="index", args=(Const() as inner, place)))):
            if len(table.type.shape) == 1 and len(inner.type.shape) == 1:
                picked = b.const([table.flat[i] for i in inner.flat], Type(table.type.kind, inner.type.shape))
                return b.structure("index", [picked, place])
            return node
        case Apply(op=op) if op in OPERATORS and OPERATORS[op].elementwise and node.type.is_scalar:
            return _fold_function(b, node)
        case _:
            return node


def _is_matrix(table: Const, row: Node) -> bool:
    return len(table.type.shape) == 2 and row.type.is_scalar


def _fold_function(b: Builder, node: Apply) -> Node:
    """Return a function of one look-up and constants as a look-up."""
    found = [a for a in node.args if not isinstance(a, Const)]
    if len({id(a) for a in found}) != 1 or not _looks_up(found[0]):
        return node
    inner = found[0]
    assert isinstance(inner, Apply)
    table, place = inner.args
    args = [b.held(table if a is inner else a) for a in node.args]  # fractions end where the task begins to run
    cells = b.remake(Apply(node.op, tuple(args), Type(node.type.kind, table.type.shape)), tuple(args))
    return b.structure("index", [cells, place]) if isinstance(cells, Const) else node


def _looks_up(node: Node) -> bool:
    return (
        isinstance(node, Apply)
        and node.op == "index"
        and isinstance(node.args[0], Const)
        and len(node.args[0].type.shape) == 1
        and node.args[1].type.is_scalar
    )
