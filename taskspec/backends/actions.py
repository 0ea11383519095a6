"""Actions of many environments: checked, and split into components with the lanes last."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.types import Kind
from taskspec.task.spaces import Segment, SpaceLayout
from taskspec.task.task import Component, Task


class BadActionError(Exception):
    """Actions that are not in the batched action space; the environment layer says so in Gymnasium's terms."""


Reader = Callable[[Any], tuple[Array, ...]]
"""From a batch of actions to one array (*shape, lanes) for every action component, bool, int64 or float64."""


def reader(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """The reader of a task's actions for a number of lanes; it raises `BadActionError`."""
    (part,) = layout.parts
    return (
        _reader_of_numbers(task, layout, lanes)
        if part.is_whole and not part.shape
        else _reader_of_arrays(task, layout, lanes)
    )


def array_of(actions: Any, layout: SpaceLayout, lanes: int) -> Array:
    """Actions as an array (lanes, *shape); reals are refused where numbers are whole, as `MultiDiscrete.contains` does.

    Raises:
        BadActionError: it has another shape, or holds something else.
    """
    (part,) = layout.parts
    array = np.asarray(actions)
    if array.shape != (lanes, *part.shape) or array.dtype.kind not in ("iub" if part.is_whole else "iubf"):
        raise BadActionError
    return array


def _reader_of_numbers(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """Of one whole number for each lane, with as few calls of NumPy as possible."""
    ((low, high),), is_bool = layout.ends, task.action[0].type.kind is Kind.BOOL
    smallest, largest = np.minimum.reduce, np.maximum.reduce

    def read(actions: Any) -> tuple[Array, ...]:
        array = array_of(actions, layout, lanes).astype(np.int64, copy=False)
        # A negative number is a huge one without a sign, so that one comparison serves both ends.
        outside = largest(array.view(np.uint64)) > high if low == 0 else smallest(array) < low or largest(array) > high
        if outside:
            raise BadActionError
        return (array != 0,) if is_bool else (array,)

    return read


def _reader_of_arrays(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    low, high = np.array(layout.ends).T[..., None]
    dtype = np.int64 if layout.parts[0].is_whole else np.float64
    segments = list(zip(task.action, layout.segments, strict=True))

    def read(actions: Any) -> tuple[Array, ...]:
        rows = array_of(actions, layout, lanes).reshape(lanes, -1).T.astype(dtype, order="C")
        if not (np.greater_equal(rows, low).all() and np.less_equal(rows, high).all()):
            raise BadActionError
        return tuple(_component(c, segment, rows) for c, segment in segments)

    return read


def _component(c: Component, segment: Segment, rows: Array) -> Array:
    """The component that numbers of actions stand for; every point of a box is an action."""
    mine = rows[segment.first : segment.first + segment.size]
    mine = mine + np.array(segment.starts)[:, None] if segment.starts else mine
    shaped = mine.reshape(*c.type.shape, rows.shape[-1])
    match c.type.kind:
        case Kind.BOOL:
            return np.not_equal(np.rint(shaped), 0)
        case Kind.INT:
            return (np.rint(shaped) if shaped.dtype.kind == "f" else shaped).astype(np.int64, copy=False)
        case Kind.REAL:
            return shaped
