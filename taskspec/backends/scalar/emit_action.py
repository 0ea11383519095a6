"""How a generated step reads its action: converted, checked, spread over names."""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.backends.emit.lanevalues import LaneValue
from taskspec.backends.emit.source import literal
from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Component, Task


def names_of(prefix: str, components: Sequence[Component]) -> list[str]:
    return [f"{prefix}_{c.name}" if c.name.isascii() else f"{prefix}_{i}" for i, c in enumerate(components)]


def read_action(task: Task, layout: SpaceLayout) -> tuple[list[str], list[LaneValue]]:
    """Statements that read and check an action, and the values of its components."""
    names, (part,) = names_of("a", task.action), layout.parts
    if part.is_whole and not part.shape:
        return _read_number(names[0], task.action[0], layout), [LaneValue([names[0]])]
    return _read_array(task, layout, names)


def _read_number(name: str, c: Component, layout: SpaceLayout) -> list[str]:
    ((low, high),) = layout.ends
    value = f"{name} != 0" if c.type.kind is Kind.BOOL else name
    lines = [
        "try:",
        f"    {name} = index(action)",
        "except TypeError:",
        "    raise bad_action(action) from None",
    ]
    lines += [f"if not {low} <= {name} <= {high}:", "    raise bad_action(action)"]
    return lines if value == name else [*lines, f"{name} = {value}"]


def _elements(task: Task, names: Sequence[str]) -> tuple[list[str], list[LaneValue]]:
    """A name for every element of the action, and the components made of them."""
    flat, values = [], []
    for i, (c, name) in enumerate(zip(task.action, names, strict=True)):
        mine = [name] if c.type.is_scalar else [f"a{i}_{k}" for k in range(c.type.size)]
        flat += mine
        values.append(LaneValue(mine))
    return flat, values


def _listed(shape: tuple[int, ...], names: Sequence[str], convert: str, usual: str) -> list[str]:
    """Statements that spread an array-like action over names; anything of another shape is refused.

    An array that meets the condition `usual` is taken as it is, all else goes through the function `convert`.
    """
    ravel = ".ravel()" if len(shape) > 1 else ""
    return [
        "try:",
        f"    if action.__class__ is not np.ndarray or action.shape != {shape} or not ({usual}):",
        f"        action = {convert}(action, {shape})",
        f"    {', '.join(names)}{',' if shape else ''} = action{ravel}.tolist()",
        "except (TypeError, ValueError):",
        "    raise bad_action(action) from None",
    ]


def _read_array(task: Task, layout: SpaceLayout, names: Sequence[str]) -> tuple[list[str], list[LaneValue]]:
    flat, values = _elements(task, names)
    whole = layout.parts[0].is_whole
    usual = "action.dtype is int64" if whole else "action.dtype is float32 or action.dtype is float64"
    lines = _listed(layout.shape, flat, "as_ints" if whole else "as_floats", usual)
    numbers = zip(flat, layout.ends, strict=True)
    for c, segment in zip(task.action, layout.segments, strict=True):
        for start in segment.starts or (0,) * segment.size:
            name, (low, high) = next(numbers)
            lines += [f"if not {literal(low)} <= {name} <= {literal(high)}:", "    raise bad_action(action)"]
            value = f"{name} + {start}" if start else name
            if whole:
                value = f"{name} != 0" if c.type.kind is Kind.BOOL else value
            elif c.type.kind is not Kind.REAL:  # every point of the space is an action
                value = f"round({name})"
            lines += [f"{name} = {value}"] if value != name else []
    return lines, values
