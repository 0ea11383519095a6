"""Backward induction compiled by Numba: a sweep over states, actions and outcomes in one pass, without temporaries.

States are swept in blocks. A block whose successors all lie in blocks that did not change in the
last sweep keeps its values: in tasks where steps are local, values spread from the rewards like a
wave, and only what the wave has reached is computed. A sweep with other rewards or probabilities computes
all blocks, those included whose steps all end the episode.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Step
from taskspec.exact.solve.bounded import Bound, Bounded

BLOCK = 1024


def extreme_values(numbers: Bounded, largest: bool) -> Bound:
    """Return the best (or worst) values (S,) at the first time of a model with a horizon, and bounds of their errors."""
    model = numbers.model
    sign = 1.0 if largest else -1.0
    bound = numbers.zero()
    spare = np.empty(model.n_states)
    before: Step | None = None
    blocks = np.empty((0, 2), np.int64)
    changed = active = np.ones(0, np.bool_)
    for t in range(numbers.horizon - 1, -1, -1):
        step = model.step(t)
        P = step.P
        rows = (P.indptr, P.indices, P.data)
        if step is before:
            active = _active(blocks, changed)
        else:
            blocks = _successors(P.indptr, P.indices, model.n_states, model.n_actions)
            changed = active = np.ones(len(blocks), np.bool_)
        value = bound.value
        changed = _swept(rows, step.R, active, changed, value, spare, (model.discount, sign))
        bound = numbers.with_errors(step, spare, bound)
        spare = value
        before = step
    return bound


@njit(cache=True)
def _successors(indptr: Array, columns: Array, states: int, actions: int) -> Array:
    """For each block the first and the last block that its steps lead to, (blocks, 2); a last before the first: none."""
    count = (states + BLOCK - 1) // BLOCK
    found = np.empty((count, 2), np.int64)
    for b in range(count):
        low = states
        high = 0
        for a in range(actions):
            first = a * states + b * BLOCK
            last = a * states + min(states, (b + 1) * BLOCK)
            for k in range(indptr[first], indptr[last]):
                low = min(low, columns[k])
                high = max(high, columns[k])
        found[b, 0] = low // BLOCK
        found[b, 1] = high // BLOCK
    return found


@njit(cache=True)
def _active(blocks: Array, changed: Array) -> Array:
    before = np.zeros(len(changed) + 1, np.int64)
    before[1:] = np.cumsum(changed)
    found = np.empty(len(blocks), np.bool_)
    for b in range(len(blocks)):
        found[b] = before[min(blocks[b, 1] + 1, len(changed))] > before[min(blocks[b, 0], len(changed))]
    return found


@njit(cache=True, fastmath={"contract"})
def _swept(
    rows: tuple[Array, ...], reward: Array, active: Array, changed: Array,
    value: Array, out: Array, constants: tuple[float, ...],
) -> Array:  # fmt: skip
    """Write the values one step before into `out`; return which blocks differ from `value`.

    In `changed` blocks `value` differs from what `out` holds.
    """
    indptr, columns, weights = rows
    discount, sign = constants
    states = len(out)
    after = np.zeros(len(active), np.bool_)
    for b in range(len(active)):
        first = b * BLOCK
        last = min(states, (b + 1) * BLOCK)
        if not active[b]:
            if changed[b]:
                out[first:last] = value[first:last]
            continue
        for s in range(first, last):
            best = -np.inf
            for a in range(len(reward) // states):
                row = a * states + s
                ahead = 0.0
                for k in range(indptr[row], indptr[row + 1]):
                    ahead += weights[k] * value[columns[k]]
                best = max(best, sign * (reward[row] + discount * ahead))
            out[s] = sign * best
            after[b] |= out[s] != value[s]
    return after
