"""Undiscounted models without a horizon: chains and end components."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Step, refuse, scipy_module, scipy_sparse
from taskspec.solve.following import Bound

# ---------- chains
# Chains without an end: the expected total along a Markov chain that is left in the end, enclosed.
#
# A candidate v of v = g + P v comes from a linear solver, or from repeated substitution, and need not be trusted. What is
# proved rests on a second candidate w >= 0 with w - P w >= c > 0 in every state, checked with outward rounding: it shows
# that the chain is left, and that a residual of at most r moves the solution by at most (r / c) w.

Image = Callable[[Bound], Bound]
"""P x with a bound of its error, from x; both (S,)."""
DIRECT = 3000
"""States up to which equations are solved directly."""
WORK = 300_000_000
"""Non-zeros that repeated substitution may go through."""
SWEEP = 10_000
"""Non-zeros that would take as long as starting to go through them does."""


@dataclass(frozen=True)
class Chain:
    """Equations v = gain + P v over the states `inside` (S,); v is 0 elsewhere.

    `matrix` (S, S) is P in floats, for candidates; `image` is P with its bounds, for proofs.
    """

    matrix: Any
    image: Image
    inside: Array

    def solved(self, gain: Array) -> Array:
        """A candidate solution (S,).

        Raises:
            SpecError: (E712) where equations that are solved directly have no solution, since the chain is never left.
        """
        inside = np.flatnonzero(self.inside)
        found = np.zeros(len(self.inside))
        if len(inside):
            solve = _direct if len(inside) <= DIRECT else _substituted
            found[inside] = solve(self.matrix[inside][:, inside], gain[inside])
        return found

    def enclosed(self, gain: Bound) -> Bound:
        """The solution with a bound of its error.

        Raises:
            SpecError: (E712) where it cannot be shown that the chain is left.
        """
        value = self.solved(gain.value)
        image = self.image(Bound(value, np.zeros_like(value)))
        off = np.abs(gain.value + image.value - value) + gain.error + image.error
        off += 4e-16 * (np.abs(gain.value) + np.abs(image.value) + np.abs(value))
        residual = float(np.max(off[self.inside], initial=0.0))
        ratio, w = self.decay()
        return Bound(value, np.where(self.inside, residual * ratio * w * (1 + 1e-12), 0.0))

    def decay(self) -> tuple[float, Array]:
        """1/c and w >= 0 with w - P w >= c > 0 inside; SpecError (E712) where none is found."""
        inside = self.inside
        w = np.maximum(self.solved(inside.astype(np.float64)), 0.0)
        w = np.where(inside & np.isfinite(w), w, 0.0)
        image = self.image(Bound(w, np.zeros_like(w)))
        c = float(np.min((w - image.value - image.error - 4e-16 * (w + image.value))[inside], initial=np.inf))
        if not c > 0:
            _refuse_unending()
        return 1 / c * (1 + 1e-12), w


def _refuse_unending() -> NoReturn:
    refuse("it cannot be shown that episodes end", "give the task a horizon, or a discount below 1")


def _direct(matrix: Any, gain: Array) -> Array:
    """The solution by sparse LU, refined once."""
    left = scipy_sparse().identity(len(gain), format="csc") - matrix.tocsc()
    try:
        factors = scipy_module("linalg").splu(left)
    except RuntimeError:  # singular
        _refuse_unending()
    found = factors.solve(gain)
    found = found + factors.solve(gain - left @ found)
    if not np.isfinite(found).all():
        _refuse_unending()
    return np.asarray(found)


def _substituted(matrix: Any, gain: Array) -> Array:
    """The solution by repeated substitution, as far as `WORK` goes."""
    value, before = gain, np.inf
    for _ in range(WORK // (SWEEP + matrix.nnz + len(gain)) + 1):
        better = gain + matrix @ value
        gap = float(np.max(np.abs(better - value)))
        value = better
        if gap <= 1e-16 * float(np.max(np.abs(value))) or not np.isfinite(gap) or (gap >= before and gap < 1e-12):
            break
        before = gap
    return value


# ---------- components
# Where an episode without a horizon may stay for ever: end components in which nothing is paid (de Alfaro 1997).


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
