"""Backward induction in float64 with an a-priori bound on its rounding error, for models of any size.

The rounding of a sum of n products is at most gamma_n = n u / (1 - n u) of the sum of their sizes, where u = 2**-53 (N. Higham,
Accuracy and Stability of Numerical Algorithms, 2002, chapter 3; J. Wilkinson, Rounding Errors in Algebraic Processes, 1963).
Where all rewards have the same sign, so do all values, and errors stay relative to each value; otherwise they are relative to
the largest value of any state.

Deterministic tasks that pay whole numbers are free of rounding, and their errors are 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.extract import SMALLEST_NUMBER
from taskspec.exact.model.model import Model, Step
from taskspec.exact.model.probabilities import UNIT, Slack
from taskspec.exact.model.transitions import Steps, joint_outcomes, outcome_count
from taskspec.exact.solve.enclosure import EQUAL, Enclosure
from taskspec.language.expressions.types import Expression
from taskspec.language.task.questions import is_random

UNDERFLOW = 1e-300
"""Products from here on are not too small for a float; a sum of smaller ones loses less than this."""
DEEPEST = 1e4
"""Exponents from here on make weights of 0."""
STATES = 65_536
"""The number of states in which an expert is evaluated at once."""
UNKNOWN = 2
QUIET = np.errstate(over="ignore", invalid="ignore")
"""Values that no float holds are infinite or nan, and have no finite bounds."""


def gamma(n: float) -> float:
    """Return n u / (1 - n u), the relative error of n rounded operations."""
    return n * UNIT / (1 - n * UNIT)


@dataclass(frozen=True, slots=True)
class Bound:
    """Floats `value` near numbers x of the same shape: |value - x| <= relative * |x| + absolute.

    `is_signed` says that no two of the numbers have different signs; then all but 0 are at least `least` in size.
    """

    value: Array
    relative: float = 0.0
    absolute: float = 0.0
    is_signed: bool = False
    least: float = 0.0

    @property
    def is_exact(self) -> bool:
        return self.relative == 0 and self.absolute == 0

    @property
    def error(self) -> Array:
        """Bounds of |value - x|, of the shape of `value`."""
        if self.is_exact:
            return np.zeros_like(self.value)
        if self.relative > 0.5:
            return np.full_like(self.value, np.inf)
        return (self.relative * np.abs(self.value) + self.absolute) * ((1 + 8 * UNIT) / (1 - self.relative))

    @property
    def size(self) -> float:
        """A bound of all |x|."""
        if self.relative > 0.5:
            return math.inf
        largest = max(float(np.max(self.value, initial=0.0)), -float(np.min(self.value, initial=0.0)))
        return (largest + self.absolute) / (1 - self.relative) * (1 + 8 * UNIT)


@dataclass(frozen=True)
class Policy:
    """Probabilities of actions (A, S); each is off by at most `relative` of its size, and by `absolute`.

    `open` marks actions (A, S) of states in which rounding leaves undecided which of these are best.
    """

    table: Array
    relative: float = 0.0
    absolute: float = 0.0
    open: Array | None = None

    @cached_property
    def actions(self) -> Array | None:
        """The action (S,) in each state, where it is certain; None where some states have several."""
        if self.relative or self.absolute or self.open is not None:
            return None
        taken = self.table == 1
        is_one = ((self.table == 0) | taken).all() and (taken.sum(axis=0) == 1).all()
        return taken.argmax(axis=0) if is_one else None

    @cached_property
    def least(self) -> float:
        """The smallest probability that is not 0."""
        return _least(self.table)


def _least(weights: Array) -> float:
    return float(np.min(weights, where=weights > 0, initial=1.0))


@dataclass(frozen=True, slots=True)
class ExpectationError:
    """Errors of expectations: `relative` to the sum of all sizes, and `absolute` for values of size 1.

    `least` is the smallest weight that is not 0.
    """

    relative: float
    absolute: float
    least: float

    @classmethod
    def of(cls, terms: int, slack: Slack, least: float) -> ExpectationError:
        absolute = slack.absolute * terms + 2 * slack.missing
        if least < UNDERFLOW:
            absolute += UNDERFLOW
        return cls(gamma(terms + 8) + slack.relative, absolute, least)

    def expectation(self, value: Array, of: Bound) -> Bound:
        """Return computed expectations `value` (...,) of some numbers (S,), with their errors."""
        size = of.size
        if size == 0:
            return Bound(value, is_signed=of.is_signed, least=of.least)
        absolute = of.absolute * (1 + self.relative) + self.absolute * size
        relative = of.relative + self.relative + of.relative * self.relative
        if of.is_signed:
            smallest = of.least
        else:
            smallest = size
        least = smallest * self.least
        if least < UNDERFLOW:
            absolute += UNDERFLOW
        if of.is_signed:
            return Bound(value, relative, absolute, True, least)
        return Bound(value, 0.0, absolute + relative * size)


class Bounded:
    """Arithmetic on values (S,), action values (A, S) and policies (A, S) as floats with bounds."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.horizon = model.horizon or 0
        self.shape = (model.n_actions, model.n_states)
        steps = Steps(model.task)
        self.slack = Slack.of(steps.roots, steps.reward)
        terms = int(outcome_count(steps.first))
        self.start_error = ExpectationError.of(terms, Slack.of(steps.first), _least(model.start))

    @cached_property
    def is_whole(self) -> bool:
        """True where values of deterministic policies are exact: one outcome for each action, whole rewards, small sums."""
        steps = self.model.steps
        if self.model.discount != 1 or max(step.rounding.size for step in steps) * max(1, self.horizon) >= 2**53:
            return False
        for step in steps:
            if step.rounding.terms > 1 or not (np.mod(step.R, 1) == 0).all():
                return False
            if not all(((m.data == 0) | (m.data == 1)).all() for m in step.matrices):
                return False
        return True

    @cached_property
    def least_probability(self) -> float:
        """The smallest probability of an outcome of a step that is not 0."""
        return min(_least(matrix.data) for step in self.model.steps for matrix in step.matrices)

    @cached_property
    def is_signed(self) -> bool:
        """True where no step pays more than 0, or none less."""
        found = [step.rounding for step in self.model.steps]
        return all(r.lowest >= 0 for r in found) or all(r.highest <= 0 for r in found)

    def errors(self, step: Step) -> ExpectationError:
        """Return the errors of discounted expectations over the outcomes of a step."""
        return ExpectationError.of(step.rounding.terms, self.slack, self.least_probability)

    def zero(self) -> Bound:
        return Bound(np.zeros(self.model.n_states), is_signed=self.is_signed, least=math.inf)

    def backup(self, t: int, V: Bound) -> Bound:
        """Return Q (A, S) at a time from V (S,) at the next one."""
        step = self.model.step(t)
        value = step.P @ V.value
        if self.model.discount != 1:
            value *= self.model.discount
        value += step.R
        return self.with_errors(step, value.reshape(self.shape), V)

    def with_errors(self, step: Step, value: Array, V: Bound) -> Bound:
        """Return computed values of R + discount * P V with their errors."""
        if self.is_whole and V.is_exact:
            return Bound(value, is_signed=V.is_signed, least=1.0)
        discount = self.model.discount
        errors = self.errors(step)
        later = errors.expectation(value, V)
        paid = step.rounding.size
        absolute = discount * later.absolute + self.slack.missing * self.slack.beyond
        absolute += self.slack.absolute * step.rounding.terms * paid
        smallest = V.least
        if not V.is_signed:
            smallest = V.size or math.inf
        least = errors.least * min(SMALLEST_NUMBER, (discount or 1.0) * smallest)
        if least < UNDERFLOW:
            absolute += UNDERFLOW * max(1.0, paid)
        if V.is_signed:
            return Bound(value, max(later.relative, errors.relative), absolute, True, least)
        size = paid + discount * V.size
        if size:
            absolute += errors.relative * size
        return Bound(value, 0.0, absolute)

    def plus(self, q: Bound, constant: Fraction) -> Bound:
        """Return action values with a constant added to each."""
        value = q.value + float(constant)
        rounding = 2 * UNIT * (float(np.max(np.abs(value), initial=0.0)) + abs(float(constant)))
        return Bound(value, 0.0, float(np.max(q.error, initial=0.0)) + rounding)

    def reached(self, t: int, V: Bound, states: Array) -> Bound:
        """Return probabilities (A, S) of being in `states` in the next step, or later by V, which is 1 there."""
        step = self.model.step(t)
        value = step.P @ V.value
        if step.P_end is not None:
            value += step.P_end @ states.astype(np.float64)
        value = value.reshape(self.shape)
        if self.is_whole and V.is_exact:
            return Bound(value, is_signed=True, least=1.0)
        return self.errors(step).expectation(value, self._chances(V, np.append(V.value, 1.0)))

    def marked(self, V: Bound, states: Array) -> Bound:
        """Return probabilities V with 1 in `states`."""
        return self._chances(V, np.where(states, 1.0, V.value))

    @staticmethod
    def _chances(V: Bound, value: Array) -> Bound:
        return replace(V, value=value, is_signed=True, least=min(V.least, 1.0))

    def top(self, q: Bound) -> Bound:
        """Return the largest action values (S,)."""
        return replace(q, value=self.model.among_legal(q.value, -np.inf).max(axis=0))

    def bottom(self, q: Bound) -> Bound:
        """Return the smallest action values (S,)."""
        return replace(q, value=self.model.among_legal(q.value, np.inf).min(axis=0))

    def follow(self, policy: Policy, q: Bound) -> Bound:
        """Return the value (S,) of acting by a policy, from action values (A, S).

        Where the policy is open, it is in the middle of those of the open actions.
        """
        if policy.actions is not None:
            return replace(q, value=q.value[policy.actions, np.arange(self.model.n_states)])
        total = (policy.table * q.value).sum(axis=0)
        if policy.open is not None:
            is_open = policy.open.any(axis=0)
            low = np.where(policy.open, q.value, np.inf).min(axis=0)[is_open]
            high = np.where(policy.open, q.value, -np.inf).max(axis=0)[is_open]
            total[is_open] = (low + high) / 2
            q = replace(q, absolute=q.absolute + float(np.max(high - low, initial=0.0)) / 2 * (1 + 8 * UNIT))
        number = len(policy.table)
        errors = ExpectationError(gamma(number + 4) + policy.relative, number * policy.absolute, policy.least)
        return errors.expectation(total, q)

    def at_start(self, V: Bound) -> Enclosure:
        """Return the expectation of V over the first state."""
        first = np.flatnonzero(self.model.start)
        some = replace(V, value=V.value[first])
        mean = float(some.value[0])
        error = float(some.error[0])
        if len(first) > 1:
            mean = math.fsum(self.model.start[first] * some.value)
            error = float(self.start_error.expectation(np.array(mean), some).error)
        return Enclosure.around(mean, error)

    @cached_property
    def uniform(self) -> Policy:
        return Policy(self.model.uniform)

    def greedy(self, q: Bound) -> Policy:
        """Return all best actions, each as probable as any other; open where errors leave undecided which these are."""
        top = self.top(q)
        off = top.error
        best = self.model.among_legal(q.value >= top.value - 2 * (q.error + off), False)
        number = best.sum(axis=0)
        unsure = best & (number > 1) & (off > 0)
        return Policy(best / number, open=unsure if unsure.any() else None)

    # Elementary functions err by less than 4 units, and exp(-x) by 2 x units more for the rounding of its argument.

    def soft(self, q: Bound, beta: float) -> Bound:
        """Return the soft values log(sum over a of exp(beta Q)) / beta."""
        total = np.exp(-self._depth(q, beta)).sum(axis=0)
        value = self.top(q).value + np.log(total) / beta
        largest = float(np.max(np.abs(value), initial=0.0))
        return Bound(value, 0.0, float(q.error.max()) + self._units * (1 / beta + largest))

    def boltzmann(self, q: Bound, beta: float) -> Policy:
        """Return the policy of actions in proportion to exp(beta Q)."""
        depth = self._depth(q, beta)
        weights = np.exp(-depth)
        table = weights / weights.sum(axis=0)
        exponent = 2 * beta * float(q.error.max())
        if not exponent <= 30:
            return Policy(table, math.inf, 1.0)
        deepest = float(depth.max(initial=0.0, where=np.isfinite(depth)))
        relative = math.expm1(exponent) + self._units + 4 * UNIT * deepest
        return Policy(table, relative, UNDERFLOW if deepest > 600 else 0.0)

    def _depth(self, q: Bound, beta: float) -> Array:
        """Return by how much beta Q is below the largest in its state, (A, S); infinite for illegal actions."""
        with np.errstate(over="ignore"):  # of floats near the largest
            depth = np.minimum(beta * (self.top(q).value - q.value), DEEPEST)
        return self.model.among_legal(depth, np.inf)

    @property
    def _units(self) -> float:
        """The relative error of sums of exponentials over the actions."""
        return (16 * self.model.n_actions + 32) * UNIT

    def tabulated(self, nodes: Sequence[Expression], t: int) -> Policy:
        """Return a policy given by expressions, which may draw and read the time."""
        model = self.model
        table = np.zeros(self.shape)
        for low in range(0, model.n_states, STATES):
            some = slice(low, min(model.n_states, low + STATES))
            here = table[:, some]
            for values, state, weight in joint_outcomes(nodes, model.reads(t, some), here.shape[1]):
                np.add.at(here, (model.actions.encode(values, len(state))[0], state), weight)
        if not is_random(nodes):
            return Policy(table)
        slack = Slack.of(nodes)
        terms = int(outcome_count(nodes))
        absolute = slack.absolute * terms + slack.missing
        if _least(table) < UNDERFLOW:
            absolute += UNDERFLOW
        return Policy(table, slack.relative + gamma(8 + terms), absolute)

    def preference(self, policy: Policy, wanted: Array) -> Array:
        """Compare the most frequent actions with the wanted ones (A, S).

        Returns:
            int8 (S,): 1 where the most frequent action is a wanted one, -1 where not, 0 where the frequencies differ by at
            most 1e-9 of their size, `UNKNOWN` where errors leave it undecided.
        """
        error = policy.relative * policy.table + policy.absolute
        low = policy.table - error
        high = policy.table + error
        good_low = np.where(wanted, low, -1.0).max(axis=0)
        good_high = np.where(wanted, high, -1.0).max(axis=0)
        bad_low = np.where(wanted, -1.0, low).max(axis=0)
        bad_high = np.where(wanted, -1.0, high).max(axis=0)
        apart = 1 + float(EQUAL)
        found = np.full(self.model.n_states, UNKNOWN, np.int8)
        found[(good_high <= bad_low * apart) & (bad_high <= good_low * apart)] = 0
        found[good_low > bad_high * apart] = 1
        found[bad_low > good_high * apart] = -1
        if policy.open is not None:
            found[policy.open.any(axis=0)] = UNKNOWN
            found[policy.open.any(axis=0) & ~(policy.open & ~wanted).any(axis=0)] = 1
            found[policy.open.any(axis=0) & ~(policy.open & wanted).any(axis=0)] = -1
        return found

    def table(self, policy: Policy) -> Array:
        return policy.table
