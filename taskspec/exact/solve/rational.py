"""Backward induction in rationals, for small models: values are whole numbers over one common denominator.

Probabilities are those that the spec writes, relative to their total; rewards are the floats that a step pays. Both are
read by one `Reader`, and no operation rounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model
from taskspec.exact.model.probabilities import ExactProbabilities, Inexact, Reader, objects
from taskspec.exact.model.transitions import Steps, joint_outcomes
from taskspec.exact.solve.enclosure import EQUAL, Enclosure
from taskspec.language.expressions.types import Expression

MOST_OUTCOMES = 100_000
"""Outcomes of all steps together up to which a model is enumerated in rationals."""
MOST_WORK = 250_000
"""Outcomes times steps of an episode up to which values are computed in rationals."""
WIDE = 4_000
"""Bits of a denominator that double the cost of an operation."""


@dataclass(frozen=True, slots=True)
class Scaled:
    """Rationals as whole numbers (object array) over a common denominator."""

    parts: Array
    over: int

    @classmethod
    def of(cls, values: Array) -> Scaled:
        """Return them from an array of rationals, or of ints."""
        flat = values.reshape(-1).tolist()
        known: dict[int, Fraction] = {}
        for v in flat:  # one object often stands in many places
            if id(v) not in known:
                known[id(v)] = Fraction(v)
        over = math.lcm(*{v.denominator for v in known.values()})
        parts = {key: v.numerator * (over // v.denominator) for key, v in known.items()}
        return cls(objects([parts[id(v)] for v in flat]).reshape(values.shape), over)

    def reduced(self) -> Scaled:
        """In lowest terms once the denominator is long."""
        if self.over.bit_length() < 128:
            return self
        return self.lowest()

    def lowest(self) -> Scaled:
        """In lowest terms."""
        common = math.gcd(self.over, *self.parts.reshape(-1).tolist())
        if common == 1:
            return self
        return Scaled(self.parts // common, self.over // common)

    def at(self, index: Any) -> Fraction:
        return Fraction(self.parts[index], self.over)

    def fractions(self) -> Array:
        """Object array of fractions."""
        return objects([Fraction(int(part), self.over) for part in self.parts.reshape(-1)]).reshape(self.parts.shape)


def _shared(some: Array) -> Scaled:
    counts = some.sum(axis=0)
    over = math.lcm(*map(int, np.unique(counts)))
    return Scaled(some.astype(object) * np.array([over // int(n) for n in counts], dtype=object), over)


@dataclass(frozen=True)
class RationalStep:
    """Outcomes in order of their rows: columns, weights, whether each ends the episode; and the rewards (A*S,)."""

    first: Array  # of each row
    columns: Array
    weights: Scaled
    ends: Array
    R: Scaled

    def expected(self, after: Array) -> Array:
        """Return the sums (A*S,) of weights times numbers of outcomes."""
        return np.asarray(np.add.reduceat(self.weights.parts * after, self.first))


class Rational:
    """Arithmetic on values (S,), action values (A, S) and policies (A, S) as `Scaled`.

    `work` is how many operations on short numbers it costs to go from the last step to the first; `most` is its limit.

    Raises:
        Inexact: for models that are too large, or whose probabilities are no rationals.
    """

    def __init__(self, model: Model, reader: Reader, most: float | None = None) -> None:
        self.model = model
        self.reader = reader
        self.shape = (model.n_actions, model.n_states)
        self.probabilities = ExactProbabilities(reader)
        self.horizon = model.horizon or 0
        self.discount = reader(model.discount)
        steps = Steps(model.task)
        size = model.n_states * model.n_actions * steps.branching
        if model.horizon is None or size * len(model.steps) > (most or MOST_OUTCOMES):
            raise Inexact
        if model.entries / len(model.steps) * model.horizon > (most or MOST_WORK):
            raise Inexact
        codes, weights = steps.starts(self.probabilities)
        start = objects([Fraction(0)] * model.n_states)
        start[np.searchsorted(model.codes, codes)] = weights
        self.start = Scaled.of(start)
        self.steps = [self._step(steps, t) for t in range(len(model.steps))]
        bits = max(s.weights.over for s in self.steps).bit_length() + self.discount.denominator.bit_length()
        self.work = max(len(s.columns) for s in self.steps) * model.horizon * (1 + bits * model.horizon / WIDE)
        if self.work > (most or MOST_WORK):
            raise Inexact

    def _step(self, steps: Steps, t: int) -> RationalStep:
        model = self.model
        found = steps.table(model.codes, t, self.probabilities)
        first = np.searchsorted(found.row, np.arange(model.n_actions * model.n_states))
        acting = model.acting[found.row % model.n_states]  # what is paid elsewhere need not even be a number
        distinct, which = np.unique(np.where(acting, found.reward, 0.0), return_inverse=True)
        rates = Scaled.of(objects(list(map(self.reader, distinct.tolist()))))
        weights = Scaled.of(found.weight)
        paid = np.add.reduceat(weights.parts * rates.parts[which.reshape(-1)], first)
        R = Scaled(paid, weights.over * rates.over).lowest()
        return RationalStep(first, found.column, weights, found.ends.astype(np.bool_), R)

    def step(self, t: int) -> RationalStep:
        return self.steps[t if len(self.steps) > 1 else 0]

    def zero(self) -> Scaled:
        return Scaled(objects([0] * self.model.n_states), 1)

    def backup(self, t: int, V: Scaled) -> Scaled:
        """Return Q at a time from V at the next one."""
        step = self.step(t)
        after = step.expected(np.where(step.ends, 0, V.parts[step.columns]))
        gamma = self.discount
        each = gamma.denominator * step.weights.over * V.over
        over = math.lcm(step.R.over, each)
        q = step.R.parts * (over // step.R.over) + after * (over // each * gamma.numerator)
        return Scaled(q.reshape(self.shape), over)

    def plus(self, q: Scaled, constant: Fraction) -> Scaled:
        """Return action values with a constant added to each."""
        over = math.lcm(q.over, constant.denominator)
        more = constant.numerator * (over // constant.denominator)
        return Scaled(q.parts * (over // q.over) + more, over)

    def reached(self, t: int, V: Scaled, states: Array) -> Scaled:
        """Return probabilities (A, S) of being in `states` in the next step, or later by V, which is 1 there."""
        step = self.step(t)
        inside = objects([V.over if is_there else 0 for is_there in states.tolist()])  # beyond what NumPy's ints hold
        after = step.expected(np.where(step.ends, inside[step.columns], V.parts[step.columns]))
        return Scaled(after.reshape(self.shape), step.weights.over * V.over)

    def marked(self, V: Scaled, states: Array) -> Scaled:
        """Return values with 1 in `states`."""
        return Scaled(np.where(states, V.over, V.parts), V.over).reduced()

    def top(self, q: Scaled) -> Scaled:
        return Scaled(self.model.among_legal(q.parts, -np.inf).max(axis=0), q.over).reduced()

    def bottom(self, q: Scaled) -> Scaled:
        return Scaled(self.model.among_legal(q.parts, np.inf).min(axis=0), q.over).reduced()

    def follow(self, policy: Scaled, q: Scaled) -> Scaled:
        return Scaled((policy.parts * q.parts).sum(axis=0), policy.over * q.over).reduced()

    def at_start(self, V: Scaled) -> Enclosure:
        return Enclosure.exactly(Fraction(int((self.start.parts * V.parts).sum()), self.start.over * V.over))

    def goes_on(self, t: int, row: int) -> Iterator[tuple[int, int]]:
        """Yield states in which the episode goes on after a row, action * S + state, with their weights over `weights.over`."""
        step = self.step(t)
        if row + 1 < len(step.first):
            last = step.first[row + 1]
        else:
            last = len(step.columns)
        for k in range(step.first[row], last):
            if not step.ends[k]:
                yield int(step.columns[k]), int(step.weights.parts[k])

    def successors(self, t: int, taken: Array) -> Array:
        """Return states (S,) in which episodes may go on if they take some actions (A, S) at a time."""
        step = self.step(t)
        rows = np.repeat(taken.reshape(-1), np.diff(step.first, append=len(step.columns)))
        found = np.zeros(self.model.n_states, np.bool_)
        found[step.columns[rows & ~step.ends & (step.weights.parts > 0)]] = True
        return found

    @cached_property
    def uniform(self) -> Scaled:
        legal = self.model.legal
        if legal is None:
            return Scaled(np.ones(self.shape, dtype=object), self.model.n_actions)
        return _shared(legal)

    def greedy(self, q: Scaled) -> Scaled:
        """Return all best actions, each as probable as any other."""
        parts = self.model.among_legal(q.parts, -np.inf)
        return _shared(parts == parts.max(axis=0))

    def tabulated(self, nodes: Sequence[Expression], t: int) -> Scaled:
        """Return a policy given by expressions, which may draw and read the time."""
        model = self.model
        table = objects([0] * (model.n_actions * model.n_states)).reshape(self.shape)
        for values, state, weight in joint_outcomes(nodes, model.reads(t), model.n_states, self.probabilities):
            np.add.at(table, (model.actions.encode(values, len(state))[0], state), weight)
        return Scaled.of(table)

    def preference(self, policy: Scaled, wanted: Array) -> Array:
        """Return for each state (S,) 1 where the most frequent action is a wanted one, -1 where not, 0 where frequencies are
        equal, or differ by at most 1e-9 of their size.
        """
        good = np.where(wanted, policy.parts, -1).max(axis=0)
        bad = np.where(wanted, -1, policy.parts).max(axis=0)
        much = EQUAL.denominator
        more = EQUAL.denominator + EQUAL.numerator
        return np.asarray((good * much > bad * more).astype(np.int8) - (bad * much > good * more).astype(np.int8))

    def table(self, policy: Scaled) -> Array:
        """Return a policy as floats."""
        return np.array([v / policy.over for v in policy.parts.reshape(-1)]).reshape(self.shape)
