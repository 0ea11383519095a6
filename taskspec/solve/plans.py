"""Ways to choose actions on a model, each worked out from the last time to the first in any arithmetic.

A rule gives the policy at a time from the action values of that time, so that one table is held at a time; `tables` gives
those of any time, in floats, and keeps values at a few times only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Node, draws, reads
from taskspec.model.model import Model, refuse
from taskspec.model.transitions import TIME, count
from taskspec.solve.backward import Rule, backward
from taskspec.solve.bounded import Bound, Bounded, Policy
from taskspec.solve.maxent import MaxEnt
from taskspec.task.task import Soft

Plan = Callable[[int], Array]
"""The probability of each action in each state, (A, S), at a time."""
MEMORY = 2**29
"""Bytes that the values kept for the tables of a plan may take."""


class Uniform(Rule):
    """Uniformly random actions."""

    is_timed = False

    def policy(self, numbers: Any, t: int, q: Any) -> Any:
        return numbers.uniform()

    def stationary(self, numbers: Any) -> Any:
        return numbers.uniform()


@dataclass(frozen=True)
class Expressed(Rule):
    """Actions given by expressions, which may draw (finitely many outcomes) and read the time."""

    nodes: tuple[Node, ...]

    @cached_property
    def is_drawn(self) -> bool:  # type: ignore[override]
        return bool(draws(self.nodes))

    @cached_property
    def is_timed(self) -> bool:  # type: ignore[override]
        return TIME in reads(self.nodes)

    def policy(self, numbers: Any, t: int, q: Any) -> Any:
        return numbers.tabulated(self.nodes, t)

    def stationary(self, numbers: Any) -> Any:
        if self.is_timed:
            refuse("the expert depends on the time, and there is no horizon")
        return numbers.tabulated(self.nodes, 0)


@dataclass(frozen=True)
class Given(Rule):
    """Tables of probabilities (A, S) from outside."""

    tables: Plan
    is_rational: ClassVar[bool] = False

    def policy(self, numbers: Any, t: int, q: Any) -> Any:
        return Policy(self.tables(t))

    def stationary(self, numbers: Any) -> Any:
        return Policy(self.tables(0))


@dataclass(frozen=True)
class Greedy(Rule):
    """The best actions, all of them alike where several are best, for the reward plus a constant.

    A reward that was learnt from behaviour of a fixed length is only known up to a constant per
    step. That is harmless there, and not where episodes may end early: with the value of terminal
    states fixed at 0, a positive constant says to linger and a negative one to leave. `shift` is
    that constant; 0 is the task's own reward.
    """

    shift: Fraction = Fraction(0)
    is_planned: ClassVar[bool] = True

    @property
    def is_best(self) -> bool:
        return not self.shift

    def backup(self, numbers: Any) -> Callable[[int, Any], Any]:
        return lambda t, value: numbers.backup(t, value, self.shift)

    def value(self, numbers: Any, q: Any) -> Any:
        return numbers.top(q)

    def policy(self, numbers: Any, t: int, q: Any) -> Any:
        return numbers.greedy(q)

    def stationary(self, numbers: Any) -> Any:
        return numbers.greedy(numbers.q_values(self.shift))


@dataclass(frozen=True)
class Boltzmann(Rule):
    """The causal maximum-entropy policy: exp(beta Q) of the soft values, normalised."""

    beta: float
    is_rational: ClassVar[bool] = False
    is_planned: ClassVar[bool] = True

    def value(self, numbers: Bounded, q: Bound) -> Bound:
        return numbers.soft(q, self.beta)

    def policy(self, numbers: Bounded, t: int, q: Bound) -> Policy:
        return numbers.boltzmann(q, self.beta)

    def stationary(self, numbers: Any) -> Policy:
        found: Policy = numbers.boltzmann(numbers.soft_q_values(self.beta), self.beta)
        return found


def rule_of(model: Model, given: Literal["optimal"] | Soft | None = None) -> Rule | None:
    """Return the expert that the task's spec gives, or the one given here; None where there is none, or it draws too many
    outcomes.

    An expert that remembers is a function of the state in `Task.remembering` alone.
    """
    match given or model.task.expert:
        case tuple() if model.task.memory is not None:
            return None
        case "optimal":
            return Greedy()
        case Soft(beta=beta):
            return Boltzmann(beta)
        case tuple() as nodes:
            return Expressed(nodes) if count(draws(nodes), {}) <= 10_000 else None
        case _:
            return None


# -- tables -----------------------------------------------------------------------------------------------------------


class Tables:
    """The tables (A, S) of a rule at any time, in floats.

    Values are kept at every k-th time, with k the root of the horizon, and between two of these while times there are
    asked for: asked in order, every time is worked out twice.
    """

    def __init__(self, model: Model, rule: Rule) -> None:
        self.rule = rule
        self.numbers = Bounded(model)
        self.backup = rule.backup(self.numbers)
        self.every = max(1, math.isqrt(model.horizon or 1))
        size = (self.every + (model.horizon or 1) // self.every) * model.n_states * 16
        if size > MEMORY:
            refuse(f"a plan for every time would take {size / 2**30:.1f} GB", "choose smaller parameters")
        self._kept: dict[int, Any] = {}
        self._near: dict[int, Any] = {}

    def __call__(self, t: int) -> Array:
        after = min(t, self.numbers.horizon - 1) + 1
        if not self._kept:
            self._kept = self._walk(self.numbers.horizon, 0, self.numbers.zero(), self.every)
        if after not in self._near:
            stop = min(-(-after // self.every) * self.every, self.numbers.horizon)
            self._near = self._walk(stop, max(0, stop - self.every), self._kept[stop], 1)
        q = self.backup(after - 1, self._near[after])
        policy: Policy = self.rule.policy(self.numbers, after - 1, q)
        return policy.table

    def _walk(self, high: int, low: int, end: Any, every: int) -> dict[int, Any]:
        """Return values at times from `high` down to `low`, at every so many of them."""
        found = {high: end}
        for t, _, value in backward(self.backup, lambda t, q: self.rule.value(self.numbers, q), end, high, low):
            if t % every == 0:
                found[t] = value
        return found


def tables(model: Model, rule: Rule) -> Plan:
    """Return a rule's probabilities of actions at any time."""
    if model.horizon is None:
        from taskspec.solve.infinite_horizon import InfiniteHorizon

        return stationary(rule.stationary(InfiniteHorizon(model)).table)
    if rule.is_planned:
        return Tables(model, rule)
    numbers = Bounded(model)
    if not rule.is_timed:
        return stationary(rule.policy(numbers, 0, None).table)
    return lambda t: np.asarray(rule.policy(numbers, t, None).table)


def stationary(table: Array) -> Plan:
    return lambda t: table


def timed(found: Sequence[Array]) -> Plan:
    """Return one table for each time; the last one ever after."""
    return lambda t: found[min(t, len(found) - 1)]


def uniform_plan(model: Model) -> Plan:
    return stationary(np.full((model.n_actions, model.n_states), 1 / model.n_actions))


def optimal_plan(model: Model) -> Plan:
    return tables(model, Greedy())


def soft_plan(model: Model, beta: float) -> Plan:
    return tables(model, Boltzmann(beta))


def maxent_plan(model: Model, beta: float = 1.0) -> Plan:
    return tables(model, MaxEnt(beta))


def expert_plan(model: Model) -> Plan | None:
    """Return the expert that the task's spec gives, or None."""
    rule = rule_of(model)
    return None if rule is None else tables(model, rule)
