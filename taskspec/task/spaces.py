"""How observations and actions are laid out as Gymnasium values: the rules of the language, free of Gymnasium itself.

One finite scalar is `discrete`. Several finite action components are `multi_discrete`. Anything else is one float32
`box` of the elements in order; an action that is one number is a vector of one element, as learners expect, unless its spec says
`shape: []`. The author may choose otherwise for observations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from taskspec.lang.types import INT_MAX, Kind
from taskspec.task.task import Component, SpaceKind, Task

FLOAT_MAX = 3.4028234663852886e38
INT_SINGLE = 2.0**31 - 128
"""The largest float32 that is an int of 32 bits."""
Form = Literal["discrete", "multi_discrete", "box", "one_hot", "dict"]


@dataclass(frozen=True)
class SpaceLayout:
    """Components as one Gymnasium value.

    `shape` is that of the array (`box`, `multi_discrete`, `one_hot`); `low` and `high` are the bounds of a box, flat.
    """

    form: Form
    components: tuple[Component, ...]
    shape: tuple[int, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value of each element of a box that is an action: finite, and ints that 32 bits hold."""
        most = [FLOAT_MAX if c.type.kind is Kind.REAL else INT_MAX for c in self.components for _ in range(c.type.size)]
        return tuple((max(a, -m), min(b, m)) for a, b, m in zip(self.low, self.high, most, strict=True))

    @property
    def counts(self) -> tuple[int, ...]:
        """How many values each finite element takes."""
        return tuple(n for c in self.components for n in c.counts)

    @property
    def starts(self) -> tuple[int, ...]:
        """The lowest value of each finite element: what 0 stands for in `multi_discrete` and `one_hot`."""
        return tuple(int(v) for c in self.components for v in c.low)


def observation_layout(task: Task) -> SpaceLayout:
    return _layout(task.observation.components, task.observation.space, several="box")


def action_layout(task: Task) -> SpaceLayout:
    """The action as one value. Ints of a box end where actions do, so that all that is sampled from it is taken."""
    layout = _layout(task.action, "auto", several="multi_discrete")
    if layout.form != "box":
        return layout
    most = [math.inf if c.type.kind is Kind.REAL else INT_SINGLE for c in task.action for _ in range(c.type.size)]
    low = tuple(a if math.isinf(a) else max(a, -m) for a, m in zip(layout.low, most, strict=True))
    high = tuple(b if math.isinf(b) else min(b, m) for b, m in zip(layout.high, most, strict=True))
    shape = layout.shape if layout.shape or _says_number(task) else (1,)
    return replace(layout, shape=shape, low=low, high=high)


def _says_number(task: Task) -> bool:
    """Whether the spec says that the action has no axis: `shape: []`."""
    return all(entry.shape is not None for entry in task.spec.action.values())


def _layout(components: tuple[Component, ...], space: SpaceKind, several: Form) -> SpaceLayout:
    form: Form = _automatic(components, several) if space == "auto" else space
    match form:
        case "discrete":
            return SpaceLayout(form, components)
        case "multi_discrete":
            return SpaceLayout(form, components, (sum(c.type.size for c in components),))
        case "one_hot":
            return SpaceLayout(form, components, (sum(n for c in components for n in c.counts),))
        case "dict":
            return SpaceLayout(form, components)
        case "box":
            return _box(components)


def _automatic(components: tuple[Component, ...], several: Form) -> Form:
    finite = all(c.is_finite for c in components)
    if finite and len(components) == 1 and components[0].type.is_scalar:
        return "discrete"
    return several if finite else "box"


def _box(components: tuple[Component, ...]) -> SpaceLayout:
    shape = components[0].type.shape if len(components) == 1 else (sum(c.type.size for c in components),)
    low = tuple(single(v) for c in components for v in c.low)
    high = tuple(single(v) for c in components for v in c.high)
    return SpaceLayout("box", components, shape, low, high)


def single(value: float) -> float:
    """A bound as float32 holds it: values are compared in the precision they arrive in."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def singles(values: Any, shape: tuple[int, ...]) -> Any:
    """Numbers as a float32 array; those that are too large become infinite, without a warning."""
    with np.errstate(over="ignore"):
        return np.array(values, np.float32).reshape(shape)


def pack(layout: SpaceLayout, flats: Sequence[tuple[Any, ...]]) -> Any:
    """Component values, flat row-major, as one Gymnasium value."""
    items = [value for flat in flats for value in flat]
    match layout.form:
        case "discrete":
            return int(items[0])
        case "multi_discrete":
            return np.array(items, np.int64) - np.array(layout.starts, np.int64)
        case "one_hot":
            return _one_hot(layout, items)
        case "dict":
            return {c.name: _entry(c, flat) for c, flat in zip(layout.components, flats, strict=True)}
        case "box":
            return singles(items, layout.shape)


def _one_hot(layout: SpaceLayout, items: Sequence[Any]) -> Any:
    row = np.zeros(layout.size, np.float32)
    offset = 0
    for item, start, count in zip(items, layout.starts, layout.counts, strict=True):
        if 0 <= item - start < count:  # as `onehot(i, n)` has it: outside, no place is 1
            row[offset + int(item) - start] = 1.0
        offset += count
    return row


def _entry(c: Component, flat: tuple[Any, ...]) -> Any:
    if c.is_finite and c.type.is_scalar:
        return int(flat[0])
    return singles(flat, c.type.shape)


def unpack(layout: SpaceLayout, action: Any) -> list[tuple[Any, ...]]:
    """A valid action (or observation) of a layout as flat component values."""
    if layout.form == "dict":
        return [tuple(np.asarray(action[c.name]).ravel().tolist()) for c in layout.components]
    items = np.asarray(action).ravel().tolist()
    if layout.form == "multi_discrete":
        items = [item + start for item, start in zip(items, layout.starts, strict=True)]
    flats, offset = [], 0
    for c in layout.components:
        flat = items[offset : offset + c.type.size]
        flats.append(tuple(flat if c.type.kind is Kind.REAL else map(round, flat)))
        offset += c.type.size
    return flats
