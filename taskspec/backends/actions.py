"""Actions of many environments: checked, and split into components with the lanes last."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Component, Task

Array = np.ndarray[Any, Any]


class BadActionError(Exception):
    """Actions that are not in the batched action space; the environment layer says so in Gymnasium's terms."""


Reader = Callable[[Any], tuple[Array, ...]]
"""From a batch of actions to one array (*shape, lanes) for every action component, bool, int64 or float64."""


def reader(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """The reader of a task's actions for a number of lanes; it raises `BadActionError`."""
    return _READERS[layout.form](task, layout, lanes)


def _array(actions: Any, shape: tuple[int, ...], kinds: str) -> Array:
    array = np.asarray(actions)
    if array.shape != shape or array.dtype.kind not in kinds:
        raise BadActionError
    return array


def _discrete(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    (c,) = task.action
    low, high, is_bool = int(c.low[0]), int(c.high[0]), c.type.kind is Kind.BOOL
    smallest, largest = np.minimum.reduce, np.maximum.reduce

    def read(actions: Any) -> tuple[Array, ...]:
        array = _array(actions, (lanes,), "iub").astype(np.int64, copy=False)
        # A negative number is a huge one without a sign, so that one comparison serves both ends.
        outside = largest(array.view(np.uint64)) > high if low == 0 else smallest(array) < low or largest(array) > high
        if outside:
            raise BadActionError
        return (array != 0,) if is_bool else (array,)

    return read


def _multi_discrete(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    counts, largest = layout.counts, np.maximum.reduce
    starts = np.array(layout.starts, np.int64)[:, None]
    shifted = bool(starts.any())

    def read(actions: Any) -> tuple[Array, ...]:
        array = _array(actions, (lanes, len(counts)), "iub")
        rows = array.T.astype(np.int64, order="C")
        if any(largest(row) >= count for row, count in zip(rows.view(np.uint64), counts, strict=True)):
            raise BadActionError
        return _components(task, rows + starts if shifted else rows)

    return read


def _box(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    low, high = np.array(layout.limits).T[..., None]
    whole = np.array([c.type.kind is not Kind.REAL for c in task.action for _ in range(c.type.size)])

    def read(actions: Any) -> tuple[Array, ...]:
        array = _array(actions, (lanes, *layout.shape), "iufb")
        rows = array.reshape(lanes, -1).T.astype(np.float64)
        if not (np.greater_equal(rows, low).all() and np.less_equal(rows, high).all()):
            raise BadActionError
        rows[whole] = np.rint(rows[whole])  # every point of the space is an action
        return _components(task, rows)

    return read


def _components(task: Task, rows: Array) -> tuple[Array, ...]:
    """Rows of elements as components of their kinds."""
    parts, offset = [], 0
    for c in task.action:
        parts.append(_component(c, rows[offset : offset + c.type.size]))
        offset += c.type.size
    return tuple(parts)


def _component(c: Component, rows: Array) -> Array:
    shaped = rows[0] if c.type.is_scalar else rows.reshape(*c.type.shape, rows.shape[-1])
    match c.type.kind:
        case Kind.BOOL:
            return np.not_equal(shaped, 0)
        case Kind.INT:
            return shaped.astype(np.int64, copy=False)
        case Kind.REAL:
            return shaped.astype(np.float64, copy=False)


_READERS: dict[str, Callable[[Task, SpaceLayout, int], Reader]] = {
    "discrete": _discrete,
    "multi_discrete": _multi_discrete,
    "box": _box,
}
