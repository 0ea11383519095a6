"""Fingerprints: which Bellman operator a learner really applies, read from the values that it learned.

A learner that bootstraps comes to the fixed point of the operator that its code applies. On a finite task the fixed points of the
right operator and of wrong ones are computed exactly. A learner that is stopped early is on its way (`taskspec.learn.exam.ways`):
what is right is compared with all values on the way there, what is wrong with the fixed point alone. So values that are not
finished speak for no mistake.

The operators are in `taskspec.learn.exam.operators`, the symbols of this file in `taskspec.learn.exam.dynamics`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.policies.networks import outputs_of
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.dynamics import Behaviour, Dynamics, dynamics_of
from taskspec.learn.exam.operators import APART, GOOD, MOVED, OPERATORS, Fit
from taskspec.learn.exam.ways import Way, actor_ways, greedy_ways, on_policy_ways, right_values


def fingerprint(
    task: TaskLike, *, q: Any = None, values: Any = None, policy: Any = None, discount: float | None = None
) -> dict[str, Fit]:
    """Return how far learned values are from those that each operator leads to, 0 to 1, and how many values tell it from right.

    Distances are shares of the spread of the right values, or of the distance to these, where that is larger. An operator
    without a fixed point, or with the right one on this task, is left out.

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
    pi = np.full_like(dynamics.R, 1 / model.n_actions)
    if values is None:
        learned = rows.read(q, model.n_actions).T
        dynamics = replace(dynamics, initial=_initial(learned, dynamics))
        greedy = greedy_ways(task, dynamics.gamma, dynamics.initial)
        on_policy = on_policy_ways(task, dynamics.gamma, dynamics.initial)
        ways = {name: [*known, *on_policy.get(name, ())] for name, known in greedy.items()}
        rights = [*ways["right"], *ways["on policy"]]
        kind = "q"
    else:
        kind = "values"
        learned = rows.read(values, None)
        pi = rows.read(policy, model.n_actions).T
        ways = actor_ways(dynamics, pi)
        rights = ways["right"]
    behaviour = Behaviour(dynamics, pi)
    weights = behaviour.total / behaviour.total.sum()
    if not np.isfinite(learned[..., weights > 0]).all():
        misused("the learned values are not finite numbers")
    right = rights[0]
    if not right.settles:
        refuse(f"values of {task.id} have no bound at discount {dynamics.gamma:g}", "give the learner's `discount`")
    has_moved = np.ptp(learned[..., dynamics.acted]) > MOVED * np.ptp(right.fixed_point[..., dynamics.acted])
    found = _distances(learned, ways, rights, weights, has_moved)
    for name, operator in OPERATORS.items():
        if operator.recognise is not None and operator.of in (None, kind):
            with np.errstate(over="ignore", invalid="ignore"):
                fit = operator.recognise(dynamics, behaviour, learned, [each.fixed_point for each in rights])
            if fit is not None:
                found[name] = fit
    return found


def _distances(
    learned: Array, ways: Mapping[str, Sequence[Way]], rights: Sequence[Way], weights: Array, has_moved: bool
) -> dict[str, Fit]:
    """Return the distances of all operators that have a fixed point, other than the right one.

    Args:
        rights: the right way beside each way of a mistake.
        has_moved: whether anything was learned; else the begin of the way to right values is no explanation.
    """

    def nearest(way: Way) -> float:
        points = way.points if has_moved else way.points[-1:]
        return float(_distance(learned, points, weights).min())

    spread = _spread(ways["right"][0].Q, weights)
    of_right = min(map(nearest, ways["right"]))
    scale = max(spread, of_right)
    found = {"right": Fit(min(1.0, of_right / scale), 0)}
    for name, known in ways.items():
        fits = []
        for each, right in zip(known, rights, strict=False):
            if not each.settles:
                continue
            if name in GOOD:
                distance = nearest(each)
            else:
                distance = float(_distance(learned, each.fixed_point, weights))
            differs = _distance(each.fixed_point, right.fixed_point, weights) >= APART * spread
            apart = np.abs(each.fixed_point - right.fixed_point)[..., weights > 0]
            fits.append((distance, differs, int((apart >= APART * spread).sum())))
        if fits:
            distance, differs, told = min(fits)
            if differs:
                found[name] = Fit(min(1.0, distance / scale), told)
    return found


def is_read(task: Task) -> bool:
    """Return whether learned values of a task can be compared: it is finite, shows its state, and does not depend on the time."""
    try:
        _Observed(task, dynamics_of(task, task.discount).model)
    except SpecError:
        return False
    return True


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


def explained(
    task: TaskLike, *, values: Any = None, policy: Any = None, discount: float | None = None, **_: Any
) -> float | None:
    """Return how much a critic explains of the values of its policy: 1 less the size of its errors, as a share of the values.

    Args:
        values, policy, discount: as `fingerprint` takes them.

    Returns:
        1 for right values, 0 or less for those that say nothing; None without a critic, or where all values are 0.

    Raises:
        SpecError: as for `fingerprint`.
    """
    if values is None:
        return None
    task = load(task)
    dynamics = dynamics_of(task, task.discount if discount is None else float(discount))
    rows = _Observed(task, dynamics.model)
    pi = rows.read(policy, dynamics.model.n_actions).T
    V = rows.read(values, None)
    weights = Behaviour(dynamics, pi).total
    right = right_values(dynamics, pi)
    size = float(weights @ right**2)
    error = float(weights @ (V - right) ** 2)
    if size == 0 or not np.isfinite(error):
        return None
    return 1 - float(np.sqrt(error / size))


def _initial(learned: Array, dynamics: Dynamics) -> float:
    """Return the value before anything was learned: that of states in which no episode acts, if it is one and the same."""
    kept = learned[:, ~dynamics.acted]
    if kept.size and np.isfinite(kept).all() and np.ptp(kept) == 0:
        return float(kept.flat[0])
    return 0.0


def _distance(one: Array, other: Array, weights: Array) -> Array:
    """Return the root (...) of the mean squared difference of Q (..., A, S) or V (..., S), states weighted by visits.

    Which of the two have actions shows in the learned ones, `one`.
    """
    with np.errstate(over="ignore"):
        squared = (one - other) ** 2
    if one.ndim == 2:
        squared = squared.mean(axis=-2)
    known = weights > 0
    found: Array = np.sqrt(squared[..., known] @ weights[known])
    return found


class _Observed:
    """Observations of the states of a model."""

    def __init__(self, task: Task, model: Model) -> None:
        shown = StateObservations(model)
        if not shown.is_known or shown.is_timed:
            refuse(f"observations of {task.id} are not functions of the state")
        self.layout = task.observation_layout
        self.rows = shown.at(0)
        flat = shown.matrix(0)
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
            found = np.asarray(outputs_of(learned)(self.rows), np.float64)
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
