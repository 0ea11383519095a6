"""How generated code tells the state in the info of a step: flat, in the order of the spec.

A number is read where it is held. An array is made once for each state and kept in `told`, so that the next step's
`old_state` costs nothing; it is made once for each episode where no step changes the state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from struct import Struct
from typing import Any

import numpy as np

from taskspec.backends.emit.lanevalues import UNROLLED
from taskspec.draws.stream import stream
from taskspec.lang.ir import Read
from taskspec.lang.types import Kind
from taskspec.task.spaces import FLOAT_MAX, SpaceLayout
from taskspec.task.task import Task


def sees_state(task: Task, layout: SpaceLayout) -> bool:
    """Whether an observation is the array that tells the state: its elements in order, as float32."""
    finite = all(c.is_finite for c in task.state)
    seen = [(node.role, node.name) for node in task.observation.nodes if isinstance(node, Read)]
    same = seen == [c.read for c in task.state] and len(seen) == len(task.observation.nodes)
    return same and layout.form == "box" and not finite


def _is_number(task: Task) -> bool:
    """Whether the state is one finite number."""
    (first, *others) = task.state
    return first.is_finite and first.type.is_scalar and not others


def flat_state(task: Task, names: Sequence[str]) -> str:
    """The source of the present state: an int where it is one finite number, else an array of its elements.

    They are int64 where all components are finite, and float32 elsewhere.
    """
    finite = all(c.is_finite for c in task.state)
    if _is_number(task):
        first = task.state[0]
        return f"(1 if {names[0]} else 0)" if first.type.kind is Kind.BOOL else names[0]
    items = _elements(task, names)
    shape = _shape(task)
    if any(abs(v) > FLOAT_MAX for c in task.state for v in (*c.low, *c.high)):
        return f"singles(({items},), {shape})"
    array = f"array(({items},), {'int64' if finite else 'float32'})"
    return array if len(shape) == 1 else f"{array}.reshape({shape})"


def _elements(task: Task, names: Sequence[str]) -> str:
    return ", ".join(name if c.type.is_scalar else f"*{name}" for c, name in zip(task.state, names, strict=True))


def _shape(task: Task) -> tuple[int, ...]:
    """The shape of the array that tells the state."""
    (first, *others) = task.state
    return (sum(c.type.size for c in task.state),) if others else first.type.shape


def is_kept(task: Task) -> bool:
    """Whether infos tell the state by an array, which is kept from step to step."""
    return bool(task.spec.info) and not _is_number(task)


def old_state(task: Task, names: Sequence[str]) -> list[str]:
    """The statement that keeps the state left, before the state moves on."""
    if "old_state" not in task.spec.info:
        return []
    return [f"old_state = {'told' if is_kept(task) else flat_state(task, names)}"]


def told_state(task: Task, layout: SpaceLayout, names: Sequence[str], observation: str) -> list[str]:
    """The statements that make the array for infos; a copy of the observation where that is the same array."""
    if not is_kept(task):
        return []
    source = observation.removesuffix(".copy()")
    if sees_state(task, layout) and source.isidentifier():
        return [f"told = {source}.copy()"]
    if has_rows(task):
        return ["told = next_row()", f"write(told, 0, {_elements(task, names)})"]
    return [f"told = {flat_state(task, names)}"]


def has_rows(task: Task) -> bool:
    """Whether the arrays for infos are rows of blocks, which takes half the time of arrays of their own."""
    return is_kept(task) and 0 < math.prod(_shape(task)) <= UNROLLED


def row_names(task: Task) -> dict[str, Any]:
    """What the names that write such rows mean: `rows()` gives a function of the next row, `write` fills it in."""
    shape = _shape(task)
    size = math.prod(shape)
    dtype, code = (np.int64, "q") if all(c.is_finite for c in task.state) else (np.float32, "f")
    blocks = partial(stream, lambda first, count: list(np.empty((count, *shape), dtype)), 0, size)
    return {"rows": blocks, "write": Struct(f"{size}{code}").pack_into}  # native floats: what overflows becomes inf


def info(task: Task, names: Sequence[str]) -> str:
    """The source of a step's info, after the state has moved on."""
    new_state = "told" if is_kept(task) else flat_state(task, names)
    sources = {"old_state": "old_state", "new_state": new_state}
    return "{" + ", ".join(f'"{name}": {sources[name]}' for name in task.spec.info) + "}"
