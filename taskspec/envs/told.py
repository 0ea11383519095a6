"""The states that infos of many environments tell, where the task's spec has `info`: as those of the scalar environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from taskspec.task.task import Task

Array = np.ndarray[Any, Any]


def told(task: Task, state: Sequence[Array]) -> Array:
    """States of all lanes as one array with the lanes first: (N, *shape) where the state is one component, else (N, elements).

    Elements are int64 where all components are finite, and float32 elsewhere.

    Args:
        state: an array (*shape, N) for every component.
    """
    (first, *others), lanes = task.state, state[0].shape[-1]
    finite = all(c.is_finite for c in task.state)
    rows = np.concatenate([np.asarray(part).reshape(-1, lanes) for part in state])
    shape = (len(rows),) if others else first.type.shape
    with np.errstate(over="ignore"):  # what float32 does not hold is infinite, as in observations
        return rows.T.astype(np.int64 if finite else np.float32).reshape(lanes, *shape)


def states(task: Task, before: Array, stepped: Array, after: Array) -> dict[str, Array]:
    """What the spec's `info` asks for of a step, each with a mask, bool (N,): the lanes in which one was taken, others are 0."""
    if not stepped.any():
        return {}
    before[~stepped] = after[~stepped] = 0
    found = {"old_state": before, "new_state": after}
    return {key: value for name in task.spec.info for key, value in ((name, found[name]), (f"_{name}", stepped))}
