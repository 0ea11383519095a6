"""Backward induction in float64 with an a-priori bound on its rounding error, for models of any size.

The rounding of a sum of n products is at most gamma_n = n u / (1 - n u) of the sum of their sizes, where u = 2**-53 (N. Higham,
Accuracy and Stability of Numerical Algorithms, 2002, chapter 3; J. Wilkinson, Rounding Errors in Algebraic Processes, 1963).
Where all rewards have the same sign, so do all values, and errors stay relative to each value; otherwise they are relative to
the largest value of any state.

Deterministic tasks that pay whole numbers are free of rounding, and their errors are 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.interval import bounds
from taskspec.lang.ir import Const, Draw, Node, draws
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.choices import row_table
from taskspec.lang.variates.entry import Enumeration
from taskspec.model.model import Model, Step
from taskspec.model.transitions import Steps, acted, branches, count
from taskspec.solve.enclosure import EQUAL, Enclosure

UNIT = 2.0**-53
"""The relative error of one rounded operation."""
COMPUTED = 8 * UNIT
"""The error allowed for a probability that an expression computes, as `1 - s / 10`."""
TAIL = 1e-20
"""More than the probability of the outcomes that are left out of a draw of infinitely many."""
UNDERFLOW = 1e-300
"""More than what a sum of products that are too small for a float can lose."""
SMALLEST = 1e-290
"""Products above this are rounded relative to their size."""
FAINT = 1e-190
"""Products of smaller probabilities with rewards may be below `SMALLEST`."""
DEEPEST = 1e4
"""Exponents from here on make weights of 0."""
STATES = 65_536
"""The number of states in which an expert is evaluated at once."""
PIECE = 500_000
"""The size of a table of action values from which a policy is evaluated action by action."""
UNKNOWN = 2
QUIET = np.errstate(over="ignore", invalid="ignore")
"""Values that no float holds are infinite or nan, and have no finite bounds."""


def gamma(n: float) -> float:
    """Return n u / (1 - n u), the relative error of n rounded operations."""
    return n * UNIT / (1 - n * UNIT)


@dataclass(frozen=True, slots=True)
class Bound:
    """Floats `value` near numbers x of the same shape: |value - x| <= relative * |x| + absolute.

    `is_signed` says that no two of the numbers have different signs.
    """

    value: Array
    relative: float = 0.0
    absolute: float = 0.0
    is_signed: bool = False

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
        largest = max(float(np.max(self.value, initial=0.0)), -float(np.min(self.value, initial=0.0)))
        return (largest + self.absolute) / (1 - self.relative) * (1 + 8 * UNIT) if self.relative <= 0.5 else math.inf

    def negative(self) -> Bound:
        return replace(self, value=-self.value)


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
        is_one = bool(((self.table == 0) | taken).all() and (taken.sum(axis=0) == 1).all())
        return taken.argmax(axis=0) if is_one else None

    @cached_property
    def smallest(self) -> float:
        """The smallest probability."""
        return _smallest(self.table)


@dataclass(frozen=True, slots=True)
class Slack:
    """Bounds on errors of the probabilities of outcomes, as far as they come from the probabilities of draws.

    `relative` is that of every outcome, `absolute` is added to each for probabilities that are computed at run time;
    outcomes of probability `missing` together were left out, and pay at most `beyond` in size.
    """

    relative: float = 0.0
    absolute: float = 0.0
    missing: float = 0.0
    beyond: float = 0.0

    @classmethod
    def of(cls, draws: Sequence[Draw], reward: Node | None = None) -> Slack:
        """Return the bounds for outcomes of some draws together, which may enter a reward."""
        if not draws:
            return cls()
        relative = sum(_enumeration(d).steps(d) * UNIT for d in draws)
        absolute = sum(COMPUTED * _enumeration(d).chances(d) for d in draws if _is_computed(d))
        missing = sum(TAIL * d.type.size for d in draws if _enumeration(d).tail)
        beyond = max(map(abs, bounds(reward, {}))) if missing and reward is not None else 0.0
        return cls(relative, absolute, missing, beyond)


def _is_computed(draw: Draw) -> bool:
    """Return whether the probabilities come from arithmetic at run time rather than from numbers in the spec."""
    found = _enumeration(draw)
    if not found.weighted or isinstance(draw.args[0], Const):
        return False
    return not (found.by_row and row_table(draw.args[0]) is not None)


def _enumeration(draw: Draw) -> Enumeration:
    found = VARIATES[draw.base].outcomes
    assert found is not None, draw.base
    return found


def _smallest(values: Array) -> float:
    """Return the smallest size of a number that is not 0; infinity where there is none."""
    positive = np.min(values, where=values > 0, initial=math.inf)
    negative = np.max(values, where=values < 0, initial=-math.inf)
    return float(min(positive, -negative))


@dataclass(frozen=True, slots=True)
class ExpectationError:
    """Errors of expectations: `relative` to the sum of all sizes, and `absolute` for values of size 1.

    `smallest` is the smallest probability.
    """

    relative: float
    absolute: float
    smallest: float

    @classmethod
    def of(cls, terms: int, slack: Slack, smallest: float) -> ExpectationError:
        absolute = slack.absolute * terms + 2 * slack.missing
        if smallest < SMALLEST:  # which stands for what no float holds
            absolute += UNDERFLOW * terms
        return cls(gamma(terms + 8) + slack.relative, absolute, smallest)

    def expectation(self, value: Array, of: Bound, smallest: float | None = None) -> Bound:
        """Return computed expectations `value` of some numbers, with their errors.

        Args:
            value: float64 (...,), the expectations.
            of: float64 (S,), the numbers.
            smallest: that of the numbers, where it is known.
        """
        size = of.size
        if size == 0:
            return Bound(value, is_signed=of.is_signed)
        absolute = of.absolute * (1 + self.relative) + self.absolute * size
        if self.smallest * min(1.0, _smallest(of.value) if smallest is None else smallest) < SMALLEST:
            absolute += UNDERFLOW
        relative = of.relative + self.relative + of.relative * self.relative
        if of.is_signed:
            return Bound(value, relative, absolute, True)
        return Bound(value, 0.0, absolute + relative * size)


class Bounded:
    """Arithmetic on values (S,), action values (A, S) and policies (A, S) as floats with bounds."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.horizon = model.horizon or 0
        steps = Steps(model.task)
        first = draws(steps.first)
        self.slack = Slack.of(steps.draws, steps.reward)
        self.start_weights = ExpectationError.of(int(count(first, {})), Slack.of(first), _smallest(model.start))
        self._weights: dict[int, ExpectationError] = {}
        self._chosen: tuple[Step, Policy, Step] | None = None

    @cached_property
    def is_whole(self) -> bool:
        """Whether values of deterministic policies are never rounded: one outcome for each action, whole rewards, small sums."""
        steps = self.model.steps
        return (
            self.model.discount == 1
            and max(step.rounding.size for step in steps) * max(1, self.horizon) < 2**53
            and all(step.rounding.terms == 1 and _is_certain(step) for step in steps)
            and all(bool((np.mod(step.R, 1) == 0).all()) for step in steps)
        )

    @cached_property
    def is_signed(self) -> bool:
        """Whether no step pays more than 0, or none less."""
        found = [step.rounding for step in self.model.steps]
        return all(r.lowest >= 0 for r in found) or all(r.highest <= 0 for r in found)

    def weights(self, step: Step) -> ExpectationError:
        """Return the errors of expectations over the outcomes of a step."""
        if id(step) not in self._weights:
            matrices = [m for m in (step.P, step.P_end) if m is not None]
            smallest = min(_smallest(m.data) for m in matrices)
            found = ExpectationError.of(step.rounding.terms, self.slack, smallest)
            self._weights[id(step)] = replace(found, smallest=smallest * self.model.discount)
        return self._weights[id(step)]

    # -- values -------------------------------------------------------------------------------------------------------

    def zero(self) -> Bound:
        return Bound(np.zeros(self.model.n_states), is_signed=self.is_signed)

    def backup(self, t: int, V: Bound, shift: Fraction = Fraction(0)) -> Bound:
        """Return Q (A, S) at a time from V (S,) at the next one; `shift` is added to every reward."""
        q = self.discounted(self.model.step(t), V, shift)
        return replace(q, value=self._table(q.value))

    def discounted(self, step: Step, V: Bound, shift: Fraction = Fraction(0)) -> Bound:
        """Return R + shift + discount * P V for the rows of a step."""
        discount = self.model.discount
        value = step.P @ V.value
        if discount != 1:
            value *= discount
        value += step.R
        if shift:
            value += float(shift)
        return self.with_reward(step, value, V, shift)

    def with_reward(
        self, step: Step, value: Array, V: Bound, shift: Fraction = Fraction(0), smallest: float | None = None
    ) -> Bound:
        """Return computed values of R + shift + discount * P V with their errors."""
        if self.is_whole and V.is_exact and not shift:
            return Bound(value, is_signed=V.is_signed)
        discount = self.model.discount
        weights = self.weights(step)
        later = weights.expectation(value, replace(V, is_signed=V.is_signed and not shift), smallest)
        paid = step.rounding.size
        absolute = discount * later.absolute + self.slack.missing * self.slack.beyond
        absolute += self.slack.absolute * step.rounding.terms * paid
        if paid and weights.smallest < FAINT:
            absolute += UNDERFLOW * max(1.0, paid)
        if V.is_signed and not shift:
            return Bound(value, max(later.relative, weights.relative), absolute, True)
        size = paid + discount * V.size + 2 * abs(float(shift))
        return Bound(value, 0.0, absolute + weights.relative * size if size else 0.0)

    def followed(self, policy: Policy, t: int, V: Bound, side: int = 1) -> Bound:
        """Return the value (S,) of acting by a policy at a time, one action after another where tables are large."""
        n = self.model.n_states
        actions = range(self.model.n_actions)
        step = self.model.step(t)
        if policy.actions is not None:
            return self.discounted(self._chosen_rows(step, policy, policy.actions), V)
        if n * len(actions) <= PIECE:
            return self.follow(policy, self.backup(t, V), side)
        return self._mixed(policy, (self.discounted(_rows(step, slice(a * n, (a + 1) * n)), V) for a in actions), side)

    def _chosen_rows(self, step: Step, policy: Policy, actions: Array) -> Step:
        """Return the rows of one action (S,) in each state; kept, as most policies are the same at all times."""
        if self._chosen is None or self._chosen[0] is not step or self._chosen[1] is not policy:
            n = self.model.n_states
            rows = actions * n + np.arange(n)
            chosen = replace(step, P=step.P[rows], P_end=None, R=step.R[rows])
            self._weights[id(chosen)] = self.weights(step)
            self._chosen = step, policy, chosen
        return self._chosen[2]

    def reached(self, t: int, V: Bound, states: Array) -> Bound:
        """Return probabilities (A, S) of being in `states` in the next step, or later by V, which is 1 there."""
        step = self.model.step(t)
        value = step.P @ V.value
        if step.P_end is not None:
            value += step.P_end @ states.astype(np.float64)
        value = self._table(value)
        if self.is_whole and V.is_exact:
            return Bound(value, is_signed=True)
        found = self.weights(step).expectation(value, replace(V, is_signed=True))
        if step.P_end is None:
            return found
        ends = self.weights(step).expectation(value, Bound(states.astype(np.float64), is_signed=True))
        return Bound(value, max(found.relative, ends.relative), found.absolute + ends.absolute, True)

    def marked(self, V: Bound, states: Array) -> Bound:
        """Return probabilities V with 1 in `states`."""
        return replace(V, value=np.where(states, 1.0, V.value), is_signed=True)

    def _table(self, flat: Array) -> Array:
        return flat.reshape(self.model.n_actions, self.model.n_states)

    def top(self, q: Bound) -> Bound:
        """Return the largest action values (S,)."""
        return replace(q, value=q.value.max(axis=0))

    def bottom(self, q: Bound) -> Bound:
        """Return the smallest action values (S,)."""
        return replace(q, value=q.value.min(axis=0))

    def follow(self, policy: Policy, q: Bound, side: int = 1) -> Bound:
        """Return the value (S,) of acting by a policy, from action values (A, S).

        Args:
            side: 1 or -1 takes the best or the worst of the actions among which the policy is open.
        """
        return self._mixed(policy, (replace(q, value=row) for row in q.value), side)

    def _mixed(self, policy: Policy, each: Iterable[Bound], side: int) -> Bound:
        """Return the value (S,) of a policy from those of each action, of which one is held at a time."""
        total = np.zeros(self.model.n_states)
        extreme = np.full(self.model.n_states, -np.inf)
        absolute = relative = size = 0.0
        smallest = math.inf
        is_signed = True
        for action, q in enumerate(each):
            p = policy.table[action]
            total += p * q.value
            size = max(size, q.size)
            smallest = min(smallest, _smallest(q.value))
            relative = max(relative, q.relative)
            absolute = max(absolute, q.absolute)
            is_signed = q.is_signed
            if policy.open is not None:
                extreme = np.where(policy.open[action], np.maximum(extreme, side * q.value), extreme)
        if policy.open is not None:
            total = np.where(policy.open.any(axis=0), side * extreme, total)
        if policy.actions is not None:
            return Bound(total, relative, absolute, is_signed)
        number = len(policy.table)
        weights = ExpectationError(gamma(number + 4) + policy.relative, number * policy.absolute, policy.smallest)
        return weights.expectation(total, Bound(np.array([size]), relative, absolute, is_signed), smallest)

    def at_start(self, V: Bound) -> Enclosure:
        """Return the expectation of V over the first state."""
        first = np.flatnonzero(self.model.start)
        some = replace(V, value=V.value[first])
        if len(first) == 1:
            return Enclosure.around(float(some.value[0]), float(some.error[0]))
        mean = math.fsum(self.model.start[first] * some.value)
        found = self.start_weights.expectation(np.array(mean), some)
        return Enclosure.around(mean, float(found.error))

    # -- policies -----------------------------------------------------------------------------------------------------

    def uniform(self) -> Policy:
        return self._uniform

    @cached_property
    def _uniform(self) -> Policy:
        shape = (self.model.n_actions, self.model.n_states)
        return Policy(np.broadcast_to(1 / self.model.n_actions, shape))

    def greedy(self, q: Bound) -> Policy:
        """Return all best actions, each as probable as any other; open where errors leave undecided which these are."""
        top = q.value.max(axis=0)
        if q.is_exact:
            best = q.value == top
            return Policy(best / best.sum(axis=0))
        off = replace(q, value=top).error
        best = q.value >= top - 2 * (q.error + off)
        number = best.sum(axis=0)
        unsure = best & (number > 1) & (off > 0)
        return Policy(best / number, open=unsure if unsure.any() else None)

    # Elementary functions err by less than 4 units, and exp(-x) by 2 x units more for the rounding of its argument.

    def soft(self, q: Bound, beta: float) -> Bound:
        """Return the soft values log(sum over a of exp(beta Q)) / beta."""
        total = np.exp(-_depth(q, beta)).sum(axis=0)
        value = q.value.max(axis=0) + np.log(total) / beta
        largest = float(np.max(np.abs(value), initial=0.0))
        return Bound(value, 0.0, float(q.error.max()) + _units(q) * (1 / beta + largest))

    def boltzmann(self, q: Bound, beta: float) -> Policy:
        """Return the policy of actions in proportion to exp(beta Q)."""
        depth = _depth(q, beta)
        weights = np.exp(-depth)
        table = weights / weights.sum(axis=0)
        exponent = 2 * beta * float(q.error.max())
        if not exponent <= 30:
            return Policy(table, math.inf, 1.0)
        deepest = float(depth.max(initial=0.0))
        return Policy(table, math.expm1(exponent) + _units(q) + 4 * UNIT * deepest, UNDERFLOW if deepest > 600 else 0.0)

    def tabulated(self, nodes: Sequence[Node], t: int) -> Policy:
        """Return a policy given by expressions, which may draw and read the time."""
        model = self.model
        drawn = draws(nodes)
        table = np.zeros((model.n_actions, model.n_states))
        for low in range(0, model.n_states, STATES):
            some = slice(low, min(model.n_states, low + STATES))
            here = table[:, some]
            given = model.reads(t, some)
            for branch in branches(drawn, given, here.shape[1]):
                action, at = acted(model.actions, nodes, given, branch, here.shape[1])
                np.add.at(here, (action, at), np.broadcast_to(branch.weight, (len(at),)))
        if not drawn:
            return Policy(table)
        slack = Slack.of(drawn)
        terms = int(count(drawn, {}))
        faint = UNDERFLOW if _smallest(table) < SMALLEST else 0.0
        return Policy(table, slack.relative + gamma(8 + terms), slack.absolute * terms + slack.missing + faint)

    def preference(self, policy: Policy, wanted: Array) -> Array:
        """Compare the most frequent actions with the wanted ones (A, S).

        Returns:
            int8 (S,): 1 where the most frequent action is a wanted one, -1 where not, 0 where the frequencies differ by at
            most 1e-9 of their size, `UNKNOWN` where errors leave it undecided.
        """
        error = policy.relative * policy.table + policy.absolute
        low = policy.table - error
        high = policy.table + error
        good = _most(low, high, wanted)
        bad = _most(low, high, ~wanted)
        apart = 1 + float(EQUAL)
        found = np.full(self.model.n_states, UNKNOWN, np.int8)
        found[(good[1] <= bad[0] * apart) & (bad[1] <= good[0] * apart)] = 0
        found[good[0] > bad[1] * apart] = 1
        found[bad[0] > good[1] * apart] = -1
        if policy.open is not None:
            is_open = policy.open.any(axis=0)
            some_wanted = (policy.open & wanted).any(axis=0)
            all_wanted = ~(policy.open & ~wanted).any(axis=0)
            decided = np.where(all_wanted, 1, np.where(some_wanted, UNKNOWN, -1))
            found = np.where(is_open, decided, found)
        return found.astype(np.int8)

    def is_open(self, policy: Policy) -> bool:
        return policy.open is not None

    def table(self, policy: Policy) -> Array:
        return policy.table


def _rows(step: Step, some: slice) -> Step:
    """Return some rows of a step, which share its memory."""
    P = step.P
    first = P.indptr[some.start : some.stop + 1]
    here = slice(int(first[0]), int(first[-1]))
    entries = (P.data[here], P.indices[here], first - first[0])
    return replace(step, P=type(P)(entries, shape=(len(first) - 1, P.shape[1])), P_end=None, R=step.R[some])


def _is_certain(step: Step) -> bool:
    """Return whether all probabilities are 0 or 1."""
    return all(bool(((m.data == 0) | (m.data == 1)).all()) for m in (step.P, step.P_end) if m is not None)


def _depth(q: Bound, beta: float) -> Array:
    """Return by how much beta Q is below the largest in its state, (A, S)."""
    with np.errstate(over="ignore"):  # of floats near the largest
        return np.asarray(np.minimum(beta * (q.value.max(axis=0) - q.value), DEEPEST))


def _units(q: Bound) -> float:
    """Return the relative error of sums of exponentials over the actions."""
    return (16 * len(q.value) + 32) * UNIT


def _most(low: Array, high: Array, among: Array) -> tuple[Array, Array]:
    """Return bounds (S,) of the largest probability among some actions; below 0 where there are none."""
    return np.where(among, low, -1.0).max(axis=0), np.where(among, high, -1.0).max(axis=0)
