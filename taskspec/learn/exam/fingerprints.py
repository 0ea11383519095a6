"""Fingerprints: which Bellman operator a learner really applies, read from the values that it learned.

A learner that bootstraps comes to the fixed point of the operator that its code applies. On a finite task the fixed points of the
right operator and of wrong ones are computed exactly. A learner that is stopped early is on its way (`taskspec.learn.exam.ways`):
what is right is compared with all values on the way there, what is wrong with the fixed point alone. So values that are not
finished speak for no mistake.

The operators are in `taskspec.learn.exam.operators`, the symbols of this file in `taskspec.learn.exam.dynamics`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import misused, refuse
from taskspec.language.task.task import TaskLike
from taskspec.learn.exam.learned_values import LearnedValues
from taskspec.learn.exam.operators import APART, GOOD, MOVED, OPERATORS, Fit
from taskspec.learn.exam.ways import Way, actor_ways, greedy_ways, on_policy_ways


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
    return fits_of(LearnedValues(task, q, values, policy, discount))


def fits_of(known: LearnedValues) -> dict[str, Fit]:
    """Return the same of learned values that are read already."""
    learned = known.learned
    dynamics = known.dynamics
    if known.kind == "q":
        greedy = greedy_ways(known.task, dynamics.gamma, dynamics.initial)
        on_policy = on_policy_ways(known.task, dynamics.gamma, dynamics.initial)
        ways = {name: [*passed, *on_policy.get(name, ())] for name, passed in greedy.items()}
        rights = [*ways["right"], *ways["on policy"]]
    else:
        ways = actor_ways(dynamics, known.pi)
        rights = ways["right"]
    weights = known.weights
    if not np.isfinite(learned[..., weights > 0]).all():
        misused("the learned values are not finite numbers")
    right = rights[0]
    if not right.settles:
        refuse(
            f"values of {known.task.id} have no bound at discount {dynamics.gamma:g}", "give the learner's `discount`"
        )
    has_moved = np.ptp(learned[..., dynamics.acted]) > MOVED * np.ptp(right.fixed_point[..., dynamics.acted])
    fits = _distances(learned, ways, rights, weights, has_moved)
    for name, operator in OPERATORS.items():
        if operator.recognise is not None and operator.of in (None, known.kind):
            with np.errstate(over="ignore", invalid="ignore"):
                fit = operator.recognise(dynamics, known.behaviour, learned, [each.fixed_point for each in rights])
            if fit is not None:
                fits[name] = fit
    return fits


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
