"""Backward induction compiled by Numba: a sweep over states, actions and outcomes in one pass, without temporaries.

A sweep is bound by memory, so that the fastest one is the one that is not made. States are swept in blocks, and two kinds of
blocks are passed over. A block whose successors all lie in blocks that did not change in the last sweep keeps its values: where
steps are local, values spread from the rewards like a wave, and states from which nothing can still be earned in the steps left
cost nothing. And where only the values of first states are asked for, states that no episode has come to by some time have none
then. A sweep with other rewards or probabilities computes all blocks, those included whose steps all end the episode.

Where all steps have equally many outcomes, and few, their number is known to the compiler. Indices are unsigned, since Numba
would look for negative ones. Threads share the blocks of a sweep.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numba import config, njit

from taskspec.base.arrays import Array
from taskspec.base.limits import tell
from taskspec.exact.model.model import Step
from taskspec.exact.solve.bounded import Bound, Bounded

BLOCK = 128
"""States of a block."""
SHARED = 100_000
"""Non-zeros of a sweep from which threads share it."""
FEW = 4
"""Outcomes of a step for which sweeps are compiled apart."""


def extreme_values(numbers: Bounded, largest: bool, at_start: bool = False) -> Bound:
    """Return the best (or worst) values (S,) at the first time of a model with a horizon, and bounds of their errors.

    Args:
        at_start: only values of first states are asked for; others may be wrong.
    """
    model = numbers.model
    if largest:
        sign = 1.0
    else:
        sign = -1.0
    count = -(-model.n_states // BLOCK)
    opened = np.zeros(count, np.int64)
    if at_start:
        opened = np.minimum.reduceat(model.first_times, np.arange(0, model.n_states, BLOCK))
    bound = numbers.zero()
    spare = np.zeros(model.n_states)
    before: Step | None = None
    ahead = (np.zeros(0, np.int64), np.zeros(0, np.int32))
    outcomes: tuple[int, ...] = ()
    changed = np.ones(count, np.bool_)
    threads = config.NUMBA_NUM_THREADS
    with ThreadPoolExecutor(threads) as pool:
        for t in range(numbers.horizon - 1, -1, -1):
            tell(f"planning, step {t + 1:,} of {numbers.horizon:,}")
            step = model.step(t)
            P = step.P
            if step is before:
                active = _active(*ahead, changed)
            else:
                ahead = _successors(P.indptr, P.indices, model.n_states, model.n_actions)
                outcomes = _outcomes(P.indptr)
                changed = np.ones(count, np.bool_)
                active = changed
            needed = opened <= t
            active = active & needed
            blocks = np.flatnonzero((active | changed) & needed).astype(np.uint64)
            value = bound.value
            after = np.zeros(count, np.bool_)
            rows = (P.indptr, P.indices, P.data)
            sweep = partial(_sweep, rows, outcomes, step.R, active, value, spare, after, (model.discount, sign))
            is_large = np.count_nonzero(active) * (P.nnz / count) > SHARED
            first, *rest = np.array_split(blocks, 4 * threads if is_large else 1)
            others = pool.map(sweep, rest)
            sweep(first)  # in this thread
            list(others)
            changed = after
            bound = numbers.with_errors(step, spare, bound)
            spare = value
            before = step
    return bound


def largest_fixed_point(
    rows: tuple[Array, Array, Array], reward: Array, discount: float, most: int,
    is_over: Callable[[float, float, Array], bool],
) -> Array:  # fmt: skip
    """Return values (S,) near the fixed point of V = max over actions of (reward + discount * P V), from V = 0.

    Sweeps go through the states in their order, and use the values that they have just found.

    Args:
        rows: of P (S * A, S + 1): where each begins, columns, and probabilities. Row s * A + a is action a in state s; the last
            column is for states that are worth 0.
        reward: float64 (S, A), -inf for illegal actions.
        most: sweeps, at most.
        is_over: whether to stop, by the last change of values, the one before, and the values.
    """
    value = np.zeros(len(reward) + 1)
    before = np.inf
    for _ in range(most):
        gap = _sweep_in_place(*rows, reward, discount, value)
        if is_over(gap, before, value):
            break
        before = gap
    return value[:-1]


def _outcomes(indptr: Array) -> tuple[int, ...]:
    """Return a tuple as long as there are outcomes of each step; an empty one where steps differ, or have many."""
    counts = np.diff(indptr)
    if counts[0] <= FEW and (counts == counts[0]).all():
        return (0,) * int(counts[0])
    return ()


@njit(cache=True)
def _successors(indptr: Array, columns: Array, states: int, actions: int) -> tuple[Array, Array]:
    """Return the blocks that the steps of each block lead to: where those of each begin (blocks + 1,), and their numbers."""
    count = (states + BLOCK - 1) // BLOCK
    first = np.zeros(count + 1, np.int64)
    found = np.empty(len(columns), np.int32)
    seen = np.full(count, -1, np.int32)
    at = 0
    for b in range(count):
        for a in range(actions):
            start = a * states + b * BLOCK
            end = a * states + min(states, (b + 1) * BLOCK)
            for k in range(indptr[start], indptr[end]):
                to = columns[k] // BLOCK
                if seen[to] != b:
                    seen[to] = b
                    found[at] = to
                    at += 1
        first[b + 1] = at
    return first, found[:at].copy()


@njit(cache=True)
def _active(first: Array, successors: Array, changed: Array) -> Array:
    found = np.zeros(len(changed), np.bool_)
    for b in range(len(changed)):
        for k in range(first[b], first[b + 1]):
            if changed[successors[k]]:
                found[b] = True
                break
    return found


@njit(cache=True, nogil=True, fastmath={"contract"})
def _sweep(
    rows: tuple[Array, ...], outcomes: tuple[int, ...], reward: Array, active: Array, value: Array, out: Array, after: Array,
    constants: tuple[float, ...], blocks: Array,
) -> None:  # fmt: skip
    """Write the values of some blocks one step before into `out`, and into `after` whether they differ from `value`.

    Those of blocks that are not active are copied.
    """
    indptr, columns, weights = rows
    discount, sign = constants
    states = np.uint64(len(out))
    actions = np.uint64(len(reward)) // states
    count = np.uint64(len(outcomes))
    size = np.uint64(BLOCK)
    for b in blocks:
        start = b * size
        end = min(states, start + size)
        if not active[b]:
            out[start:end] = value[start:end]
            continue
        is_new = False
        for s in range(start, end):
            best = -np.inf
            for a in range(actions):
                row = a * states + s
                if count:
                    first = row * count
                    last = first + count
                else:
                    first = np.uint64(indptr[row])
                    last = np.uint64(indptr[row + np.uint64(1)])
                ahead = 0.0
                for k in range(first, last):
                    ahead += weights[k] * value[columns[k]]
                best = max(best, sign * (reward[row] + discount * ahead))
            out[s] = sign * best
            is_new |= out[s] != value[s]
        after[b] = is_new


@njit(cache=True, nogil=True, fastmath={"contract"})
def _sweep_in_place(
    indptr: Array, columns: Array, weights: Array, reward: Array, discount: float, value: Array
) -> float:
    """Give each state its best value by the values of all states, one state after the other; return the largest change."""
    states, actions = reward.shape
    gap = 0.0
    row = np.uint64(0)
    k = np.uint64(0)
    for s in range(states):
        best = -np.inf
        for a in range(actions):
            row += np.uint64(1)
            last = np.uint64(indptr[row])
            ahead = 0.0
            while k < last:
                ahead += weights[k] * value[np.uint64(columns[k])]
                k += np.uint64(1)
            best = max(best, reward[s, a] + discount * ahead)
        gap = max(gap, abs(best - value[s]))
        value[s] = best
    return gap
