"""Operators that only move elements about, in the lane form."""

from __future__ import annotations

from collections.abc import Callable

from taskspec.backends.emit.lanevalues import LaneValue, LaneValues
from taskspec.backends.emit.source import tuple_of
from taskspec.lang.ir import Apply, Const, Node, plain
from taskspec.lang.operators.structure import strided


def _vector(lane: LaneValues, node: Apply) -> LaneValue:
    if node.type.size <= lane.unrolled:
        return LaneValue([atom for arg in node.args for atom in lane.atoms(arg)])
    parts = [f"*{lane.packed(a)}" if a.type.size > lane.unrolled else ", ".join(lane.atoms(a)) for a in node.args]
    return LaneValue(packed=lane.assign(tuple_of(parts)))


def _slice(lane: LaneValues, node: Apply) -> LaneValue:
    start, count, step = node.static
    row = strided(node.args[0].type.shape)
    value = lane.values[id(node.args[0])]
    places = [(start + k * step) * row + i for k in range(count) for i in range(row)]
    if value.atoms is not None:
        return LaneValue([value.atoms[p] for p in places])
    if row == 1 or step == 1:
        stop: int | None = (start + count * step) * row
        stop = None if stop is not None and stop < 0 else stop
        return LaneValue(
            packed=lane.assign(
                f"{value.packed}[{start * row}:{'' if stop is None else stop}:{step if row == 1 else 1}]"
            )
        )
    return LaneValue(packed=lane.assign(tuple_of([f"{value.packed}[{p}]" for p in places])))


def _element(lane: LaneValues, node: Apply) -> LaneValue:
    row = node.type.size
    first = node.static[0] * row
    value = lane.values[id(node.args[0])]
    if value.atoms is not None:
        return LaneValue(value.atoms[first : first + row])
    if not node.type.shape:
        return LaneValue([f"{value.packed}[{first}]"])
    return LaneValue(packed=lane.assign(f"{value.packed}[{first}:{first + row}]"))


def _fill(lane: LaneValues, node: Apply) -> LaneValue:
    atom = lane.assign(lane.scalar(node.args[0]))
    if node.type.size <= lane.unrolled:
        return LaneValue([atom] * node.type.size)
    return LaneValue(packed=lane.assign(f"({atom},) * {node.type.size}"))


def _index(lane: LaneValues, node: Apply) -> LaneValue:
    x, i = node.args
    row = strided(x.type.shape)
    picked = [_row(lane, x, index, row) for index in lane.atoms(i)]
    if len(picked) == 1:
        return picked[0]
    if all(p.atoms is not None for p in picked):
        return LaneValue([a for p in picked for a in p.atoms or ()])
    return LaneValue(packed=lane.assign(f"({', '.join(f'*{p.packed}' for p in picked)})"))


def _row(lane: LaneValues, x: Node, index: str, row: int) -> LaneValue:
    """One row of x: an expression when it is a single element."""
    if row == 1:
        return LaneValue([f"{_sequence(lane, x)}[{index}]"])
    if isinstance(x, Const):
        flat = [plain(v) for v in x.flat]
        rows = tuple(tuple(flat[k : k + row]) for k in range(0, len(flat), row))
        return LaneValue(packed=lane.assign(f"{lane.constant(rows)}[{index}]"))
    index = lane.assign(index)
    return LaneValue(packed=lane.assign(f"{lane.packed(x)}[{index} * {row}:{index} * {row} + {row}]"))


def _sequence(lane: LaneValues, x: Node) -> str:
    """A flat sequence to index; a constant one is kept outside the step."""
    if isinstance(x, Const):
        return lane.constant(tuple(plain(v) for v in x.flat))
    value = lane.values[id(x)]
    if value.packed is None and len(value.atoms or ()) <= lane.unrolled:
        return tuple_of(lane.atoms(x))
    return lane.packed(x)


def _put(lane: LaneValues, node: Apply) -> LaneValue:
    x, i, value = node.args
    row = value.type.size
    name = lane.name()
    lane.lines.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.lines.append(f"{name}[{lane.scalar(i)}] = {lane.scalar(value)}")
    else:
        at = lane.assign(lane.scalar(i))
        lane.lines.append(f"{name}[{at} * {row}:{at} * {row} + {row}] = {lane.packed(value)}")
    return LaneValue(packed=name)


def _swap(lane: LaneValues, node: Apply) -> LaneValue:
    x, i, j = node.args
    row = strided(x.type.shape)
    name, a, b = lane.name(), lane.assign(lane.scalar(i)), lane.assign(lane.scalar(j))
    lane.lines.append(f"{name} = list({lane.packed(x)})")
    if row == 1:
        lane.lines.append(f"{name}[{a}], {name}[{b}] = {name}[{b}], {name}[{a}]")
    else:
        p, q = (f"{name}[{k} * {row}:{k} * {row} + {row}]" for k in (a, b))
        lane.lines.append(f"{p}, {q} = {q}, {p}")
    return LaneValue(packed=name)


STRUCTURE: dict[str, Callable[[LaneValues, Apply], LaneValue]] = {
    "vector": _vector,
    "concat": _vector,
    "slice": _slice,
    "element": _element,
    "reshape": lambda lane, node: lane.values[id(node.args[0])],
    "fill": _fill,
    "index": _index,
    "put": _put,
    "swap": _swap,
}
"""The value of a node of `lang.operators.structure`, whose arguments have theirs."""
