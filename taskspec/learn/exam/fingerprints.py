"""Fingerprints: which Bellman operator a learner really applies, read from the values that it learned.

A learner that bootstraps comes to the fixed point of the operator that its code applies. On a finite task the fixed points of the
right operator and of wrong ones are computed exactly, with the values on the way to them, since learners are stopped early; the
nearest operator names the mistake, without a right version to compare with.

The operators are in `taskspec.learn.exam.operators`, the symbols of this file in `taskspec.learn.exam.dynamics`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array, parts_of
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.policies.adapters import ProbabilisticPolicy
from taskspec.exact.policies.networks import outputs_of
from taskspec.exact.policies.policy import states_of
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.dynamics import Behaviour, Dynamics, EpsilonGreedy, dynamics_of
from taskspec.learn.exam.operators import GOOD, OPERATORS, BellmanOperator

RIGHT = 0.15
"""Values this near to right ones, as a share of their spread, are right."""
NEAR = 0.3
CLEARER = 0.5
"""A mistake is named if the values are within `NEAR` of those of its operator, and their distance is at most `CLEARER` of that
to right values."""
SAME = 0.03
"""Operators whose distances differ by less than this cannot be told apart."""
EXPLORATIONS = (0.1, 0.2, 0.4)
"""The shares of random actions of learners that act greedily otherwise."""
FIRST_STRIDE, GROWTH = 0.1, 1.08
"""Of the way to a fixed point: the share of its error by which the value that is visited most often changes in the first stride,
and how much longer each stride is than the one before."""
STRIDES = 2000
"""Strides of a way, at most."""
SLOWEST = 200
"""Strides in which the change of the values has to be halved."""
STRAIGHT = 0.01
"""Two changes of values have the same direction if they differ by less than this share, but for their length."""
LINE = np.linspace(0.02, 1, 50)
"""Points of a straight part of a way, as shares of its length."""
PRECISION = 1e-4
"""Change of the values, as a share of the largest reward, at which they are taken for the fixed point."""

EARLIER = (0.0, 0.2)
"""The shares of random actions of an actor that are tried: its critic values what it did until now, which was more random."""

Acts = Callable[[Array], Array]
"""From Q, (A, S), to the probabilities of actions, (A, S)."""


# -- values that operators lead to --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Way:
    """Values (N, A, S), or (N, S) of a critic, that learners pass who apply an operator; the last ones are its fixed point.

    They begin at the value before anything is learned. In a stride, values move towards their targets: all that are visited
    alike, or as much as their visits say, so that what is visited rarely is learned late. Where all reach their targets, and
    each change is a part of the one before, the rest of the way is one stride along a line.

    Attributes:
        points: the values, from the first to the last ones.
        Q: the last Q-values (A, S).
        settles: whether these are a fixed point.
    """

    points: Array
    Q: Array
    settles: bool

    @property
    def fixed_point(self) -> Array:
        found: Array = self.points[-1]
        return found


def way(dynamics: Dynamics, operator: BellmanOperator, acts: Acts, is_critic: bool, by_visits: bool) -> Way:
    """Return the values that a learner passes.

    Args:
        acts: how it acts.
        is_critic: whether V is the mean of Q under what it does, unless the operator says otherwise; else the largest Q.
        by_visits: whether values change in proportion to their visits; else all that are visited change alike.
    """
    Q = np.full_like(dynamics.R, dynamics.initial)
    size = max(1e-9, float(np.abs(dynamics.R).max()))
    behaviours: dict[bytes, Behaviour] = {}
    points = []
    settles = False
    stride: float | None = None
    slowest = np.inf
    change_before = np.zeros_like(Q)
    for number in range(STRIDES):
        pi = acts(Q)
        key = pi.tobytes()
        if key not in behaviours:
            behaviours[key] = Behaviour(dynamics, pi)
        behaviour = behaviours[key]
        V = _reduced(dynamics, operator, Q, behaviour, is_critic)
        points.append(V if is_critic else Q)
        error = operator.targets(dynamics, behaviour, Q, V) - Q
        visited = behaviour.visited
        rates = behaviour.rates if by_visits else visited
        if is_critic:
            visited = visited.max(axis=0)
            rates = rates.sum(axis=0) if by_visits else visited
        if stride is None:
            stride = FIRST_STRIDE / rates.max()
        shares = -np.expm1(-stride * rates)
        change = shares * error
        Q = Q + change
        stride *= GROWTH
        largest = float(np.abs(error * visited).max())
        if largest <= PRECISION * size:
            settles = True
            break
        if number % SLOWEST == SLOWEST - 1:
            if not largest < slowest / 2:
                break
            slowest = largest
        reach_targets = bool((shares >= 0.99 * (rates > 0)).all())
        rest = _rest(change, change_before) if reach_targets else None
        change_before = change
        if rest is None or acts(Q + rest).tobytes() != key:
            continue
        line = Q + LINE[:, None, None] * rest
        points += list(behaviour.expected(line) if is_critic else line)
        Q = line[-1]
        change_before = np.zeros_like(Q)
    return Way(np.array(points), Q, settles)


def _rest(change: Array, before: Array) -> Array | None:
    """Return the sum (A, S) of all changes to come, if each is the same part of the one before; None if they are not."""
    squared = float((before**2).sum())
    if squared == 0:
        return None
    ratio = float((change * before).sum()) / squared
    if not 0 < ratio < 1 or np.abs(change - ratio * before).max() > STRAIGHT * np.abs(change).max():
        return None
    found: Array = change * ratio / (1 - ratio)
    return found


def _reduced(dynamics: Dynamics, operator: BellmanOperator, Q: Array, behaviour: Behaviour, is_critic: bool) -> Array:
    if operator.reduce is not None:
        return operator.reduce(dynamics, behaviour, Q)
    if is_critic:
        return behaviour.expected(Q)
    best: Array = Q.max(axis=0)
    return best


@lru_cache(maxsize=64)
def greedy_ways(task: Task, gamma: float, initial: float = 0.0) -> dict[str, list[Way]]:
    """Return the ways of learners that act greedily, with several shares of random actions, by operator."""
    dynamics = replace(dynamics_of(task, gamma), initial=initial)
    acts = [EpsilonGreedy(exploration) for exploration in EXPLORATIONS]
    return _ways(dynamics, acts, is_critic=False)


def _ways(dynamics: Dynamics, acts: Sequence[Acts], is_critic: bool) -> dict[str, list[Way]]:
    kind = "values" if is_critic else "q"
    modes = (True, False) if is_critic else (True,)
    return {
        name: [way(dynamics, operator, each, is_critic, by_visits) for each in acts for by_visits in modes]
        for name, operator in OPERATORS.items()
        if operator.of in (None, kind) and operator.recognise is None
    }


# -- what explains values -----------------------------------------------------------------------------------------------


def fingerprint(
    task: TaskLike, *, q: Any = None, values: Any = None, policy: Any = None, discount: float | None = None
) -> dict[str, float]:
    """Return how far learned values are from those that each operator leads to: 0 to 1.

    Distances are shares of the spread of the right values, or of the distance to these, where that is larger. An operator
    without a fixed point, or with the right one on this task, has the distance of the right one; and where the values are right,
    none is nearer.

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
        ways = greedy_ways(task, dynamics.gamma, dynamics.initial)
        kind = "q"
    else:
        kind = "values"
        learned = rows.read(values, None)
        pi = rows.read(policy, model.n_actions).T
        ways = _ways(dynamics, [_Actor((1 - share) * pi + share / len(pi)) for share in EARLIER], is_critic=True)
    behaviour = Behaviour(dynamics, pi)
    weights = behaviour.total / behaviour.total.sum()
    if not np.isfinite(learned[..., weights > 0]).all():
        misused("the learned values are not finite numbers")
    right, *_ = ways["right"]
    if not right.settles:
        refuse(f"values of {task.id} have no bound at discount {dynamics.gamma:g}", "give the learner's `discount`")
    spread = _spread(right.Q, weights)

    def nearest(ways: Sequence[Way]) -> float:
        return min(float(_distance(learned, each.points, weights).min()) for each in ways)

    of_right = nearest(ways["right"])
    scale = max(spread, of_right)
    least = of_right if of_right <= RIGHT * spread else 0.0
    found = {}
    for name, known in ways.items():
        pairs = zip(known, ways["right"], strict=True)
        wrong = [each for each, right in pairs if each.settles and _far(each, right, weights) >= RIGHT * spread]
        distance = max(least, nearest(wrong)) if wrong else of_right
        found[name] = min(1.0, distance / scale)
    for name, operator in OPERATORS.items():
        if operator.recognise is not None and operator.of in (None, kind):
            recognised = operator.recognise(dynamics, learned)
            found[name] = found["right"] if recognised is None else recognised
    return found


def named(distances: Mapping[str, float], good: Sequence[str] = GOOD) -> list[str]:
    """Return the operators that explain distances: the nearest mistakes, where right values are clearly farther away.

    Otherwise those that are no mistake, within their tolerance; else none.

    Args:
        distances: by operator, the right one included.
        good: operators that are no mistake, the right one first.
    """
    known = {name: distances[name] for name in good if name in distances}
    best = min(known, key=lambda name: known[name])
    wrong = {name: distance for name, distance in distances.items() if name not in good}
    nearest = min(wrong.values())
    is_apart = known[best] - nearest >= SAME  # where both are near, what is right explains it
    if nearest <= NEAR and nearest <= CLEARER * known[best] and is_apart:
        return [name for name, distance in wrong.items() if distance <= nearest + SAME]
    if known[best] <= RIGHT:
        return [best]
    return []


def pooled(by_task: Iterable[Sequence[Mapping[str, float]]]) -> dict[str, float]:
    """Return the distance of each operator that all runs have: the mean over tasks of the median of the runs of a task.

    A run that has not converged may be far from what is right, and nearer to some mistake: one of several decides nothing.
    """
    medians = []
    for distances in by_task:
        common = [name for name in distances[0] if all(name in each for each in distances)]
        medians.append({name: float(np.median([each[name] for each in distances])) for name in common})
    common = [name for name in medians[0] if all(name in each for each in medians)]
    return {name: float(np.mean([each[name] for each in medians])) for name in common}


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


@dataclass(frozen=True, eq=False)
class _Actor:
    """A policy (A, S) that does not depend on Q."""

    pi: Array

    def __call__(self, Q: Array) -> Array:
        return self.pi


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


def _far(one: Way, other: Way, weights: Array) -> float:
    return float(_distance(one.fixed_point, other.fixed_point, weights))


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
