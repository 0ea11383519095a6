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
from taskspec.model.model import Model, Step
from taskspec.solve.bounded import Bounded
from taskspec.solve.following import Bound

Slots = tuple[Array, Array, tuple[int, ...], tuple[int, ...]]
"""Columns (A, S, K) and weights (A, K) of outcomes, and a tuple each as long as there are actions and outcomes, which is part of
its type: what is compiled knows how many."""
BLOCK = 1024
MOST_OUTCOMES = 64


def extreme_values(numbers: Bounded, largest: bool) -> Bound:
    """The best (or worst) values (S,) at the first time of a model with a horizon, and bounds of their errors."""
    model, sign = numbers.model, 1.0 if largest else -1.0
    value, spare = np.zeros((model.n_states, 2)), np.empty((model.n_states, 2))
    before: Step | None = None
    c = max(numbers.part(t).c for t in range(len(model.steps)))
    changed = active = np.ones(0, np.bool_)
    for t in range(numbers.horizon - 1, -1, -1):
        part = numbers.part(t)
        lost = numbers.lost(part, value[:, 0], value[:, 1])
        if part.step is not before:
            rows, slots, blocks = _prepared(model, part.step)
            changed = active = np.ones(len(blocks), np.bool_)
        else:
            active = _active(blocks, changed | (lost > 0))
        bounds = (part.inflate, numbers.rounding, lost, numbers.floor, part.paid, part.beyond)
        constants = (model.discount, sign, c, *bounds)
        changed = _swept(rows, slots, part.reward, part.sizes, active, changed, value, spare, constants)
        value, spare, before = spare, value, part.step
    return Bound(value[:, 0].copy(), value[:, 1].copy())


def _prepared(model: Model, step: Step) -> tuple[tuple[Array, ...], Slots | None, Array]:
    """What follows every state and action: as rows, or where each has the same number of outcomes as slots; and the blocks."""
    going, slots = step.going, step.slots
    rows = going.indptr, going.indices, going.data
    blocks = _successors(going.indptr, going.indices, model.n_states, model.n_actions)
    if slots is None or slots.size > MOST_OUTCOMES:
        return rows, None, blocks
    actions, outcomes = slots.shape
    columns = going.indices.reshape(model.n_actions, model.n_states, -1)
    return rows, (columns, slots, (0,) * actions, (0,) * outcomes), blocks


@njit(cache=True)
def _successors(indptr: Array, columns: Array, states: int, actions: int) -> Array:
    """For each block the first and the last block that its steps lead to, (blocks, 2); a last before the first: none."""
    count = (states + BLOCK - 1) // BLOCK
    found = np.empty((count, 2), np.int64)
    for b in range(count):
        low, high = states, 0
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
    """Which blocks lead to one that changed."""
    before = np.zeros(len(changed) + 1, np.int64)
    before[1:] = np.cumsum(changed)
    found = np.empty(len(blocks), np.bool_)
    for b in range(len(blocks)):
        found[b] = before[min(blocks[b, 1] + 1, len(changed))] > before[min(blocks[b, 0], len(changed))]
    return found


@njit(cache=True, fastmath={"contract"})
def _swept(
    rows: tuple[Array, ...], slots: Slots | None, reward: Array, sizes: Array, active: Array, changed: Array,
    value: Array, out: Array, constants: tuple[float, ...],
) -> Array:  # fmt: skip
    """One step back: writes `out`, and gives which blocks differ from `value`.

    Numba compiles one of the two ways to read outcomes; with `slots` loops are of known length, and twice as fast. Beside a value
    is its error; that of the best action is at most the largest. In `changed` blocks `value` differs from what `out` holds.
    """
    indptr, columns, weights = rows
    discount, sign, c, inflate, rounding, lost, floor, paid, beyond = constants
    states = len(out)
    after = np.zeros(len(active), np.bool_)
    for b in range(len(active)):
        first, last = b * BLOCK, min(states, (b + 1) * BLOCK)
        if not active[b]:
            if changed[b]:
                out[first:last] = value[first:last]
            continue
        for s in range(first, last):
            best, worst = -np.inf, 0.0
            for a in range(len(reward) // states if slots is None else len(slots[2])):
                row = a * states + s
                ahead, error = 0.0, 0.0
                if slots is None:
                    for k in range(indptr[row], indptr[row + 1]):
                        ahead += weights[k] * value[columns[k], 0]
                        error += weights[k] * value[columns[k], 1]
                else:
                    for k in range(len(slots[3])):
                        ahead += slots[1][a, k] * value[slots[0][a, s, k], 0]
                        error += slots[1][a, k] * value[slots[0][a, s, k], 1]
                q = reward[row] + discount * ahead
                off = paid * abs(sizes[row]) + beyond + discount * (error + lost)
                off += rounding * (abs(q) + abs(reward[row]))
                best, worst = max(best, sign * q), max(worst, off + (floor if error > 0 else 0.0))
            out[s, 0] = sign * best
            out[s, 1] = worst * inflate + c * abs(best) + (floor if best != 0 else 0.0)
            after[b] |= out[s, 0] != value[s, 0] or out[s, 1] != value[s, 1]
    return after
