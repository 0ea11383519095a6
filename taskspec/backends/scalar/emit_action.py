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
    names = names_of("a", task.action)
    match layout.form:
        case "discrete":
            return _read_discrete(names[0], task.action[0]), [LaneValue([names[0]])]
        case "multi_discrete":
            return _read_multi(task, names)
        case _:
            return _read_box(task, layout, names)


def _read_discrete(name: str, c: Component) -> list[str]:
    low, high = int(c.low[0]), int(c.high[0])
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


def _read_multi(task: Task, names: Sequence[str]) -> tuple[list[str], list[LaneValue]]:
    flat, values = _elements(task, names)
    lines = _listed((len(flat),), flat, "as_ints", "action.dtype is int64")
    k = 0
    for c in task.action:
        for count, start in zip(c.counts, c.low, strict=True):
            name = flat[k]
            lines += [
                f"if not 0 <= {name} < {count}:",
                "    raise bad_action(action)",
            ]
            shifted = f"{name} + {int(start)}" if start else name
            shifted = f"{name} != 0" if c.type.kind is Kind.BOOL else shifted
            lines += [f"{name} = {shifted}"] if shifted != name else []
            k += 1
    return lines, values


def _read_box(task: Task, layout: SpaceLayout, names: Sequence[str]) -> tuple[list[str], list[LaneValue]]:
    flat, values = _elements(task, names)
    lines = _listed(layout.shape, flat, "as_floats", "action.dtype is float32 or action.dtype is float64")
    kinds = [c.type.kind for c in task.action for _ in range(c.type.size)]
    for name, (low, high), kind in zip(flat, layout.limits, kinds, strict=True):
        lines += [
            f"if not {literal(low)} <= {name} <= {literal(high)}:",
            "    raise bad_action(action)",
        ]
        if kind is not Kind.REAL:  # every point of the space is an action
            lines.append(f"{name} = round({name})")
    return lines, values
