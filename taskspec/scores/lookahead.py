"""How far one has to look ahead of random actions: the least lookahead that is enough, and the effective horizon.

After C. Laidlaw, S. Russell and A. Dragan, "Bridging RL Theory and Practice with the Effective Horizon" (NeurIPS 2023). Q1 is
the action value of uniformly random actions, and Q(k+1) one Bellman backup of Qk. A task is k-QVI-solvable if every policy
that is greedy for Qk is optimal. GORP plays the first action of the best of all A^k action sequences, each judged by m
episodes that go on at random; the effective horizon is the least k + log_A m by which it is optimal with probability 1/2.

The bound on m: let v be the largest Qk less the worst return from the state, times the largest possible return less that,
and d the gap of Qk between the best action and those that are not optimal. By Bernstein's inequality the mean of m returns
is off by d/2 with probability exp(-m d^2 / 4 / (2 v + v / 3)) at most. There are A^k sequences at each of T times, so that
m = 28/3 v / d^2 log(2 T A^k) is enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import how_to_raise, limits
from taskspec.model.model import Model, refuse
from taskspec.model.transitions import Steps
from taskspec.solve.backward import all_values, backward
from taskspec.solve.bounded import Bound, Bounded

SWEEP_RATE = 1e8
"""Nominal number of transitions per second, in all backups together."""
OVERHEAD = 20_000
BERNSTEIN = 28 / 3


class _Lookahead:
    """Value functions V[t] (S,) for t = 0 to T: of random, best and worst actions."""

    def __init__(self, model: Model) -> None:
        if model.horizon is None:
            refuse("episodes have no horizon")
        self.model = model
        self.horizon = model.horizon
        self.numbers = Bounded(model)
        if 4 * 16 * (self.horizon + 1) * model.n_states > limits().megabytes * 1e6:
            refuse("the values at every time do not fit into memory")
        self.spent = 0.0
        uniform = self.numbers.uniform
        self.random = self._values(lambda q: self.numbers.follow(uniform, q))
        self.best = self._values(self.numbers.top)
        self.worst = self._values(self.numbers.bottom)

    def _values(self, choose: Any) -> list[Bound]:
        end = self.numbers.zero()
        return [*all_values(backward(self.q, lambda t, q: choose(q), end, self.horizon)), end]

    def q(self, t: int, later: Bound) -> Bound:
        """Return the action values Q[t] (A, S) from V[t + 1]."""
        self.spent += (self.model.entries / len(self.model.steps) + OVERHEAD) / SWEEP_RATE
        if self.spent > limits().seconds:
            refuse(
                f"lookahead takes more than {limits().seconds} seconds", how_to_raise("seconds", 10 * limits().seconds)
            )
        return self.numbers.backup(t, later)

    def rounds(self) -> Iterator[tuple[int, list[Bound]]]:
        """Yield k and the value functions V[t] for t = 0 to T from which Qk is backed up."""
        values = self.random
        for k in range(1, self.horizon + 1):
            yield k, values
            later = [self.numbers.top(self.q(t, values[t + 1])) for t in range(self.horizon)]
            values = [*later, self.numbers.zero()]

    def optimal(self, t: int) -> Array:
        """Return which actions bool (A, S) are optimal at a time."""
        return np.asarray(self.numbers.greedy(self.q(t, self.best[t + 1])).table > 0)

    def onwards(self, t: int, states: Array, taken: Array) -> Array:
        """Return the states bool (S,) that some actions bool (A, S) lead to from some states bool (S,)."""
        rows = (taken & states).reshape(-1).astype(np.float64)
        return np.asarray(self.model.step(t).P.T @ rows > 0)


def least_lookahead(model: Model) -> int:
    """Return the least k for which every policy that is greedy for Qk is optimal."""
    ahead = _Lookahead(model)
    return next((k for k, values in ahead.rounds() if _is_solved(ahead, values)), ahead.horizon)


def _is_solved(ahead: _Lookahead, values: list[Bound]) -> bool:
    states = ahead.model.start > 0
    for t in range(ahead.horizon):
        taken = ahead.numbers.greedy(ahead.q(t, values[t + 1])).table > 0
        if (taken & states & ~ahead.optimal(t)).any():
            return False
        states = ahead.onwards(t, states, taken)
    return True


def effective_horizon(model: Model) -> float:
    """Return an upper bound of the effective horizon of a deterministic task: the least k + log_A m over k."""
    _check_deterministic(model)
    ahead = _Lookahead(model)
    least = float(ahead.horizon)  # all sequences of all actions, one episode each
    for k, values in ahead.rounds():
        if k >= least:
            break
        episodes = _episodes(ahead, k, values)
        least = min(least, k + math.log(episodes, model.n_actions))
    return least


def _check_deterministic(model: Model) -> None:
    if model.n_actions == 1:
        refuse("there is only one action")
    is_drawn = Steps(model.task).reward is not model.task.reward
    if is_drawn or np.count_nonzero(model.start) > 1 or any(step.rounding.terms > 1 for step in model.steps):
        refuse("the bound holds for deterministic tasks with one first state")


def _episodes(ahead: _Lookahead, k: int, values: list[Bound]) -> float:
    """Return the bound on m, the number of episodes for each sequence of k actions; infinite where there is none."""
    states = ahead.model.start > 0
    most = 1.0
    tries = math.log(2 * ahead.horizon) + k * math.log(ahead.model.n_actions)
    for t in range(ahead.horizon):
        q = ahead.q(t, values[t + 1])
        optimal = ahead.optimal(t)
        wrong = np.where(optimal, -np.inf, q.value + q.error).max(axis=0)
        clear = optimal & (q.value - q.error > wrong)
        if (states & ~clear.any(axis=0)).any():
            return math.inf
        top = q.value.max(axis=0)
        spread = (top - ahead.worst[t].value) * (ahead.best[t].value - ahead.worst[t].value)
        needed = np.ceil(BERNSTEIN * tries * spread[states] / (top - wrong)[states] ** 2)
        most = max(most, float(needed.max(initial=1.0)))
        states = ahead.onwards(t, states, clear)
    return most
