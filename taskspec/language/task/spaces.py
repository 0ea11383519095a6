"""Observations and actions as Gymnasium values and spaces.

One finite scalar is `discrete`. Several finite action components are `multi_discrete`. Anything else is one float32
`box` of the elements in order; an action that is one number is a vector of one element, as learners expect, unless its spec
says `shape: []`. The author may choose otherwise for observations. Gymnasium itself is imported only where a space is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taskspec.language.expressions.types import INT_MAX, Kind, total_size
from taskspec.language.task.parts import Component, Observation, SpaceKind, are_finite, counts_of

if TYPE_CHECKING:
    import gymnasium

FLOAT_MAX = 3.4028234663852886e38
INT_SINGLE = 2.0**31 - 128
"""The largest float32 that is an int of 32 bits."""
Form = Literal["discrete", "multi_discrete", "box", "one_hot", "dict"]


@dataclass(frozen=True, slots=True)
class Part:
    """One array of a value, or a key of a dict: whole numbers, which are int64 in NumPy, or else float32.

    `name` is the key. A `shape` of () is a single number.
    """

    name: str | None
    shape: tuple[int, ...]
    is_whole: bool


@dataclass(frozen=True, slots=True)
class Segment:
    """Numbers that stand side by side in a part, from number `first` on, and are of one component.

    They are the elements of component number `component`, each less its number of `starts`, if there are any; or they say
    whether the element number `element` is each of some `values`.
    """

    part: int
    first: int
    component: int
    size: int
    starts: tuple[int, ...] = ()
    element: int = 0
    values: range | None = None

    def columns(self, rows: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Numbers (N, size) of many values at once, from the elements (N, elements) of the component."""
        if self.values is not None:
            return np.asarray(rows[:, self.element, None] == np.array(self.values))
        if self.starts:
            return np.asarray(rows - np.array(self.starts))
        return rows


@dataclass(frozen=True)
class SpaceLayout:
    """Components as one Gymnasium value.

    `shape` is the shape of the array (`box`, `multi_discrete`, `one_hot`); `low` and `high` are the bounds of a box, flat.
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
        most = []
        for c in self.components:
            for _ in range(c.type.size):
                if c.type.kind is Kind.REAL:
                    most.append(FLOAT_MAX)
                else:
                    most.append(INT_MAX)
        intervals = []
        for a, b, m in zip(self.low, self.high, most, strict=True):
            intervals.append((max(a, -m), min(b, m)))
        return tuple(intervals)

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value of each number of an action."""
        if self.form == "box":
            return self.limits
        if self.form == "discrete":
            starts = self.starts
        else:
            starts = (0,) * len(self.counts)
        intervals = []
        for start, count in zip(starts, self.counts, strict=True):
            intervals.append((start, start + count - 1))
        return tuple(intervals)

    @property
    def is_dict(self) -> bool:
        """True where each part has a key."""
        return self.form == "dict"

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The arrays of a value: one for every key of a dict, otherwise a single one."""
        if self.form == "dict":
            parts = []
            for c in self.components:
                parts.append(Part(c.name, c.type.shape, c.is_finite and c.type.is_scalar))
            return tuple(parts)
        return (Part(None, self.shape, self.form in ("discrete", "multi_discrete")),)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The segments of the numbers of the parts, in their order."""
        parts: list[Segment] = []
        first = 0
        for i, c in enumerate(self.components):
            starts: tuple[int, ...] = ()
            if self.form in ("multi_discrete", "one_hot"):
                starts = tuple(map(int, c.low))
            if self.form == "dict":
                parts.append(Segment(i, 0, i, c.type.size))
            elif self.form == "one_hot":
                for k, (start, count) in enumerate(zip(starts, c.counts, strict=True)):
                    parts.append(Segment(0, first, i, count, element=k, values=range(start, start + count)))
                    first += count
            else:
                parts.append(Segment(0, first, i, c.type.size, starts if any(starts) else ()))
                first += c.type.size
        return tuple(parts)

    @property
    def counts(self) -> tuple[int, ...]:
        """The number of values of each finite element."""
        return tuple(counts_of(self.components))

    @property
    def starts(self) -> tuple[int, ...]:
        """The lowest value of each finite element, which is 0 in `multi_discrete` and `one_hot`."""
        return tuple(int(v) for c in self.components for v in c.low)


def observation_layout(observation: Observation) -> SpaceLayout:
    return _layout(observation.components, observation.space, several="box")


def action_layout(action: tuple[Component, ...], is_number: bool) -> SpaceLayout:
    """Layout of the action as one value; `is_number` says that its spec gives it no axis (`shape: []`).

    Ints of a box end where actions do, so that all that is sampled from it is valid.
    """
    layout = _layout(action, "auto", several="multi_discrete")
    if layout.form != "box":
        return layout
    most = []
    for c in action:
        for _ in range(c.type.size):
            if c.type.kind is Kind.REAL:
                most.append(math.inf)
            else:
                most.append(INT_SINGLE)
    low = list(layout.low)
    high = list(layout.high)
    for i, m in enumerate(most):
        if not math.isinf(low[i]):
            low[i] = max(low[i], -m)
        if not math.isinf(high[i]):
            high[i] = min(high[i], m)
    if layout.shape or is_number:
        shape = layout.shape
    else:
        shape = (1,)
    return replace(layout, shape=shape, low=tuple(low), high=tuple(high))


def _layout(components: tuple[Component, ...], space: SpaceKind, several: Form) -> SpaceLayout:
    form: Form = "box"
    if space != "auto":
        form = space
    elif are_finite(components):
        form = several
        if len(components) == 1 and components[0].type.is_scalar:
            form = "discrete"
    match form:
        case "discrete" | "dict":
            return SpaceLayout(form, components)
        case "multi_discrete":
            return SpaceLayout(form, components, (total_size(components),))
        case "one_hot":
            return SpaceLayout(form, components, (sum(counts_of(components)),))
        case "box":
            if len(components) == 1:
                shape = components[0].type.shape
            else:
                shape = (total_size(components),)
            low = tuple(single(v) for c in components for v in c.low)
            high = tuple(single(v) for c in components for v in c.high)
            return SpaceLayout(form, components, shape, low, high)


def space(layout: SpaceLayout) -> gymnasium.Space[Any]:
    """Gymnasium space that contains the values of a layout."""
    from gymnasium import spaces

    match layout.form:
        case "discrete":
            return _component_space(layout.components[0])
        case "multi_discrete":
            return spaces.MultiDiscrete(np.array(layout.counts, np.int64))
        case "one_hot":
            return spaces.Box(0.0, 1.0, layout.shape, np.float32)
        case "dict":
            return spaces.Dict({c.name: _component_space(c) for c in layout.components})
        case "box":
            return _box_space(layout.low, layout.high, layout.shape)


def _component_space(c: Component) -> gymnasium.Space[Any]:
    from gymnasium.spaces import Discrete

    if c.is_finite and c.type.is_scalar:
        return Discrete(c.counts[0], start=int(c.low[0]))
    return _box_space(tuple(map(single, c.low)), tuple(map(single, c.high)), c.type.shape)


def _box_space(low: tuple[float, ...], high: tuple[float, ...], shape: tuple[int, ...]) -> gymnasium.Space[Any]:
    """Make a float32 box. Gymnasium 0.29 refuses lower bounds of +inf and upper ones of -inf: constants that are infinite."""
    from gymnasium.spaces import Box

    lows = np.array(np.minimum(low, FLOAT_MAX), np.float32).reshape(shape)
    highs = np.array(np.maximum(high, -FLOAT_MAX), np.float32).reshape(shape)
    return Box(lows, highs, dtype=np.float32)


def single(value: float) -> float:
    """Round a bound to float32: values are compared in the precision they arrive in."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def singles(values: Any, shape: tuple[int, ...]) -> Any:
    """Convert numbers to a float32 array; too large ones become infinite, without a warning."""
    with np.errstate(over="ignore"):
        return np.array(values, np.float32).reshape(shape)


def pack(layout: SpaceLayout, flats: Sequence[tuple[Any, ...]]) -> Any:
    """Component values, flat row-major, as one Gymnasium value."""
    rows = pack_many(layout, [np.array([flat]) for flat in flats])
    if layout.is_dict:
        values = {}
        for part in layout.parts:
            values[part.name] = _first(part, rows[part.name])
        return values
    return _first(layout.parts[0], rows)


def _first(part: Part, rows: np.ndarray[Any, Any]) -> Any:
    if part.is_whole and not part.shape:
        return int(rows[0])
    return np.asarray(rows[0])


def pack_many(layout: SpaceLayout, rows: Sequence[np.ndarray[Any, Any]]) -> Any:
    """Component values, (N, elements) each, as a batch of N Gymnasium values: what `pack` makes of every row, stacked."""
    blocks: list[list[np.ndarray[Any, Any]]] = [[] for _ in layout.parts]
    for segment in layout.segments:
        blocks[segment.part].append(segment.columns(rows[segment.component]))
    held = {}
    with np.errstate(over="ignore"):
        for part, columns in zip(layout.parts, blocks, strict=True):
            kind = np.int64 if part.is_whole else np.float32
            joined = np.concatenate(columns, axis=1).astype(kind)
            held[part.name] = joined.reshape(len(joined), *part.shape)
    if layout.is_dict:
        return held
    return held[None]


def unpack(layout: SpaceLayout, value: Any) -> list[tuple[Any, ...]]:
    """Split a valid action (or observation, but for one-hot rows) of a layout into flat component values."""
    held = [value]
    if layout.is_dict:
        held = [value[part.name] for part in layout.parts]
    parts = [np.asarray(each).ravel().tolist() for each in held]
    flats = []
    for c, segment in zip(layout.components, layout.segments, strict=True):
        flat = parts[segment.part][segment.first : segment.first + segment.size]
        if segment.starts:
            digits = flat
            flat = [item + start for item, start in zip(digits, segment.starts, strict=True)]
        flats.append(tuple(flat if c.type.kind is Kind.REAL else map(round, flat)))
    return flats
