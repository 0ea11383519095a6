"""Backward induction compiled by Numba: a sweep over states, actions and outcomes in one pass, without temporaries.

States are swept in blocks. A block whose successors all lie in blocks that did not change in the
last sweep keeps its values: in tasks where steps are local, values spread from the rewards like a
wave, and only what the wave has reached is computed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from taskspec.exact.model import Model, Step

Array = np.ndarray[Any, Any]
BLOCK = 1024
MOST_OUTCOMES = 64


def extreme_values(model: Model, largest: bool) -> Array:
    """The best (or worst) values (S,) at the first time of a model with a horizon."""
    assert model.horizon is not None
    value, spare = np.zeros(model.n_states), np.empty(model.n_states)
    before: Step | None = None
    for t in range(model.horizon - 1, -1, -1):
        step = model.step(t)
        if step is not before:
            kernel, arrays, blocks = _prepared(model, step)
            changed = np.ones(len(blocks), np.bool_)
        changed = _sweep(kernel, arrays, blocks, changed, value, spare, model.discount, 1.0 if largest else -1.0)
        value, spare, before = spare, value, step
    return value


def _prepared(model: Model, step: Step) -> tuple[Any, tuple[Array, ...], Array]:
    going, slots = step.going, step.slots
    blocks = _successors(going.indptr, going.indices, model.n_states, model.n_actions)
    if slots is not None and slots.size <= MOST_OUTCOMES:
        columns = going.indices.reshape(model.n_actions, model.n_states, -1)
        return _slots(*slots.shape), (columns, slots, step.reward), blocks
    return _rows, (going.indptr, going.indices, going.data, step.reward), blocks


def _sweep(
    kernel: Any, arrays: tuple[Array, ...], blocks: Array, changed: Array, value: Array, out: Array, discount: float,
    sign: float,
) -> Array:  # fmt: skip
    """One step back: writes `out`, and gives which blocks differ from `value`."""
    active = _active(blocks, changed)
    after = np.zeros(len(blocks), np.bool_)
    kernel(arrays, active, value, out, after, discount, sign)
    return after


@njit(cache=True)
def _successors(indptr: Array, columns: Array, states: int, actions: int) -> Array:
    """For each block the first and the last block that its steps lead to, (blocks, 2)."""
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
def _rows(
    arrays: tuple[Array, ...], active: Array, value: Array, out: Array, changed: Array, discount: float, sign: float
) -> None:
    indptr, columns, weights, reward = arrays
    states = len(out)
    actions = len(reward) // states
    for b in range(len(active)):
        first, last = b * BLOCK, min(states, (b + 1) * BLOCK)
        if not active[b]:
            out[first:last] = value[first:last]
            continue
        for s in range(first, last):
            best = -np.inf
            for a in range(actions):
                row = a * states + s
                after = 0.0
                for k in range(indptr[row], indptr[row + 1]):
                    after += weights[k] * value[columns[k]]
                best = max(best, sign * (reward[row] + discount * after))
            out[s] = sign * best
            changed[b] |= out[s] != value[s]


@cache
def _slots(actions: int, outcomes: int) -> Callable[..., None]:
    """The sweep for fixed numbers of actions and outcomes: loops of known length are unrolled, twice as fast."""

    @njit(cache=True, fastmath={"contract"})
    def kernel(
        arrays: tuple[Array, ...], active: Array, value: Array, out: Array, changed: Array, discount: float, sign: float
    ) -> None:
        columns, weights, reward = arrays
        states = len(out)
        for b in range(len(active)):
            first, last = b * BLOCK, min(states, (b + 1) * BLOCK)
            if not active[b]:
                out[first:last] = value[first:last]
                continue
            for s in range(first, last):
                best = -np.inf
                for a in range(actions):
                    after = 0.0
                    for k in range(outcomes):
                        after += weights[a, k] * value[columns[a, s, k]]
                    best = max(best, sign * (reward[a * states + s] + discount * after))
                out[s] = sign * best
                changed[b] |= out[s] != value[s]

    return kernel
