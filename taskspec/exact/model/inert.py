"""Whether a component of the action makes any difference in a model."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.model.failure import scipy_sparse
from taskspec.exact.model.model import Model
from taskspec.lang.ir import Role

Array = np.ndarray[Any, Any]


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


def differs(model: Model, action: str, state: str | None = None) -> tuple[bool, str]:
    """Whether the action component changes the distribution of the next value of a state component.

    Without `state`: of the whole next state, of the reward, or of the end, in a state where episodes act.
    """
    table = groups(model, action)
    keys = np.arange(model.n_states) if state is None else _classes(model, state)
    sparse = scipy_sparse()
    collapse = sparse.csr_array(
        (np.ones(model.n_states), (np.arange(model.n_states), keys)), shape=(model.n_states, int(keys.max()) + 1)
    )
    for step in {id(x): x for x in model.steps}.values():
        parts = [step.going @ collapse] + ([] if step.ending is None else [step.ending @ collapse])
        for column in range(1, table.shape[1]):
            rows, others = _rows(model, table[:, 0]), _rows(model, table[:, column])
            gap: Any = 0.0
            if state is None:
                with np.errstate(invalid="ignore"):  # rewards that are not finite are reported elsewhere
                    gap = np.abs(step.reward[rows] - step.reward[others])
                for part in parts:
                    gap = gap + np.asarray(abs(part[rows] - part[others]).sum(axis=1)).reshape(-1)
            else:
                total = sum(parts[1:], parts[0])
                gap = np.asarray(abs(total[rows] - total[others]).sum(axis=1)).reshape(-1)
            if (gap > 1e-12).any():
                at = int(np.flatnonzero(gap > 1e-12)[0])
                return True, f"it does in {model.state_name(int(rows[at] % model.n_states))}"
    return False, "it does in no state"


def _rows(model: Model, actions: Array) -> Array:
    """Rows of the given actions in all states where episodes act."""
    states = np.flatnonzero(model.acting)
    return (actions[:, None] * model.n_states + states[None, :]).reshape(-1)


def _classes(model: Model, state: str) -> Array:
    """States numbered by the value of one component, (S,)."""
    value = model.states.decode(model.codes)[Role.STATE, state].reshape(-1, model.n_states)
    return np.asarray(np.unique(value, axis=1, return_inverse=True)[1]).reshape(-1)
