"""Rules as tables of probabilities at any time, and maximum entropy over trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.probabilities import UNIT
from taskspec.exact.model.transitions import OutcomeTable, Steps
from taskspec.exact.solve.backward import FixedRule, Greedy, Plan, PlannedRule, Rule, backward, rule_of
from taskspec.exact.solve.bounded import UNDERFLOW, Bound, Bounded, Policy
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon

MEMORY = 2**29
"""Bytes that the values kept for the tables of a plan may take."""


class Tables:
    """The tables (A, S) of a rule at any time, in floats.

    Values are kept at every k-th time, with k the root of the horizon, and between two of these while times there are
    asked for: asked in order, every time is worked out twice.
    """

    def __init__(self, model: Model, rule: PlannedRule) -> None:
        self.rule = rule
        self.numbers = Bounded(model)
        self.horizon = self.numbers.horizon
        self.backup = rule.backup(self.numbers)
        self.every = max(1, math.isqrt(self.horizon))
        size = (self.every + self.horizon // self.every) * model.n_states * 16
        if size > MEMORY:
            refuse(f"a plan for every time would take {size / 2**30:.1f} GB", "choose smaller parameters")
        self._kept: dict[int, Any] = {}
        self._near: dict[int, Any] = {}

    def __call__(self, t: int) -> Array:
        after = min(t, self.horizon - 1) + 1
        if not self._kept:
            self._kept = self._walk(self.horizon, 0, self.numbers.zero(), self.every)
        if after not in self._near:
            stop = min(-(-after // self.every) * self.every, self.horizon)
            self._near = self._walk(stop, max(0, stop - self.every), self._kept[stop], 1)
        q = self.backup(after - 1, self._near[after])
        policy: Policy = self.rule.policy(self.numbers, q)
        return policy.table

    def _walk(self, high: int, low: int, end: Any, every: int) -> dict[int, Any]:
        found = {high: end}
        for t, _, value in backward(self.backup, lambda t, q: self.rule.value(self.numbers, q), end, high, low):
            if t % every == 0:
                found[t] = value
        return found


def tables(model: Model, rule: Rule) -> Plan:
    """Return a rule's probabilities of actions at any time."""
    if model.horizon is None:
        return stationary(rule.stationary(InfiniteHorizon(model)).table)
    if isinstance(rule, PlannedRule):
        return Tables(model, rule)
    assert isinstance(rule, FixedRule)
    numbers = Bounded(model)
    if not rule.is_timed:
        return stationary(rule.policy(numbers, 0).table)
    return lambda t: np.asarray(rule.policy(numbers, t).table)


def stationary(table: Array) -> Plan:
    return lambda t: table


def timed(found: Sequence[Array]) -> Plan:
    """Return one table for each time; the last one ever after."""
    return lambda t: found[min(t, len(found) - 1)]


def uniform_plan(model: Model) -> Plan:
    return stationary(model.uniform)


def optimal_plan(model: Model) -> Plan:
    return tables(model, Greedy())


def expert_plan(model: Model) -> Plan | None:
    """Return the expert that the task's spec gives, or None."""
    rule = rule_of(model)
    if rule is None:
        return None
    return tables(model, rule)


@dataclass(frozen=True)
class MaxEnt(PlannedRule):
    """The policy of trajectories in proportion to their likelihood times the exponential of their return.

        p(tau)  is proportional to  P(tau) exp(beta R(tau)),

    where tau = (s0, a0, s1, ...) runs until the horizon or a terminal state, P(tau) is the product of the start's and the
    transitions' probabilities, and R(tau) is its discounted return: the model of Ziebart et al. (2008) for stochastic
    dynamics. Outcomes are weighed by what they pay, as if the agent could choose them. With Z_T = 1 and Z = 1 at terminal
    states,

        Z_t(s, a) = E[exp(beta gamma^t r) Z_{t+1}(s')],   Z_t(s) = sum over a of Z_t(s, a),

    and the policy that acts as such trajectories do, given the state they are in, is Z_t(s, a)/Z_t(s). Q is log Z (A, S), and
    V is log Z (S,).
    """

    beta: float = 1.0
    is_rational: ClassVar[bool] = False

    def backup(self, numbers: Bounded) -> Callable[[int, Bound], Bound]:
        """Return the function that gives log Z (A, S) at t from log Z (S,) at t + 1."""
        model = numbers.model
        if model.horizon is None:
            refuse("trajectories without a horizon have no maximum-entropy distribution", "give the task a horizon")
        if Steps(model.task).reward is not model.task.process.reward:
            refuse("maximum entropy depends on the whole distribution of a reward, and this one is continuous")
        known: dict[int, _LogOutcomes] = {}

        def back(t: int, log_z: Bound) -> Bound:
            key = id(model.step(t))
            if key not in known:
                known.clear()
                known[key] = _LogOutcomes(numbers, t, self.beta)
            return known[key].log_q(log_z, t)

        return back

    def value(self, numbers: Bounded, q: Bound) -> Bound:
        return numbers.soft(q, 1.0)

    def policy(self, numbers: Bounded, q: Bound) -> Policy:
        return numbers.boltzmann(q, 1.0)

    def stationary(self, numbers: Any) -> Any:
        return self.backup(numbers)  # refuses


class _LogOutcomes:
    """Every outcome of one time in order of its row: column, log probability, beta times the reward, whether it ends."""

    def __init__(self, numbers: Bounded, t: int, beta: float) -> None:
        model = numbers.model
        found = outcome_table(model, t)
        weights = found.weight
        self.numbers = numbers
        self.columns = found.column
        self.ends = found.ends
        self.paid = beta * np.where(model.acting[found.row % model.n_states], found.reward, 0.0)
        self.logs = np.log(weights)
        slack = numbers.slack
        off = slack.relative + 2 * slack.absolute / weights + 8 * UNIT * (np.abs(self.logs) + 1)
        self.error = float(np.max(off, initial=0.0))
        if slack.missing > 0 or weights.min(initial=1.0) < UNDERFLOW:  # outcomes that are left out may pay anything
            self.error = np.inf
        self.counts = np.bincount(found.row, minlength=model.n_actions * model.n_states)

    def log_q(self, log_z: Bound, t: int) -> Bound:
        """log Z(s, a), (A, S), from log Z (S,) at the next time; 0 for rows without outcomes, where nobody acts."""
        discount = self.numbers.model.discount
        paid = discount**t * self.paid
        powers = 0 if discount == 1 else t
        rounded = 8 * UNIT * float(np.max(np.abs(paid), initial=0.0)) * (1 + powers)
        terms = self.logs + paid + np.where(self.ends, 0.0, log_z.value[self.columns])
        some = self.counts > 0
        counts = self.counts[some]
        starts = np.cumsum(counts) - counts
        top = np.maximum.reduceat(terms, starts)
        total = np.add.reduceat(np.exp(terms - np.repeat(top, counts)), starts)
        found = np.zeros(len(self.counts))
        found[some] = top + np.log(total)
        size = 1 + float(np.max(np.abs(found), initial=0.0))
        rounding = (16 * int(counts.max(initial=0)) + 32) * UNIT * size
        error = self.error + rounded + float(log_z.error.max(initial=0.0)) + rounding
        return Bound(found.reshape(self.numbers.shape), 0.0, error)


def outcome_table(model: Model, t: int = 0) -> OutcomeTable:
    """Return every outcome at a time that may happen and stays in the model."""
    found = Steps(model.task).table(model.codes, t)
    kept = (found.weight > 0) & found.inside
    return OutcomeTable(*(column[kept] for column in found))
