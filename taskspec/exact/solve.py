"""Planning on an exact model: dynamic programming, one backup rule for each way to choose actions.

Shapes: S states, A actions, T steps. Values are (S,), action values Q and policies (A, S). With a
horizon, T backward steps give values for each time (the truncation pays nothing further); without
one, values are the fixed point of the discounted backup. An action value at time t is
r(s, a) + discount * sum over s' of P(going on to s') V(s'): a terminal state is worth 0.

Ties: `greedy` gives every best action an equal share, where best means within 1e-9 (relative to the
size of the values) of the largest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exact.failure import is_installed, refuse
from taskspec.exact.model import Model, Step

Array = np.ndarray[Any, Any]
Backup = Callable[[Array, int], Array]
"""From action values (A, S) at a time to values (S,)."""
Policy = Callable[[int], Array]
"""The probability of each action in each state, (A, S), at a time."""
TIE = 1e-9
SWEEPS = 1_000_000
LARGE = 500_000


# -- rules ----------------------------------------------------------------------------------------


def best(q: Array, t: int = 0) -> Array:
    return np.asarray(q.max(axis=0))


def worst(q: Array, t: int = 0) -> Array:
    return np.asarray(q.min(axis=0))


def soft(beta: float) -> Backup:
    """The causal maximum-entropy value: log sum exp(beta Q) / beta."""

    def backup(q: Array, t: int = 0) -> Array:
        top = q.max(axis=0)
        return np.asarray(top + np.log(np.exp(beta * (q - top)).sum(axis=0)) / beta)

    return backup


def mean(q: Array, t: int = 0) -> Array:
    """The value of uniformly random actions."""
    return np.asarray(q.mean(axis=0))


def following(policy: Policy) -> Backup:
    """The value of a given policy."""

    def backup(q: Array, t: int = 0) -> Array:
        return np.asarray((policy(t) * q).sum(axis=0))

    return backup


# -- policies from action values ------------------------------------------------------------------


def ties(q: Array, largest: Array | None = None) -> Array:
    """Which actions (A, S) are as good as the best."""
    top = q.max(axis=0) if largest is None else largest
    return np.asarray(q >= top - TIE * np.maximum(1.0, np.abs(top)))


def greedy(q: Array) -> Array:
    """All best actions alike, (A, S)."""
    found = ties(q)
    return np.asarray(found / found.sum(axis=0))


def boltzmann(q: Array, beta: float) -> Array:
    weights = np.exp(beta * (q - q.max(axis=0)))
    return np.asarray(weights / weights.sum(axis=0))


# -- dynamic programming --------------------------------------------------------------------------


def action_values(model: Model, step: Step, value: Array, shift: float = 0.0) -> Array:
    """Q (A, S) at a time from the values (S,) at the next; `shift` is added to every reward."""
    q = step.going @ value
    if model.discount != 1:
        q *= model.discount
    q += step.reward
    if shift:
        q += shift
    return np.asarray(q.reshape(model.n_actions, model.n_states))


def backward(model: Model, rule: Backup, shift: float = 0.0) -> Iterator[tuple[int, Array, Array]]:
    """Times from the last to the first, each with its action values (A, S) and values (S,)."""
    assert model.horizon is not None
    value = np.zeros(model.n_states)
    for t in range(model.horizon - 1, -1, -1):
        q = action_values(model, model.step(t), value, shift)
        value = rule(q, t)
        yield t, q, value


def fixed_point(model: Model, rule: Backup, shift: float = 0.0) -> tuple[Array, Array]:
    """Q (A, S) and V (S,) without a horizon: swept until rounding alone is left to change them.

    Raises:
        SpecError: (E712) when values do not settle, as undiscounted ones need not.
    """
    value = np.zeros(model.n_states)
    best_gap, stuck = math.inf, 0
    for _ in range(SWEEPS):
        q = action_values(model, model.step(0), value, shift)
        improved = rule(q, 0)
        gap = float(np.max(np.abs(improved - value), initial=0.0))
        value, size = improved, float(np.max(np.abs(improved), initial=0.0))
        stuck = 0 if gap < best_gap else stuck + 1
        best_gap = min(gap, best_gap)
        if gap <= 1e-16 * size or (stuck > 20 and gap <= 1e-11 * size):
            return q, value
        if not math.isfinite(gap) or (model.discount == 1 and stuck > 1000 + 2 * model.n_states):
            break
    refuse("the task has no horizon and its values do not settle", "give it a discount below 1, or a horizon")


@dataclass(frozen=True)
class Solution:
    """Values (S,) at the start, and their expectation over the start."""

    value: Array
    expected: float


def solve(model: Model, rule: Backup = best, shift: float = 0.0) -> Solution:
    """Values at the first time under a rule."""
    if model.horizon is None:
        value = fixed_point(model, rule, shift)[1]
    elif rule in (best, worst) and not shift and model.entries >= LARGE and is_installed("numba"):
        from taskspec.exact.kernels_numba import extreme_values

        value = extreme_values(model, rule is best)
    else:
        value = np.zeros(model.n_states)
        for _, _, found in backward(model, rule, shift):
            value = found
    return Solution(value, float(model.start @ value))


def optimal_return(model: Model) -> float:
    """The expected return of the best policy."""
    return solve(model, best).expected


def worst_return(model: Model) -> float:
    return solve(model, worst).expected


def random_return(model: Model) -> float:
    """The expected return of uniformly random actions."""
    return solve(model, mean).expected


def policy_return(model: Model, policy: Policy) -> float:
    """The expected return of a policy."""
    return solve(model, following(policy)).expected


def all_action_values(model: Model, rule: Backup = best, shift: float = 0.0) -> list[Array]:
    """Q (A, S) for each time, in order; one entry where there is no horizon."""
    if model.horizon is None:
        return [fixed_point(model, rule, shift)[0]]
    return [q for _, q, _ in backward(model, rule, shift)][::-1]


def occupancy(model: Model, policy: Policy, steps: int | None = None) -> Array:
    """How often a policy is expected to act in each state, (S,), summed over the episode and discounted.

    Without a horizon the sum is over `steps` steps, or until less than 1e-12 is left.
    """
    total, now = np.zeros(model.n_states), model.start.copy()
    last = model.horizon if steps is None else steps
    t, factor = 0, 1.0
    while (last is None or t < last) and factor * now.sum() > 1e-12 and t < SWEEPS:
        total += factor * now
        now = model.step(t).going.T @ (policy(t) * now).reshape(-1)
        t, factor = t + 1, factor * model.discount
    return total


def visit_probability(model: Model, policy: Policy, states: Array) -> float:
    """The probability that an episode under a policy is ever in one of the states (S,), its last one included."""
    hit = float(model.start[states].sum())
    now = np.where(states, 0.0, model.start)
    t = 0
    while (model.horizon is None or t < model.horizon) and now.sum() > 1e-15 and t < SWEEPS:
        step, rows = model.step(t), (policy(t) * now).reshape(-1)
        now = step.going.T @ rows
        hit += float(now[states].sum())
        if step.ending is not None:
            hit += float((step.ending.T @ rows)[states].sum())
        now = np.where(states, 0.0, now)
        t += 1
    return hit
