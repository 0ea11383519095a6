"""The least lookahead beyond random actions that is enough, and the next states of random actions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.model.model import Model, refuse
from taskspec.model.transitions import Steps
from taskspec.solve.backward import all_values, backward
from taskspec.solve.bounded import Bound, Bounded

# ---------- chances
# What one step of uniformly random actions may come to: next states together with what is paid, not its expectation.

CHUNK = 65_536
RATE = 1_000_000
"""Outcomes that are listed in a second, nominally."""


@dataclass(frozen=True)
class StepOutcomes:
    """Every outcome (N,) of a step from a state: where it leads, what it pays, whether it ends, its probability.

    They are sorted by `state`, and no two are alike. `first` (S + 1,) says where those of each state begin.
    """

    state: Array
    target: Array
    reward: Array
    ends: Array
    weight: Array
    first: Array


class RandomSteps:
    """The chances at each time, listed when they are asked for, in the states in which episodes act.

    Raises:
        SpecError: (E712) when there are too many, or infinitely many.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.steps = model, Steps(model.task, as_paid=True)
        self.acting = np.flatnonzero(model.acting)
        self._known: dict[int, StepOutcomes] = {}
        if self.steps.branching == np.inf:
            refuse("rewards are drawn from a distribution that has infinitely many outcomes")
        times = (model.horizon or 1) if self.steps.uses_time else 1
        size = times * len(self.acting) * model.n_actions * self.steps.branching
        if size > limits().seconds * RATE:
            refuse(f"random steps have {count(int(size))} outcomes", how_to_raise("seconds", size / RATE))

    def at(self, t: int) -> StepOutcomes:
        time = t if self.steps.uses_time else 0
        if time not in self._known:
            self._known[time] = self._listed(time)
        return self._known[time]

    def _listed(self, t: int) -> StepOutcomes:
        parts = list(self._parts(t))
        state, target, reward, ends, weight = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.lexsort((reward, ends, target, state))
        state, target, reward, ends, weight = (x[order] for x in (state, target, reward, ends, weight))
        new = np.ones(len(state), np.bool_)
        new[1:] = np.logical_or.reduce([x[1:] != x[:-1] for x in (state, target, reward, ends)])
        at = np.flatnonzero(new)
        total = np.add.reduceat(weight, at) / self.model.n_actions
        first = np.searchsorted(state[at], np.arange(self.model.n_states + 1))
        return StepOutcomes(state[at], target[at], reward[at], ends[at], total, first)

    def _parts(self, t: int) -> Iterator[tuple[Array, ...]]:
        """State, target, reward, end and probability of outcomes, some actions in some states at a time."""
        codes, rows = self.model.codes, len(self.acting) * self.model.n_actions
        size = max(1, int(CHUNK // max(1.0, min(self.steps.branching, CHUNK))))
        for low in range(0, rows, size):
            action, which = np.divmod(np.arange(low, min(rows, low + size)), len(self.acting))
            state = self.acting[which]
            for found in self.steps.outcomes(codes[state], action, t):
                at = state if found.origin is None else state[found.origin]
                target = np.searchsorted(codes, found.code)
                given = (at, target, found.reward.astype(np.float64), found.terminal, found.weight)
                yield tuple(np.broadcast_to(x, (len(at),)) for x in given)


# ---------- greedy
# How far one has to look ahead of random actions: the least lookahead that is enough, and the effective horizon.
#
# After C. Laidlaw, S. Russell and A. Dragan, "Bridging RL Theory and Practice with the Effective Horizon" (NeurIPS 2023). Q1 is
# the action value of uniformly random actions, and Q(k+1) one Bellman backup of Qk. A task is k-QVI-solvable if every policy
# that is greedy for Qk is optimal. GORP plays the first action of the best of all A^k action sequences, each judged by m
# episodes that go on at random; the effective horizon is the least k + log_A m by which it is optimal with probability 1/2.
#
# The bound on m: let v be the largest Qk less the worst return from the state, times the largest possible return less that,
# and d by how much Qk tells the best action from those that are not optimal. By Bernstein's inequality the mean of m returns
# is off by d/2 with probability exp(-m d^2 / 4 / (2 v + v / 3)) at most. There are A^k sequences at each of T times, so that
# m = 28/3 v / d^2 log(2 T A^k) is enough.

SWEEP_RATE = 1e8
"""Non-zeros that are gone through in a second, nominally, in all the backups that it takes."""
OVERHEAD = 20_000
BERNSTEIN = 28 / 3


class _Lookahead:
    """Values at every time, (T + 1) of (S,): of random actions, of the best and of the worst."""

    def __init__(self, model: Model) -> None:
        if model.horizon is None:
            refuse("episodes have no horizon")
        self.model, self.horizon, self.numbers = model, model.horizon, Bounded(model)
        if 4 * 16 * (self.horizon + 1) * model.n_states > limits().megabytes * 1e6:
            refuse("the values at every time do not fit into memory")
        self.spent = 0.0
        uniform = self.numbers.uniform()
        self.random = self._values(lambda q: self.numbers.follow(uniform, q))
        self.best = self._values(self.numbers.top)
        self.worst = self._values(self.numbers.bottom)

    def _values(self, choose: Any) -> list[Bound]:
        end = self.numbers.zero()
        return [*all_values(backward(self.q, lambda t, q: choose(q), end, self.horizon)), end]

    def q(self, t: int, later: Bound) -> Bound:
        """Action values (A, S) at a time."""
        self.spent += (self.model.entries / len(self.model.steps) + OVERHEAD) / SWEEP_RATE
        if self.spent > limits().seconds:
            refuse(
                f"lookahead takes more than {limits().seconds} seconds", how_to_raise("seconds", 10 * limits().seconds)
            )
        return self.numbers.backup(t, later)

    def rounds(self) -> Iterator[tuple[int, list[Bound]]]:
        """For each k, the values (T + 1) by which Qk is worked out: those at a time are of what comes after it."""
        values = self.random
        for k in range(1, self.horizon + 1):
            yield k, values
            later = [self.numbers.top(self.q(t, values[t + 1])) for t in range(self.horizon)]
            values = [*later, self.numbers.zero()]

    def optimal(self, t: int) -> Array:
        """Which actions (A, S) are optimal at a time."""
        return np.asarray(self.numbers.greedy(self.q(t, self.best[t + 1])).table > 0)

    def onwards(self, t: int, states: Array, taken: Array) -> Array:
        """Where some actions (A, S) lead to from some states."""
        rows = (taken & states).reshape(-1).astype(np.float64)
        return np.asarray(self.model.step(t).P.T @ rows > 0)


def least_lookahead(model: Model) -> int:
    """The least k by which every policy that is greedy for Qk is optimal."""
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
    """A bound on the effective horizon of a deterministic task: the least k + log_A m over k, with an m that is enough."""
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
    """How many episodes are enough for each sequence of k actions; infinite where none are."""
    states, most = ahead.model.start > 0, 1.0
    tries = math.log(2 * ahead.horizon) + k * math.log(ahead.model.n_actions)
    for t in range(ahead.horizon):
        q, optimal = ahead.q(t, values[t + 1]), ahead.optimal(t)
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
