"""Generated code that reads an action, writes an observation, and fills the info of a step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from struct import Struct
from typing import Any

import numpy as np

from taskspec.language.expressions.ir import Node, Read
from taskspec.language.expressions.types import Kind, total_size
from taskspec.language.task.parts import are_finite
from taskspec.language.task.spaces import FLOAT_MAX, SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent, literal, names_of
from taskspec.programs.lane_form import UNROLLED, LaneEmitter, LaneValue
from taskspec.programs.scalar.phase import Phase, is_filled, stream


def read_action(task: Task, layout: SpaceLayout) -> tuple[list[str], list[LaneValue]]:
    """Write statements that read and check an action, and the values of its components."""
    names = names_of("a", task.action)
    (part,) = layout.parts
    if part.shape or not part.is_whole:
        return _read_array(task, layout, names)
    name = names[0]
    ((low, high),) = layout.ends
    lines = [
        "try:",
        f"    {name} = index(action)",
        "except TypeError:",
        "    raise bad_action(action) from None",
        f"if not {low} <= {name} <= {high}:",
        "    raise bad_action(action)",
    ]
    if task.action[0].type.kind is Kind.BOOL:
        lines.append(f"{name} = {name} != 0")
    return lines, [LaneValue([name])]


def _read_array(task: Task, layout: SpaceLayout, names: Sequence[str]) -> tuple[list[str], list[LaneValue]]:
    """Spread an array-like action over names, one for every element; arrays of unusual types are converted first."""
    flat: list[str] = []
    values = []
    for i, (c, name) in enumerate(zip(task.action, names, strict=True)):
        elements = [name] if c.type.is_scalar else [f"a{i}_{k}" for k in range(c.type.size)]
        flat += elements
        values.append(LaneValue(elements))
    whole = layout.parts[0].is_whole
    shape = layout.shape
    convert = "as_ints" if whole else "as_floats"
    usual = "action.dtype is int64" if whole else "action.dtype is float32 or action.dtype is float64"
    ravel = ".ravel()" if len(shape) > 1 else ""
    lines = [
        "try:",
        f"    if action.__class__ is not np.ndarray or action.shape != {shape} or not ({usual}):",
        f"        action = {convert}(action, {shape})",
        f"    {', '.join(flat)}{',' if shape else ''} = action{ravel}.tolist()",
        "except (TypeError, ValueError):",
        "    raise bad_action(action) from None",
    ]
    numbers = zip(flat, layout.ends, strict=True)
    for c, segment in zip(task.action, layout.segments, strict=True):
        for start in segment.starts or (0,) * segment.size:
            name, (low, high) = next(numbers)
            lines += [f"if not {literal(low)} <= {name} <= {literal(high)}:", "    raise bad_action(action)"]
            if whole and c.type.kind is Kind.BOOL:
                lines.append(f"{name} = {name} != 0")
            elif not whole and c.type.kind is not Kind.REAL:  # every point of the space is an action
                lines.append(f"{name} = round({name})")
            elif start:
                lines.append(f"{name} = {name} + {start}")
    return lines, values


# -- the state in infos -------------------------------------------------------------------------------------------
#
# A number is read where it is held. An array is made once for each state and kept in `told`, so that the next step's
# `old_state` costs nothing; it is made once for each episode where no step changes the state.


def sees_state(task: Task, layout: SpaceLayout) -> bool:
    """Test whether an observation is the array of the state: its elements in order, as float32."""
    finite = are_finite(task.state)
    seen = []
    for node in task.observation.nodes:
        if isinstance(node, Read):
            seen.append((node.role, node.name))
    same = seen == [c.read for c in task.state] and len(seen) == len(task.observation.nodes)
    return same and layout.form == "box" and not finite


def _is_number(task: Task) -> bool:
    (first, *others) = task.state
    return first.is_finite and first.type.is_scalar and not others


def flat_state(task: Task, names: Sequence[str]) -> str:
    """Source of the present state: an int where it is one finite number, else an array of its elements.

    They are int64 where all components are finite, and float32 elsewhere.
    """
    finite = are_finite(task.state)
    if _is_number(task):
        first = task.state[0]
        if first.type.kind is Kind.BOOL:
            return f"(1 if {names[0]} else 0)"
        return names[0]
    items = _info_elements(task, names)
    shape = _shape(task)
    if any(abs(v) > FLOAT_MAX for c in task.state for v in (*c.low, *c.high)):
        return f"singles(({items},), {shape})"
    array = f"array(({items},), {'int64' if finite else 'float32'})"
    if len(shape) == 1:
        return array
    return f"{array}.reshape({shape})"


def _info_elements(task: Task, names: Sequence[str]) -> str:
    parts = []
    for c, name in zip(task.state, names, strict=True):
        if c.type.is_scalar:
            parts.append(name)
        else:
            parts.append(f"*{name}")
    return ", ".join(parts)


def _shape(task: Task) -> tuple[int, ...]:
    (first, *others) = task.state
    if others:
        return (total_size(task.state),)
    return first.type.shape


def is_kept(task: Task) -> bool:
    """Test whether infos contain the state as an array, which is kept from step to step."""
    return bool(task.info) and not _is_number(task)


def old_state(task: Task, names: Sequence[str]) -> list[str]:
    """Keep the state left, before the state moves on."""
    if "old_state" not in task.info:
        return []
    return [f"old_state = {'told' if is_kept(task) else flat_state(task, names)}"]


def told_state(task: Task, layout: SpaceLayout, names: Sequence[str], observation: str) -> list[str]:
    """Make the array for infos; a copy of the observation where that is the same array."""
    if not is_kept(task):
        return []
    source = observation.removesuffix(".copy()")
    if sees_state(task, layout) and source.isidentifier():
        return [f"told = {source}.copy()"]
    if has_rows(task):
        return ["told = next_row()", f"write(told, 0, {_info_elements(task, names)})"]
    return [f"told = {flat_state(task, names)}"]


def has_rows(task: Task) -> bool:
    """Test whether the arrays for infos are rows of blocks, which takes half the time of arrays of their own."""
    return is_kept(task) and 0 < math.prod(_shape(task)) <= UNROLLED


def row_names(task: Task) -> dict[str, Any]:
    """Functions that write such rows: `rows()` gives a function of the next row, `write` fills it in."""
    shape = _shape(task)
    size = math.prod(shape)
    dtype, code = (np.int64, "q") if are_finite(task.state) else (np.float32, "f")
    blocks = partial(stream, lambda first, count: list(np.empty((count, *shape), dtype)), 0, size)
    return {"rows": blocks, "write": Struct(f"{size}{code}").pack_into}  # native floats: what overflows becomes inf


def info(task: Task, names: Sequence[str], measures: Sequence[str]) -> str:
    """Source of a step's info, after the state has moved on; `measures` are the sources of their values."""
    new_state = "told"
    if not is_kept(task):
        new_state = flat_state(task, names)
    sources = {"old_state": "old_state", "new_state": new_state}
    items = [f'"{name}": {sources[name]}' for name in task.info]
    if measures:
        values = zip(task.process.measures, measures, strict=True)
        items.append('"measures": {' + ", ".join(f"{name!r}: {source}" for name, source in values) + "}")
    if task.mask:
        items.append(MASKED)
    return "{" + ", ".join(items) + "}"


MASKED = '"action_mask": mask()'
"""The legal actions in the info of a step or a reset."""


def mask(task: Task, lane: LaneEmitter) -> list[str]:
    """Write the function `mask`, which gives the legal actions of the present state as int8 (n,); None where all are."""
    if not task.mask:
        return ["mask = None"]
    (node,) = task.mask
    lane.emit([node])
    result = f"return array(({', '.join(lane.atoms(node))},), int8)"
    return ["def mask():", *indent(lane.finish([result]))]


# -- the observation ----------------------------------------------------------------------------------------------

_LARGEST = 3.4e38
"""Below the largest float32."""


def observe(lane: LaneEmitter, layout: SpaceLayout, phase: Phase, values: Sequence[LaneValue]) -> tuple[str, list[str]]:
    """Source of the observation, and the statements that fill it in."""
    nodes = phase.observation
    match layout.form:
        case "discrete":
            return _integer(lane, nodes[0]), []
        case "box" if phase.row_size:
            return _row(lane, nodes, layout)
        case "box":
            return _array(lane, nodes[0], lane.scalar(nodes[0])), []
        case "multi_discrete":
            atoms = []
            for a, start in zip(_all_atoms(lane, nodes), layout.starts, strict=True):
                atoms.append(_shifted(a, start))
            return f"np.array(({', '.join(atoms)},), np.int64)", []
        case "one_hot":
            return _one_hot(lane, nodes, layout)
        case "dict":
            return _dictionary(lane, nodes, layout), []


def _integer(lane: LaneEmitter, node: Node) -> str:
    atom = lane.scalar(node)
    if node.type.kind is Kind.BOOL:
        return f"(1 if {atom} else 0)"
    return atom


def _all_atoms(lane: LaneEmitter, nodes: Sequence[Node]) -> list[str]:
    atoms = []
    for node in nodes:
        atoms += lane.atoms(node)
    return atoms


def _shifted(atom: str, start: int) -> str:
    if start == 0:
        return atom
    if start > 0:
        return f"{atom} - {start}"
    return f"{atom} + {-start}"


def _row(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> tuple[str, list[str]]:
    """Write runs of elements into the fresh row `o`; values that the block filled in are left alone."""
    statements: list[str] = []
    run: list[Node] = []
    offset = start = 0
    sizes = [c.type.size for c in layout.components]
    for node, size in zip([*nodes, None], [*sizes, 0], strict=True):
        if node is None or is_filled(node):
            statements += _write(lane, start, run)
            run = []
        else:
            if not (run):
                start = offset
            run.append(node)
        offset += size
    return "o", statements


def _write(lane: LaneEmitter, start: int, run: Sequence[Node]) -> list[str]:
    if not run:
        return []
    size = total_size(run)
    if size == 1 and not _may_overflow(lane, run[0]):
        return [f"o[{start}] = {lane.scalar(run[0])}"]
    items = []
    for n in run:
        if n.type.size > UNROLLED:
            items.append(f"*{lane.packed(n)}")
        else:
            items.append(", ".join(lane.atoms(n)))
    writer = lane.constant(Struct(f"{size}f").pack_into)  # native floats: what overflows becomes inf
    return [f"{writer}(o, {4 * start}, {', '.join(items)})"]


def _one_hot(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> tuple[str, list[str]]:
    name = lane.name()
    statements = [f"{name} = np.zeros({layout.size}, np.float32)"]
    offset = 0
    bounds = []
    for node in nodes:
        for _ in range(node.type.size):
            bounds.append(lane.certain(node))
    places = zip(_all_atoms(lane, nodes), bounds, layout.starts, layout.counts, strict=True)
    for atom, (low, high), start, count in places:
        statement = f"{name}[{offset} + {_shifted(atom, start)}] = 1.0"
        if low < start or start + count <= high:
            statement = f"if {start} <= {atom} < {start + count}: {statement}"
        statements.append(statement)
        offset += count
    return name, statements


def _may_overflow(lane: LaneEmitter, node: Node) -> bool:
    return max(map(abs, lane.certain(node))) > _LARGEST


def _array(lane: LaneEmitter, node: Node, source: str) -> str:
    shape = node.type.shape
    if _may_overflow(lane, node):
        return f"singles({source}, {shape})"
    array = f"np.array({source}, np.float32)"
    if len(shape) > 1:
        return f"{array}.reshape({shape})"
    return array


def _dictionary(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> str:
    items = []
    for node, c in zip(nodes, layout.components, strict=True):
        if c.is_finite and c.type.is_scalar:
            items.append(f"{c.name!r}: {_integer(lane, node)}")
        else:
            if c.type.is_scalar:
                source = lane.scalar(node)
            else:
                source = lane.packed(node)
            items.append(f"{c.name!r}: {_array(lane, node, source)}")
    return "{" + ", ".join(items) + "}"
