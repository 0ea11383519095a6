"""How generated code tells the state in the info of a step: flat, in the order of the spec.

`new_state` is kept from step to step, so that the next one's `old_state` costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.lang.types import Kind
from taskspec.task.spaces import FLOAT_MAX, SpaceLayout
from taskspec.task.task import Task


def sees_state(task: Task, layout: SpaceLayout) -> bool:
    """Whether an observation is the array that tells the state."""
    finite = all(c.is_finite for c in task.state)
    return task.observation.is_state and not task.observe_time and layout.form == "box" and not finite


def flat_state(task: Task, names: Sequence[str]) -> str:
    """The source of the present state: an int where it is one finite number, else an array of its elements.

    They are int64 where all components are finite, and float32 elsewhere.
    """
    (first, *others) = task.state
    finite = all(c.is_finite for c in task.state)
    if finite and not others and first.type.is_scalar:
        return f"(1 if {names[0]} else 0)" if first.type.kind is Kind.BOOL else names[0]
    items = ", ".join(name if c.type.is_scalar else f"*{name}" for c, name in zip(task.state, names, strict=True))
    shape = first.type.shape if not others else (sum(c.type.size for c in task.state),)
    if any(abs(v) > FLOAT_MAX for c in task.state for v in (*c.low, *c.high)):
        return f"singles(({items},), {shape})"
    array = f"np.array(({items},), np.{'int64' if finite else 'float32'})"
    return array if len(shape) == 1 else f"{array}.reshape({shape})"


def told_state(task: Task, layout: SpaceLayout, names: Sequence[str], observation: str) -> list[str]:
    """The statement that keeps the state reached for infos; a copy of the observation where that is the same array."""
    if not task.spec.info:
        return []
    source = observation.removesuffix(".copy()")
    if sees_state(task, layout) and source.isidentifier():
        return [f"new_state = {source}.copy()"]
    return [f"new_state = {flat_state(task, names)}"]


def info(task: Task) -> str:
    """The source of a step's info."""
    return "{" + ", ".join(f'"{name}": {name}' for name in task.spec.info) + "}"
