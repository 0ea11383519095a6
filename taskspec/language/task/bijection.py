"""Decide whether a map of components is one-to-one: shown for all values, or from the form of its expressions.

A map falls into parts, which share no components. A part is *moved* when it does nothing but move elements about, change their
signs, and add whole numbers to small whole numbers: then it is exact in floats, and what is not lost can be had back. It is
*listed* when it has few values: then all of them are looked at. Of other parts nothing is known here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import limits
from taskspec.base.named import all_names
from taskspec.language.expressions.batch import DTYPES, evaluate
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, children, reads, walk
from taskspec.language.expressions.operators import Elements, entry_of
from taskspec.language.expressions.types import Kind, Role, total_size
from taskspec.language.task.parts import Component, are_finite, counts_of

Values = dict[str, Array]
"""A value (*shape) for each component."""
EXACT = 2**24
"""Whole numbers up to here are floats of 32 bits, as observations are."""
WHOLE = 2**53
"""Whole numbers up to here are floats of 64 bits, in which sums are worked out."""


@dataclass(frozen=True)
class Moves:
    """Elements that are moved: number i is `sign[i] * x[source[i]] + shift[i]`, where a source of -1 means none."""

    source: Array
    sign: Array
    shift: Array


@dataclass(frozen=True)
class MapPart:
    """Components in, and the numbers of the nodes that read them.

    `moves` says how elements are moved, row-major in the order of the components; `listed` has what comes out (N, elements) for
    all values in, the last component fastest. Where both are None, neither is known.
    """

    inputs: tuple[Component, ...]
    outputs: tuple[int, ...]
    moves: Moves | None = None
    listed: Array | None = None

    @property
    def is_decided(self) -> bool:
        """True where it is known to be one-to-one, or not to be."""
        return self.moves is not None or self.listed is not None

    def clash(self) -> tuple[Values, Values] | None:
        """Find two values with one image; None without any, or where it is not known."""
        if self.moves is not None:
            low, high = _ends(self.inputs)
            for i in np.flatnonzero(low < high):
                if i not in self.moves.source:
                    row = np.clip(np.zeros(len(low)), low, high)
                    changed = row.copy()
                    changed[i] = min(row[i] + 1, high[i])
                    if row[i] == high[i]:
                        changed[i] = max(row[i] - 1, low[i])
                    return _of_row(self.inputs, row), _of_row(self.inputs, changed)
            return None
        if self.listed is None:
            return None
        values = self.listed.astype(np.float32)  # as they are observed
        _, first, where = np.unique(values, axis=0, return_index=True, return_inverse=True)
        again = np.flatnonzero(first[where.reshape(-1)] != np.arange(len(values)))
        if not len(again):
            return None
        rows = np.array([first[where.reshape(-1)[again[0]]], again[0]])
        pair = _all(self.inputs, rows)
        one = _values(self.inputs, pair, 0)
        other = _values(self.inputs, pair, 1)
        return one, other


def parts(role: Role, inputs: Sequence[Component], nodes: Sequence[Node], is_tied: bool = False) -> tuple[MapPart, ...]:
    """Split a map of components into parts, which nodes read in a role; `is_tied` where node i becomes component i."""
    groups: list[tuple[set[str], list[int]]] = []
    for i, node in enumerate(nodes):
        names = {name for _, name in reads([node])} | ({inputs[i].name} if is_tied else set())
        numbers = [i]
        for group in [g for g in groups if g[0] & names]:
            groups.remove(group)
            names = names | group[0]
            numbers = [*group[1], *numbers]
        groups.append((names, numbers))
    unread = set(all_names(inputs)) - {name for names, _ in groups for name in names}
    groups += [({name}, []) for name in sorted(unread)]
    made = []
    for names, numbers in groups:
        chosen = tuple(c for c in inputs if c.name in names)
        made.append(_part(role, chosen, sorted(numbers), nodes))
    return tuple(made)


def bounds(part: MapPart) -> Iterator[tuple[float, float]]:
    """Yield bounds of each image element of a part whose form or values are known."""
    if part.listed is not None:
        low = part.listed.min(axis=0).tolist()
        high = part.listed.max(axis=0).tolist()
        yield from zip(map(float, low), map(float, high), strict=True)
    elif part.moves is not None:
        ends = [_made(part.moves, end) for end in _ends(part.inputs)]
        yield from zip(np.minimum(*ends).tolist(), np.maximum(*ends).tolist(), strict=True)


def _made(moves: Moves, flat: Array) -> Array:
    return moves.sign * np.append(flat, 0.0)[moves.source] + moves.shift


def _part(role: Role, inputs: tuple[Component, ...], numbers: list[int], nodes: Sequence[Node]) -> MapPart:
    chosen = [nodes[i] for i in numbers]
    outputs = tuple(numbers)
    moves = _moves(role, inputs, chosen)
    if moves is not None:
        return MapPart(inputs, outputs, moves)
    size = math.prod(counts_of(inputs)) if are_finite(inputs) else math.inf
    elements = total_size(chosen) + total_size(inputs)
    if size * elements > limits().points:
        return MapPart(inputs, outputs)
    read = {}
    for c, v in zip(inputs, _all(inputs, np.arange(int(size))), strict=True):
        read[(role, c.name)] = v
    listed = _rows(evaluate(chosen, read), int(size))
    with np.errstate(over="ignore"):
        are_numbers = np.isfinite(listed.astype(np.float32)).all()
    return MapPart(inputs, outputs, listed=listed if are_numbers else None)


# -- values -------------------------------------------------------------------------------------------------------


def _all(components: Sequence[Component], rows: Array) -> list[Array]:
    rest = rows
    values = []
    for c in reversed(components):
        digits = []
        for low, n in reversed(list(zip(c.low, c.counts, strict=True))):
            rest, digit = np.divmod(rest, n)
            digits.append(digit + int(low))
        values.append(np.array(digits[::-1]).reshape(*c.type.shape, len(rows)).astype(DTYPES[c.type.kind]))
    return values[::-1]


def _rows(values: Sequence[Array], lanes: int) -> Array:
    flat = []
    for v in values:
        flat.append(np.broadcast_to(v.reshape(-1, v.shape[-1]), (math.prod(v.shape[:-1]), lanes)))
    if flat:
        return np.concatenate(flat).T
    return np.zeros((lanes, 0), np.int64)


def _values(components: Sequence[Component], arrays: Sequence[Array], lane: int) -> Values:
    return {c.name: v[..., lane] for c, v in zip(components, arrays, strict=True)}


def _of_row(components: Sequence[Component], row: Array) -> Values:
    ends = np.cumsum([0, *(c.type.size for c in components)])
    values = {}
    for c, a, b in zip(components, ends, ends[1:], strict=False):
        values[c.name] = row[a:b].reshape(c.type.shape)
    return values


def _ends(components: Sequence[Component]) -> tuple[Array, Array]:
    low: list[float] = []
    high: list[float] = []
    for c in components:
        low += c.low
        high += c.high
    return np.array(low, np.float64), np.array(high, np.float64)


# -- elements that are moved --------------------------------------------------------------------------------------


def _moves(role: Role, inputs: Sequence[Component], nodes: Sequence[Node]) -> Moves | None:
    """Match moves of elements, if the form of the expressions shows that they do nothing else.

    Every element that comes out then depends on one that goes in, with a factor of 1 or -1; which one it is, numbers put in their
    places tell.
    """
    if any(c.type.kind is Kind.BOOL for c in inputs) or not all(map(_only_moves, nodes)):
        return None
    tags: dict[tuple[Role, str], Array] = {}
    zeros: dict[tuple[Role, str], Array] = {}
    at = 1
    for c in inputs:
        own = np.arange(at, at + c.type.size).reshape(*c.type.shape, 1).astype(DTYPES[c.type.kind])
        tags[role, c.name] = own
        zeros[role, c.name] = np.zeros_like(own)
        at += c.type.size
    low, high = _ends(inputs)
    is_int = np.array([c.type.kind is Kind.INT for c in inputs for _ in range(c.type.size)] + [False])
    room = np.where(is_int, np.append(np.maximum(np.abs(low), np.abs(high)), 0.0), math.inf)
    room[-1] = 0.0

    def told_apart(nodes: Sequence[Node], most: int) -> Moves | None:
        """Match moves of elements of nodes; None where they may round: sums with reals, or beyond `most`."""
        shift = _rows(evaluate(nodes, zeros), 1)[0].astype(np.float64)
        tagged = _rows(evaluate(nodes, tags), 1)[0].astype(np.float64)
        if not np.isfinite(shift).all():
            return None
        factor = np.rint(tagged - shift).astype(np.int64)
        source = np.abs(factor) - 1
        is_exact = (shift == np.rint(shift)) & (room[source] + np.abs(shift) <= most)
        becomes_real = np.array([n.type.kind is Kind.REAL for n in nodes for _ in range(n.type.size)], np.bool_)
        is_moved = (shift == 0) & ~(becomes_real & is_int[source])
        if not (is_moved | (source < 0) | is_exact).all():
            return None
        return Moves(source, np.sign(factor), shift)

    sums = []
    for node in walk(nodes):
        if isinstance(node, Apply) and node.op in ("add", "sub") and reads([node]):
            sums.append(node)
    inner = told_apart(sums, WHOLE)
    if inner is None or (np.abs(inner.shift) > WHOLE / 2).any():  # where tags would round, too
        return None
    return told_apart(nodes, EXACT)


def _only_moves(root: Node) -> bool:
    """Test whether each element of an expression is one element of its reads, with a factor of 1 or -1."""
    fixed: dict[int, bool] = {}
    for node in walk([root]):
        args = [fixed[id(c)] for c in children(node)]
        if isinstance(node, Draw):
            return False
        fixed[id(node)] = not isinstance(node, Read) and all(args)
        if isinstance(node, Apply) and not all(args) and not _moves_one(node, args):
            return False
    return True


def _moves_one(node: Apply, fixed: Sequence[bool]) -> bool:
    match node.op:
        case "neg" | "to_real":
            return True
        case "add" | "sub":
            return any(fixed)
        case "mul":
            return any(isinstance(a, Const) and all(abs(v) == 1 for v in a.flat) for a in node.args)
        case op:
            entry = entry_of(op)
            return entry.elements is Elements.MOVED and all(fixed[i] for i in entry.indices)


# -- maps of components to themselves -----------------------------------------------------------------------------


def codes(part: MapPart) -> Array:
    """Find the number of the image of each value of a listed part; -1 for one that is none of its values."""
    assert part.listed is not None
    numbers = np.zeros(len(part.listed), np.int64)
    at = 0
    wrong = np.zeros(len(part.listed), np.bool_)
    for c in part.inputs:
        for low, count in zip(c.low, c.counts, strict=True):
            digit = part.listed[:, at].astype(np.int64) - int(low)
            wrong |= (digit < 0) | (digit >= count)
            numbers = numbers * count + digit
            at = at + 1
    return np.where(wrong, -1, numbers)


def outside(part: MapPart) -> tuple[Values, Values] | None:
    """Find a value of a part that is mapped to no value of its components, with its image."""
    if part.listed is not None:
        wrong = np.flatnonzero(codes(part) < 0)
        if not len(wrong):
            return None
        lane = _values(part.inputs, _all(part.inputs, wrong[:1]), 0)
        return lane, _of_row(part.inputs, part.listed[wrong[0]])
    if part.moves is None:
        return None
    low, high = _ends(part.inputs)
    kinds = []
    for c in part.inputs:
        for _ in range(c.type.size):
            kinds.append(c.type.kind)
    same_kinds = []
    for kind, i in zip(kinds, part.moves.source, strict=True):
        same_kinds.append(i < 0 or kind is kinds[i])
    if list(bounds(part)) == list(zip(low, high, strict=True)) and all(same_kinds):
        return None
    for ends in (low, high):  # one of the two leaves the ranges, or does not reach all of them
        flat = np.where(np.isfinite(ends), ends, 0.0)
        made = _made(part.moves, flat)
        if ((made < low) | (made > high)).any():
            break
    return _of_row(part.inputs, flat), _of_row(part.inputs, made)
