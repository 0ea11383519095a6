"""Fingerprints: which Bellman operator a learner really applies, read from the values that it learned.

A learner that bootstraps comes to the fixed point of the operator that its code applies. On a finite task the fixed points of the
right operator and of wrong ones are computed exactly; the nearest one names the mistake, without a right version to compare with.

The operators, and the symbols of this file, are in `taskspec.exam.operators`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from taskspec.base.arrays import Array, parts_of
from taskspec.exam.operators import GOOD, OPERATORS, BellmanOperator, Dynamics, behaviour, dynamics_of
from taskspec.model.model import Model, misused, refuse
from taskspec.policies.adapters import ProbabilisticPolicy
from taskspec.policies.policy import states_of
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike

RIGHT = 0.15
"""Values this near to the right ones, as a share of their spread, are right."""
NEAR = 0.25
CLEARER = 0.5
"""A wrong operator is named if the values are within `NEAR` of its fixed point, and their distance is at most `CLEARER` of that
to the right values."""
SAME = 0.03
"""Operators whose distances differ by less than this cannot be told apart."""
SWEEPS = 5000
"""Applications of an operator, at most."""
SLOWEST = 500
"""Applications in which the change of the values has to be halved."""
PRECISION = 1e-6
"""Change of the values, as a share of the largest reward, at which they are taken for the fixed point."""
EXPLORATIONS = (0.05, 0.1, 0.2, 0.3)
"""The shares that are tried for learners that value their own behaviour."""
ON_THE_WAY = "on the way"
"""The name of the distance to values that a learner without a mistake passes before it has converged."""
WAYS = (0.1, 0.3, 0.6)
"""The shares of random actions of learners whose way is followed: what is visited rarely is learned late."""
STRIDE = 0.02
"""Distance of neighbouring values on the way, as a share of the spread of the right ones."""
POINTS = 200
"""About as many values on the way are kept, where it is long."""

Reduce = Callable[[Array], Array]
"""From Q, (A, S), to V, (S,)."""


# -- fixed points -----------------------------------------------------------------------------------------------------


def fixed_point(dynamics: Dynamics, operator: BellmanOperator, reduce: Reduce) -> Array | None:
    """Return Q, float64 (A, S), that an operator does not change; None if it grows without a bound, or does not settle.

    Args:
        reduce: Q to V, for operators without a reduction of their own.
    """
    Q = np.zeros_like(dynamics.R)
    size = max(1e-9, float(np.abs(dynamics.R).max()))
    before = np.inf
    for sweep in range(SWEEPS):
        V = reduce(Q) if operator.reduce is None else operator.reduce(dynamics, Q)
        following = operator.backup(dynamics, Q, V)
        change = float(np.abs(following - Q).max())
        Q = following
        if change <= PRECISION * size:
            return Q
        if sweep % SLOWEST == SLOWEST - 1:
            if not change < before / 2:
                return None
            before = change
    return None


def named(distances: Mapping[str, float], good: Sequence[str] = GOOD) -> list[str]:
    """Return the operators that explain distances: those that are no mistake within their tolerance, else the nearest.

    There are none where values are as near to those on the way to the right ones: they have not converged.

    Args:
        distances: by operator, the right one and `ON_THE_WAY` included.
        good: operators that are no mistake, the right one first.
    """
    for name in good:
        if distances.get(name, np.inf) <= RIGHT:
            return [name]
    known = {name: distance for name, distance in distances.items() if name != ON_THE_WAY}
    nearest = min(known.values())
    right = known[good[0]]
    if nearest > CLEARER * right or nearest > NEAR or is_on_the_way(distances):
        return []
    return [name for name, distance in known.items() if distance <= nearest + SAME]


def is_on_the_way(distances: Mapping[str, float]) -> bool:
    """Return whether values are as near to those on the way to the right ones as to any fixed point."""
    known = [distance for name, distance in distances.items() if name != ON_THE_WAY]
    return distances.get(ON_THE_WAY, np.inf) <= min(known)


def pooled(distances: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the mean distance over tasks and seeds of each operator that all of them have."""
    means = {}
    for name in distances[0]:
        found = [each[name] for each in distances if name in each]
        if len(found) == len(distances):
            means[name] = float(np.mean(found))
    return means


def fingerprint(
    task: TaskLike, *, q: Any = None, values: Any = None, policy: Any = None, discount: float | None = None
) -> dict[str, float]:
    """Return the distances of learned values from the fixed points of operators, as shares of the spread of the right values.

    Operators without a fixed point are left out; one whose fixed point is that of the right one on this task has its distance.
    `ON_THE_WAY` has the distance from the nearest values on the way to the right ones.

    Args:
        task: a finite task that does not depend on the time, and whose observations tell its states apart.
        q: the learned Q-values: a table, float (O, A), of the numbers of discrete observations; or a function from observations
            (N, *shape) to (N, A).
        values: instead, the state values of a critic: a table (O,), or a function from observations to (N,).
        policy: with `values`, the probabilities of actions of the policy that they value, in the same form as `q`.
        discount: the learner's gamma; by default that of the task.

    Raises:
        SpecError: E712 where the task has no such fixed points, E713 where the values have the wrong shape.
    """
    if (q is None) == (values is None):
        misused("give either `q` or `values`")
    if values is not None and policy is None:
        misused("values are those of a policy", "give its probabilities of actions as `policy`")
    task = load(task)
    dynamics = dynamics_of(task, task.discount if discount is None else float(discount))
    model = dynamics.model
    rows = _Observed(task, model)
    reduce: Reduce = _best
    pi = _uniform(dynamics)
    if policy is not None:
        pi = rows.read(policy, model.n_actions).T
        dynamics = replace(dynamics, pi=pi, shares={})
        reduce = _Expected(pi)
    weights = _weights(dynamics, pi)
    learned = rows.read(q, model.n_actions).T if values is None else rows.read(values, None)
    if not np.isfinite(learned[..., weights > 0]).all():
        misused("the learned values are not finite numbers")
    points = _fixed_points(dynamics, reduce) if policy is not None else greedy_points(task, dynamics.gamma)
    if not points:
        refuse(f"values of {task.id} have no bound at discount {dynamics.gamma:g}", "give the learner's `discount`")
    (right_q,) = points["right"]
    right = right_q if values is None else reduce(right_q)
    scale = _spread(right_q, weights)
    distances = {}
    for name, found in points.items():
        each = found if values is None else [reduce(Q) for Q in found]
        nearest = min(each, key=lambda point: _distance(learned, point, weights))
        shows_mistake = name == "right" or _distance(nearest, right, weights) / scale >= RIGHT
        distances[name] = _distance(learned, nearest if shows_mistake else right, weights) / scale
    if policy is None:
        passed = _greedy_way(task, dynamics.gamma)
    else:
        passed = _way(dynamics, reduce, right_q, weights, _Actor(pi))
    if values is not None:
        passed = [reduce(Q) for Q in passed]
    distances[ON_THE_WAY] = min(_distance(learned, point, weights) for point in passed) / scale
    return distances


def first_value(task: TaskLike, *, q: Any = None, values: Any = None, **_: Any) -> float | None:
    """Return the learned value of the first states, in the mean over starts; None where it is not a finite number.

    Args:
        q, values: as `fingerprint` takes them; the value of Q is that of the best action.

    Raises:
        SpecError: as for `fingerprint`.
    """
    task = load(task)
    model = dynamics_of(task, task.discount).model
    rows = _Observed(task, model)
    if values is None:
        V = rows.read(q, model.n_actions).max(axis=1)
    else:
        V = rows.read(values, None)
    is_start = model.start > 0
    found = float(model.start[is_start] @ V[is_start])
    if np.isfinite(found):
        return found
    return None


@lru_cache(maxsize=32)
def greedy_points(task: Task, gamma: float) -> dict[str, list[Array]]:
    """Return the fixed points of each operator for learners that act greedily, Q (A, S): one, or one for each exploration."""
    return _fixed_points(dynamics_of(task, gamma), _best)


def _fixed_points(dynamics: Dynamics, reduce: Reduce) -> dict[str, list[Array]]:
    """Return the fixed points of each operator that has some: one, or one for each share of random actions.

    Without right values, there are none.
    """
    points = {}
    for name, operator in OPERATORS.items():
        reductions = [reduce]
        if operator.on_policy:
            reductions = [_OfBehaviour(exploration) for exploration in EXPLORATIONS]
        found = [fixed_point(dynamics, operator, each) for each in reductions]
        known = [Q for Q in found if Q is not None]
        if known:
            points[name] = known
        elif name == "right":
            break
    return points


# -- values that have not converged -----------------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _greedy_way(task: Task, gamma: float) -> list[Array]:
    """Return Q (A, S) on the ways of greedy learners, with each share of random actions."""
    dynamics = dynamics_of(task, gamma)
    (right,) = greedy_points(task, gamma)["right"]
    weights = _weights(dynamics, _uniform(dynamics))
    passed = []
    for exploration in WAYS:
        passed += _way(dynamics, _best, right, weights, partial(behaviour, exploration=exploration))
    return passed


def _way(
    dynamics: Dynamics, reduce: Reduce, right: Array, weights: Array, acts: Callable[[Array], Array]
) -> list[Array]:
    """Return Q (A, S) that a learner without a mistake passes on the way from 0 to the right values.

    A step is the expected change of Q-learning: values change in proportion to how often they are visited.

    Args:
        acts: from Q to the probabilities of actions (A, S) of the learner.
    """
    operator = OPERATORS["right"]
    Q = np.zeros_like(right)
    spread = _spread(right, weights)
    stride = max(STRIDE * spread, _distance(Q, right, weights) / POINTS)
    passed = [Q]
    rates = _rates(dynamics, acts(Q))
    for _ in range(SWEEPS):
        target = operator.backup(dynamics, Q, reduce(Q))
        Q = Q + rates * (target - Q)
        if _distance(Q, passed[-1], weights) >= stride:
            passed.append(Q)
            rates = _rates(dynamics, acts(Q))
        if _distance(Q, right, weights) <= RIGHT * spread:
            break
    return passed


def _rates(dynamics: Dynamics, pi: Array) -> Array:
    """Return step sizes (A, S) in proportion to the visits of a policy (A, S), half at most."""
    visits: Array = pi * dynamics.visits(pi).sum(axis=0)
    rates: Array = visits / visits.max() / 2
    return rates


@dataclass(frozen=True, eq=False)
class _OfBehaviour:
    """Q to V under the policy that is greedy for Q, with a share of random actions."""

    exploration: float

    def __call__(self, Q: Array) -> Array:
        expected: Array = (behaviour(Q, self.exploration) * Q).sum(axis=0)
        return expected


@dataclass(frozen=True, eq=False)
class _Actor:
    """A policy (A, S) that does not depend on Q."""

    pi: Array

    def __call__(self, Q: Array) -> Array:
        return self.pi


@dataclass(frozen=True, eq=False)
class _Expected:
    """Q to V under a policy (A, S)."""

    pi: Array

    def __call__(self, Q: Array) -> Array:
        expected: Array = (self.pi * Q).sum(axis=0)
        return expected


def _best(Q: Array) -> Array:
    best: Array = Q.max(axis=0)
    return best


class _Observed:
    """Observations of the states of a model."""

    def __init__(self, task: Task, model: Model) -> None:
        reader = ProbabilisticPolicy(task, np.asarray, 0)
        if reader.is_noisy or reader.sees_time:
            refuse(f"observations of {task.id} are not functions of the state")
        self.layout = task.observation_layout
        self.rows = reader.observe(states_of(model), 0, np.random.default_rng(0))
        parts = [np.asarray(part, np.float64).reshape(model.n_states, -1) for part in parts_of(self.rows)]
        flat = np.hstack(parts)
        acted = flat[model.acting]
        if len(np.unique(acted, axis=0)) < len(acted):
            refuse(f"two states of {task.id} look alike, so that they share their learned values")
        self.acting = model.acting

    def read(self, learned: Any, columns: int | None) -> Array:
        """Return learned numbers of every state, float64 (S, columns) or (S,).

        Raises:
            SpecError: E713 for another shape.
        """
        if callable(learned):
            found = np.asarray(learned(self.rows), np.float64)
        else:
            found = self._looked_up(np.asarray(learned, np.float64))
        shape = (len(self.acting),) if columns is None else (len(self.acting), columns)
        if columns is None:
            found = found.reshape(-1)
        if found.shape != shape:
            misused(f"learned values have shape {shape} for {shape[0]} observations here, not {found.shape}")
        return found

    def _looked_up(self, table: Array) -> Array:
        if self.layout.form != "discrete":
            misused("a table needs discrete observations", "give a function of observations")
        numbers = np.asarray(self.rows) - self.layout.starts[0]
        if len(table) != self.layout.counts[0]:
            misused(f"a table has {self.layout.counts[0]} rows here, one for each observation, not {len(table)}")
        looked: Array = table[numbers]
        return looked


def _uniform(dynamics: Dynamics) -> Array:
    """Return the probabilities (A, S) of uniformly random actions."""
    return np.full_like(dynamics.R, 1 / dynamics.model.n_actions)


def _weights(dynamics: Dynamics, pi: Array) -> Array:
    """Return the share (S,) of the visits of a policy (A, S) to each state."""
    visits = dynamics.visits(pi).sum(axis=0)
    weights: Array = visits / visits.sum()
    return weights


def _distance(one: Array, other: Array, weights: Array) -> float:
    """Return the root of the mean squared difference of Q (A, S) or V (S,), states weighted by visits."""
    squared = (one - other) ** 2
    if squared.ndim == 2:
        squared = squared.mean(axis=0)
    known = weights > 0
    return float(np.sqrt(squared[known] @ weights[known]))


def _spread(right: Array, weights: Array) -> float:
    """Return the standard deviation of the right Q (A, S) over visited states and actions; their size if they are all equal."""
    known = weights > 0
    each = right[:, known]
    share = weights[known] / len(each)
    mean = float((each * share).sum())
    deviation = float(np.sqrt((share * (each - mean) ** 2).sum()))
    size = float(np.abs(each).max())
    if deviation > 1e-3 * size:
        return deviation
    return size or 1.0
