"""The values that a learner passes on its way to the fixed point of a Bellman operator.

The symbols of this file are in `taskspec.learn.exam.dynamics`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.task.task import Task
from taskspec.learn.exam.dynamics import EXPLORATIONS, Behaviour, Dynamics, EpsilonGreedy, dynamics_of
from taskspec.learn.exam.operators import GOOD, OPERATORS, BellmanOperator

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

Acts = Callable[[Array], Array]
"""From Q, (A, S), to the probabilities of actions, (A, S)."""
EARLIER = (0.0, 0.2)
"""The shares of random actions of an actor that are tried: its critic values what it did until now, which was more random."""


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
        last: Array = self.points[-1]
        return last


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
        V = reduced(dynamics, operator, Q, behaviour, is_critic)
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


def reduced(dynamics: Dynamics, operator: BellmanOperator, Q: Array, behaviour: Behaviour, is_critic: bool) -> Array:
    """Return V (S,) from Q (A, S), as an operator has it."""
    if operator.reduce is not None:
        return operator.reduce(dynamics, behaviour, Q)
    if is_critic:
        return behaviour.expected(Q)
    best: Array = Q.max(axis=0)
    return best


@lru_cache(maxsize=64)
def greedy_ways(task: Task, gamma: float, initial: float = 0.0) -> dict[str, list[Way]]:
    """Return the ways of learners that act greedily, with several shares of random actions, by operator.

    Those of mistakes are the ones that end soonest: all states that are visited change alike.
    """
    dynamics = replace(dynamics_of(task, gamma), initial=initial)
    return {name: _explored(dynamics, operator, name in GOOD) for name, operator in _operators("q").items()}


@lru_cache(maxsize=64)
def on_policy_ways(task: Task, gamma: float, initial: float = 0.0) -> dict[str, list[Way]]:
    """Return the same of learners that value what they do, exploration included, where a mistake leaves that open."""
    dynamics = replace(dynamics_of(task, gamma), initial=initial)
    ways = {}
    for name, operator in _operators("q").items():
        if name not in GOOD and operator.reduce is None:
            ways[name] = _explored(dynamics, replace(operator, reduce=OPERATORS["on policy"].reduce), by_visits=False)
    return ways


def _explored(dynamics: Dynamics, operator: BellmanOperator, by_visits: bool) -> list[Way]:
    ways = []
    for share in EXPLORATIONS:
        ways.append(way(dynamics, operator, EpsilonGreedy(share), is_critic=False, by_visits=by_visits))
    return ways


def actor_ways(dynamics: Dynamics, pi: Array) -> dict[str, list[Way]]:
    """Return the ways of critics of an actor with a policy (A, S), by operator; of mistakes, those that end soonest."""
    ways: dict[str, list[Way]] = {}
    for name, operator in _operators("values").items():
        modes = (False, True) if name in GOOD else (False,)
        ways[name] = []
        for by_visits in modes:
            for share in EARLIER:
                acts = _Actor((1 - share) * pi + share / len(pi))
                ways[name].append(way(dynamics, operator, acts, is_critic=True, by_visits=by_visits))
    return ways


def right_values(dynamics: Dynamics, pi: Array) -> Array:
    """Return the right values (S,) of a policy (A, S)."""
    return way(dynamics, OPERATORS["right"], _Actor(pi), is_critic=True, by_visits=False).fixed_point


def _operators(kind: Literal["q", "values"]) -> dict[str, BellmanOperator]:
    """Return the operators that have a fixed point, for Q-values, or for the values of a critic."""
    return {
        name: operator
        for name, operator in OPERATORS.items()
        if operator.of in (None, kind) and operator.recognise is None
    }


@dataclass(frozen=True, eq=False)
class _Actor:
    """A policy (A, S) that does not depend on Q."""

    pi: Array

    def __call__(self, Q: Array) -> Array:
        return self.pi
