"""Measures of difficulty from optimal action values: how far to look ahead, gaps of worse actions, how much chance matters.

Lookahead follows C. Laidlaw, S. Russell and A. Dragan, "Bridging RL Theory and Practice with the Effective Horizon" (NeurIPS
2023): Q1 is the action value of uniformly random actions, and Q(k+1) one Bellman backup of Qk. A task is k-QVI-solvable if every
policy that is greedy for Qk is optimal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import how_to_raise, limits
from taskspec.model.model import Model, refuse
from taskspec.scores.gorp import Gorp
from taskspec.solve.backward import all_values, backward
from taskspec.solve.bounded import Bound, Bounded
from taskspec.solve.infinite_horizon import InfiniteHorizon

SWEEP_RATE = 1e8
"""Nominal number of transitions per second, in all backups together."""
OVERHEAD = 20_000


class _Lookahead:
    """Value functions V[t] (S,) for t = 0 to T, and the action values that follow from them."""

    def __init__(self, model: Model) -> None:
        if model.horizon is None:
            refuse("episodes have no horizon")
        self.model = model
        self.horizon = model.horizon
        self.numbers = Bounded(model)
        if 3 * 16 * (self.horizon + 1) * model.n_states > limits().megabytes * 1e6:
            refuse("the values at every time do not fit into memory")
        self.spent = 0.0

    @cached_property
    def random(self) -> list[Bound]:
        """The value functions V[t] of random actions, for t = 0 to T."""
        return self._values(lambda q: self.numbers.follow(self.numbers.uniform, q))

    @cached_property
    def best(self) -> list[Bound]:
        """The optimal value functions V*[t], for t = 0 to T."""
        return self._values(self.numbers.top)

    def _values(self, choose: Any) -> list[Bound]:
        end = self.numbers.zero()
        return [*all_values(backward(self.q, lambda t, q: choose(q), end, self.horizon)), end]

    def q(self, t: int, later: Bound) -> Bound:
        """Return the action values Q[t] (A, S) from V[t + 1]."""
        seconds = limits().seconds
        self.spent += (self.model.entries / len(self.model.steps) + OVERHEAD) / SWEEP_RATE
        if self.spent > seconds:
            refuse(f"lookahead takes more than {seconds} seconds", how_to_raise("seconds", 10 * seconds))
        return self.numbers.backup(t, later)

    def rounds(self) -> Iterator[tuple[int, list[Bound]]]:
        """Yield k and the value functions V[t] for t = 0 to T from which Qk is backed up."""
        values = self.random
        for k in range(1, self.horizon + 1):
            yield k, values
            values = [self.numbers.top(self.q(t, values[t + 1])) for t in range(self.horizon)]
            values.append(self.numbers.zero())

    def optimal(self, t: int) -> Array:
        """Return which actions bool (A, S) are optimal at a time."""
        return np.asarray(self.numbers.greedy(self.q(t, self.best[t + 1])).table > 0)

    def onwards(self, t: int, states: Array, taken: Array) -> Array:
        """Return the states bool (S,) that some actions bool (A, S) lead to from some states bool (S,)."""
        rows = (taken & states).reshape(-1).astype(np.float64)
        return np.asarray(self.model.step(t).P.T @ rows > 0)

    def is_solved(self, values: list[Bound]) -> bool:
        """Return whether every policy that is greedy for Qk is optimal."""
        states = self.model.start > 0
        for t in range(self.horizon):
            taken = self.numbers.greedy(self.q(t, values[t + 1])).table > 0
            if (taken & states & ~self.optimal(t)).any():
                return False
            states = self.onwards(t, states, taken)
        return True


def action_gaps(model: Model) -> Array:
    """Return the gaps (N,) V*[t, s] - Q*[t, s, a] of all actions that are not optimal, in all states that episodes act in."""
    gaps = []
    for acting, numbers, q in _optimal_action_values(model):
        worse = acting & (numbers.greedy(q).table == 0)
        if model.legal is not None:
            worse &= model.legal
        gap = numbers.top(q).value - q.value
        gaps.append(gap[worse])
    found = np.concatenate(gaps)
    if not len(found):
        refuse("every action is optimal")
    return found


def _optimal_action_values(model: Model) -> Iterator[tuple[Array, Bounded, Bound]]:
    """Yield, for each time, the states (S,) in which episodes act, the arithmetic, and Q* (A, S) in it."""
    if model.horizon is None:
        numbers = InfiniteHorizon(model)
        yield model.acting, numbers, numbers.q_values()
        return
    plan = _Lookahead(model)
    for t, acting in model.levels():
        yield acting, plan.numbers, plan.q(t, plan.best[t + 1])


def value_norm(model: Model) -> float:
    """Return the largest standard deviation of the optimal value of the next state, over states and actions of all times."""
    plan = _Lookahead(model)
    largest = 0.0
    for t, acting in model.levels():
        V = plan.best[t + 1].value
        P = model.step(t).P
        spread = P @ V**2 - (P @ V) ** 2
        variance = model.among_legal(spread.reshape(model.n_actions, model.n_states), 0.0)[:, acting]
        largest = max(largest, float(variance.max()))
    return math.sqrt(largest)


def least_lookahead(model: Model) -> int:
    """Return the least k for which every policy that is greedy for Qk is optimal."""
    ahead = _Lookahead(model)
    return next((k for k, values in ahead.rounds() if ahead.is_solved(values)), ahead.horizon)


def effective_horizon(model: Model) -> float:
    """Return the effective horizon of a deterministic task."""
    return Gorp(model, _Lookahead(model).optimal).horizon_in_steps()
