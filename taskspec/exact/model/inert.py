"""Whether a component of the action makes any difference in a model."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.model.failure import scipy_sparse
from taskspec.exact.model.model import Model
from taskspec.lang.ir import Role

Array = np.ndarray[Any, Any]
CLEAR = 1e-12
"""A difference that no rounding makes."""


def groups(model: Model, name: str) -> Array:
    """Actions that differ in one component alone, side by side: codes (groups, values of the component)."""
    space = model.actions
    position = next(i for i, c in enumerate(space.components) if c.name == name)
    values = space.decode(np.arange(space.size))[Role.ACTION, name].reshape(-1, space.size)
    own = np.zeros(space.size, np.int64)
    component = space.components[position]
    for row, low, stride in zip(values, component.low, space.strides[position], strict=True):
        own += (row - int(low)) * stride
    order = np.lexsort((own, np.arange(space.size) - own))
    count = int(np.prod(component.counts))
    return np.arange(space.size)[order].reshape(-1, count)


def differs(model: Model, action: str, state: str | None = None) -> tuple[bool | None, str]:
    """Whether the action component changes the distribution of the next value of a state component.

    Without `state`: of the whole next state, of the reward, or of the end, in a state where episodes act. None where chances
    differ by so little that it may be rounding; what may happen with one action and never with another tells them apart.
    """
    table = groups(model, action)
    keys = np.arange(model.n_states) if state is None else _classes(model, state)
    sparse = scipy_sparse()
    collapse = sparse.csr_array(
        (np.ones(model.n_states), (np.arange(model.n_states), keys)), shape=(model.n_states, int(keys.max()) + 1)
    )
    unsure: int | None = None
    for step in {id(x): x for x in model.steps}.values():
        parts = [step.going @ collapse] + ([] if step.ending is None else [step.ending @ collapse])
        if state is not None:
            parts = [sum(parts[1:], parts[0])]
        for column in range(1, table.shape[1]):
            rows, others = _rows(model, table[:, 0]), _rows(model, table[:, column])
            gap = _gap(step.reward[rows], step.reward[others]) if state is None else np.zeros(len(rows))
            for part in parts:
                gap = gap + _apart(part, rows, others) + _apart(part.sign(), rows, others)
            if (gap > CLEAR).any():
                at = int(np.flatnonzero(gap > CLEAR)[0])
                return True, f"it does in {model.state_name(int(rows[at] % model.n_states))}"
            if unsure is None and (gap > (step.terms + 4) * 2.0**-50).any():
                unsure = int(rows[gap.argmax()] % model.n_states)
    if unsure is not None:
        return None, f"in {model.state_name(unsure)} chances differ by no more than 1e-12"
    return False, "it does in no state"


def _apart(part: Any, rows: Array, others: Array) -> Array:
    """By how much (N,) some rows of a matrix differ from others, in all columns together."""
    return np.asarray(abs(part[rows] - part[others]).sum(axis=1)).reshape(-1)


def _gap(paid: Array, others: Array) -> Array:
    """By how much (N,) rewards differ, relative to their size."""
    with np.errstate(invalid="ignore"):  # rewards that are not finite are reported elsewhere
        gap, size = np.abs(paid - others), np.maximum(np.abs(paid), np.abs(others))
    return np.asarray(np.divide(gap, size, out=np.zeros_like(gap), where=size > 0))


def _rows(model: Model, actions: Array) -> Array:
    """Rows of the given actions in all states where episodes act."""
    states = np.flatnonzero(model.acting)
    return (actions[:, None] * model.n_states + states[None, :]).reshape(-1)


def _classes(model: Model, state: str) -> Array:
    """States numbered by the value of one component, (S,)."""
    value = model.states.decode(model.codes)[Role.STATE, state].reshape(-1, model.n_states)
    return np.asarray(np.unique(value, axis=1, return_inverse=True)[1]).reshape(-1)
