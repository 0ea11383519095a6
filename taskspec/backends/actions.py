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
    """Actions that are not in the batched action space; the environment layer raises Gymnasium's error."""


Reader = Callable[[Any], tuple[Array, ...]]
"""From a batch of actions to an array (*shape, lanes) for every action component: bool, int64 or float64."""


def reader(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """Return the reader of a task's actions for a number of lanes; it raises `BadActionError`."""
    (part,) = layout.parts
    return (
        _reader_of_numbers(task, layout, lanes)
        if part.is_whole and not part.shape
        else _reader_of_arrays(task, layout, lanes)
    )


def array_of(actions: Any, layout: SpaceLayout, lanes: int) -> Array:
    """Return actions as an array (lanes, *shape); reals are refused for whole numbers, as `MultiDiscrete.contains` does.

    Raises:
        BadActionError: wrong shape or kind of numbers.
    """
    (part,) = layout.parts
    array = np.asarray(actions)
    if array.shape != (lanes, *part.shape) or array.dtype.kind not in ("iub" if part.is_whole else "iubf"):
        raise BadActionError
    return array


def _reader_of_numbers(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """Return a reader of one whole number for each lane, with as few calls of NumPy as possible."""
    ((low, high),) = layout.ends
    is_bool = task.action[0].type.kind is Kind.BOOL
    smallest = np.minimum.reduce
    largest = np.maximum.reduce

    def read(actions: Any) -> tuple[Array, ...]:
        array = array_of(actions, layout, lanes).astype(np.int64, copy=False)
        if low == 0 and largest(array.view(np.uint64)) > high:  # unsigned, negative numbers are huge
            raise BadActionError
        if low != 0 and (smallest(array) < low or largest(array) > high):
            raise BadActionError
        return (array != 0,) if is_bool else (array,)

    return read


def _reader_of_arrays(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    low, high = np.array(layout.ends).T[..., None]
    dtype = np.int64 if layout.parts[0].is_whole else np.float64
    segments = list(zip(task.action, layout.segments, strict=True))
    unsigned = dtype is np.int64 and not low.any()  # as such, negative numbers are huge: one comparison is enough
    largest = high.astype(np.uint64) if unsigned else high

    def read(actions: Any) -> tuple[Array, ...]:
        rows = array_of(actions, layout, lanes).reshape(lanes, -1).T.astype(dtype, order="C")
        if unsigned:
            inside = not np.greater(rows.view(np.uint64), largest).any()
        else:
            inside = np.greater_equal(rows, low).all() and np.less_equal(rows, high).all()
        if not inside:
            raise BadActionError
        return tuple(_component(c, segment, rows) for c, segment in segments)

    return read


def _component(c: Component, segment: Segment, rows: Array) -> Array:
    """Return the component in rows of actions; every point of a box is an action."""
    mine = rows[segment.first : segment.first + segment.size]
    if segment.starts:
        mine = mine + np.array(segment.starts)[:, None]
    shaped = mine[0] if c.type.is_scalar else mine.reshape(*c.type.shape, rows.shape[-1])
    match c.type.kind:
        case Kind.BOOL:
            return np.not_equal(np.rint(shaped), 0)
        case Kind.INT:
            return (np.rint(shaped) if shaped.dtype.kind == "f" else shaped).astype(np.int64, copy=False)
        case Kind.REAL:
            return shaped
