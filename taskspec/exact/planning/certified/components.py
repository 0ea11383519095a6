"""Where an episode without a horizon may stay for ever: end components in which nothing is paid (de Alfaro 1997)."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.model.failure import scipy_module, scipy_sparse
from taskspec.exact.model.model import Step

Array = np.ndarray[Any, Any]


def idle_components(step: Step, acting: Array) -> tuple[Array, Array]:
    """The maximal end components of the rows that pay nothing and never end the episode, in states (S,) that matter.

    Returns:
        A number for each state (S,), -1 outside of all components, and which rows (A*S,) stay inside one. Within a
        component every state can be reached from every other with probability 1, at no cost.
    """
    states = len(acting)
    size = step.reward if step.spread is None else step.spread
    rows = (size == 0) & np.tile(acting, len(size) // states)
    if step.ending is not None:
        rows &= (step.ending @ np.ones(states)) == 0
    owner = np.tile(np.arange(states), len(rows) // states)
    while rows.any():
        label = _strong(step.going, rows, owner, states)
        leaves = _counts(step.going, label, owner) > 0
        if not (rows & leaves).any():
            return _numbered(label, rows, owner, states), rows
        rows &= ~leaves
    return np.full(states, -1), rows


def _strong(going: Any, rows: Array, owner: Array, states: int) -> Array:
    """Strongly connected components (S,) of the graph of some rows."""
    kept = np.repeat(rows, np.diff(going.indptr)) & (going.data > 0)
    source = np.repeat(owner, np.diff(going.indptr))[kept]
    entries = (np.ones(len(source)), (source, going.indices[kept]))
    graph = scipy_sparse().csr_array(entries, shape=(states, states))
    return np.asarray(scipy_module("csgraph").connected_components(graph, connection="strong")[1])


def _counts(going: Any, label: Array, owner: Array) -> Array:
    """How many outcomes of each row leave the component of its state."""
    row = np.repeat(np.arange(len(owner)), np.diff(going.indptr))
    outside = (label[going.indices] != label[owner[row]]) & (going.data > 0)
    return np.bincount(row[outside], minlength=len(owner))


def _numbered(label: Array, rows: Array, owner: Array, states: int) -> Array:
    inside = np.zeros(states, np.bool_)
    inside[owner[rows]] = True
    return np.where(inside, np.unique(np.where(inside, label, -1), return_inverse=True)[1], -1)


def leading_to(matrix: Any, targets: Array) -> Array:
    """States (S,) from which the targets can be reached, these included, by a matrix (S, S) or rows (A*S, S)."""
    found, actions = targets.copy(), matrix.shape[0] // matrix.shape[1]
    while True:
        more = found | ((matrix @ found.astype(np.float64)) > 0).reshape(actions, -1).any(axis=0)
        if (more == found).all():
            return found
        found = more
