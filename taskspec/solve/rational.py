"""Backward induction in rationals, for small models: values are whole numbers over one common denominator.

Probabilities are those that the spec writes, relative to their total; rewards are the floats that a step pays. Both are
read by one `Reader`, and no operation rounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Const, Draw, Node, draws
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.choices import row_table
from taskspec.model.model import Model
from taskspec.model.transitions import Steps, acted, branches
from taskspec.solve.enclosure import EQUAL, Enclosure, Inexact, Reader

MOST_OUTCOMES = 100_000
"""Outcomes of all steps together up to which a model is enumerated in rationals."""
MOST_WORK = 250_000
"""Outcomes times steps of an episode up to which values are computed in rationals."""
WIDE = 4_000
"""Bits of a denominator that double the cost of an operation."""


class Chances:
    """Probabilities of draws as rationals: the arithmetic that `outcomes.branches` is given."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader

    def argument(self, draw: Draw, arg: Array) -> Array:
        p = draw.args[0]
        outcomes = VARIATES[draw.base].outcomes
        if outcomes is None or outcomes.tail:
            raise Inexact
        if isinstance(p, Const):
            return _objects([self.reader(v) for v in p.flat]).reshape(*p.type.shape, 1)
        looked_up = row_table(p)
        if looked_up is not None and outcomes.by_row:
            return self._rows(looked_up[0], arg)
        return _objects([self.reader.computed(v) for v in arg.reshape(-1).tolist()]).reshape(arg.shape)

    def otherwise(self, draw: Draw, p: Array) -> Array:
        return np.asarray(1 - p)

    def _rows(self, table: Const, arg: Array) -> Array:
        """Return rows of a constant table, (K, N), in the numbers that they were written with."""
        k = table.type.shape[-1]
        rows = [table.flat[i : i + k] for i in range(0, len(table.flat), k)]
        known = {tuple(float(v) for v in row): [self.reader(v) for v in row] for row in reversed(rows)}
        columns = [known[tuple(column)] for column in arg.T.tolist()]
        return _objects([v for column in columns for v in column]).reshape(arg.shape[1], k).T

    def ratio(self, part: Array, whole: Array) -> Array:
        shape = np.broadcast_shapes(part.shape, whole.shape)
        pairs = [*zip(np.broadcast_to(part, shape).flat, np.broadcast_to(whole, shape).flat, strict=True)]
        known = {(p, w): Fraction(int(p), int(w)) for p, w in set(pairs)}  # there are few, of many outcomes
        return _objects([known[pair] for pair in pairs]).reshape(shape)

    def times(self, a: Array, b: Array) -> Array:
        return b if a.shape == (1,) and a[0] == 1 else np.asarray(a * b)


def _objects(values: list[Any]) -> Array:
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found


@dataclass(frozen=True, slots=True)
class Scaled:
    """Rationals as whole numbers (object array) over a common denominator."""

    parts: Array
    over: int

    @classmethod
    def of(cls, values: Array) -> Scaled:
        """From an array of rationals, or of ints."""
        flat = values.reshape(-1).tolist()
        known = {id(v): v for v in flat}  # one object often stands in many places
        exact = {key: v if type(v) is Fraction else Fraction(v) for key, v in known.items()}
        over = math.lcm(*{v.denominator for v in exact.values()})
        parts = {key: v.numerator * (over // v.denominator) for key, v in exact.items()}
        return cls(_objects([parts[id(v)] for v in flat]).reshape(values.shape), over)

    def reduced(self) -> Scaled:
        """In lowest terms once the denominator is long."""
        return self if self.over.bit_length() < 128 else self.lowest()

    def lowest(self) -> Scaled:
        """In lowest terms."""
        common = math.gcd(self.over, *self.parts.reshape(-1).tolist())
        return self if common == 1 else Scaled(self.parts // common, self.over // common)

    def at(self, index: Any) -> Fraction:
        return Fraction(self.parts[index], self.over)


@dataclass(frozen=True)
class _Step:
    """Outcomes in order of their rows: columns, weights, whether each ends the episode; and the rewards (A*S,)."""

    first: Array  # of each row
    columns: Array
    weights: Scaled
    ends: Array
    R: Scaled


class Rational:
    """Arithmetic on values (S,), action values (A, S) and policies (A, S) as `Scaled`.

    `work` is how many operations on short numbers it costs to go from the last step to the first.

    Raises:
        Inexact: for models that are too large, or whose probabilities are no rationals.
    """

    def __init__(self, model: Model, reader: Reader) -> None:
        self.model = model
        self.reader = reader
        self.chances = Chances(reader)
        self.horizon = model.horizon or 0
        self.discount = reader(model.discount)
        self._steps = self._enumerated(Steps(model.task))

    def _enumerated(self, steps: Steps) -> list[_Step]:
        model = self.model
        size = model.n_states * model.n_actions * steps.branching
        if model.horizon is None or size * len(model.steps) > MOST_OUTCOMES:
            raise Inexact
        if model.entries / len(model.steps) * model.horizon > MOST_WORK:
            raise Inexact
        self.start = self._first(steps)
        found = [self._step(steps, t) for t in range(len(model.steps))]
        work = max(len(s.columns) for s in found) * model.horizon
        bits = max(s.weights.over for s in found).bit_length() + self.discount.denominator.bit_length()
        self.work = work * (1 + bits * model.horizon / WIDE)
        if self.work > MOST_WORK:
            raise Inexact
        return found

    def _first(self, steps: Steps) -> Scaled:
        start = _objects([Fraction(0)] * self.model.n_states)
        codes, weights = steps.starts(self.chances)
        start[np.searchsorted(self.model.codes, codes)] = weights
        return Scaled.of(start)

    def _step(self, steps: Steps, t: int) -> _Step:
        model = self.model
        rows, columns, weights, rewards, ends, _ = steps.table(model.codes, t, self.chances)
        order = np.argsort(rows, kind="stable")
        first = np.searchsorted(rows[order], np.arange(model.n_actions * model.n_states))
        acting = model.acting[rows % model.n_states]  # what is paid elsewhere need not even be a number
        distinct, which = np.unique(np.where(acting, rewards, 0.0)[order], return_inverse=True)
        rates = Scaled.of(_objects([self.reader(v) for v in distinct.tolist()]))
        chances = Scaled.of(weights[order])
        paid = np.add.reduceat(chances.parts * rates.parts[which.reshape(-1)], first)
        return _Step(first, columns[order], chances, ends[order], Scaled(paid, chances.over * rates.over).lowest())

    # -- values -------------------------------------------------------------------------------------------------------

    def zero(self) -> Scaled:
        return Scaled(_objects([0] * self.model.n_states), 1)

    def backup(self, t: int, value: Scaled, shift: Fraction = Fraction(0)) -> Scaled:
        """Action values at a time from the values at the next one; `shift` is added to every reward."""
        step = self._at(t)
        after = self._next(step, np.where(step.ends, 0, value.parts[step.columns]))
        gamma = self.discount
        over = math.lcm(step.R.over, gamma.denominator * step.weights.over * value.over, shift.denominator)
        more = over // (gamma.denominator * step.weights.over * value.over) * gamma.numerator
        paid = step.R.parts * (over // step.R.over) + shift.numerator * (over // shift.denominator)
        return Scaled(self._table(paid + after * more), over)

    def reached(self, t: int, value: Scaled, states: Array) -> Scaled:
        """Return probabilities (A, S) of being in `states` in the next step, or later by `value`, which is 1 there."""
        step = self._at(t)
        inside = _objects(
            [value.over if within else 0 for within in states.tolist()]
        )  # beyond what an int of NumPy holds
        after = np.where(step.ends, inside[step.columns], value.parts[step.columns])
        return Scaled(self._table(self._next(step, after)), step.weights.over * value.over)

    def marked(self, value: Scaled, states: Array) -> Scaled:
        """Return values with 1 in `states`."""
        return Scaled(np.where(states, value.over, value.parts), value.over).reduced()

    def _at(self, t: int) -> _Step:
        return self._steps[t if len(self._steps) > 1 else 0]

    def _next(self, step: _Step, after: Array) -> Array:
        return np.asarray(np.add.reduceat(step.weights.parts * after, step.first))

    def _table(self, flat: Array) -> Array:
        return flat.reshape(self.model.n_actions, self.model.n_states)

    def top(self, q: Scaled) -> Scaled:
        return Scaled(q.parts.max(axis=0), q.over).reduced()

    def bottom(self, q: Scaled) -> Scaled:
        return Scaled(q.parts.min(axis=0), q.over).reduced()

    def is_open(self, policy: Scaled) -> bool:
        return False

    def follow(self, policy: Scaled, q: Scaled, side: int = 1) -> Scaled:
        return Scaled((policy.parts * q.parts).sum(axis=0), policy.over * q.over).reduced()

    def followed(self, policy: Scaled, t: int, value: Scaled, side: int = 1) -> Scaled:
        return self.follow(policy, self.backup(t, value))

    def at_start(self, value: Scaled) -> Enclosure:
        found = Fraction(int((self.start.parts * value.parts).sum()), self.start.over * value.over)
        return Enclosure.exactly(found)

    # -- outcomes -----------------------------------------------------------------------------------------------------

    def rewards(self, t: int) -> Scaled:
        """Return expected rewards (A*S,) at a time."""
        return self._at(t).R

    def unit(self, t: int) -> int:
        """Return the common denominator of the probabilities of `goes_on`."""
        return self._at(t).weights.over

    def goes_on(self, t: int, row: int) -> Iterator[tuple[int, int]]:
        """Yield states in which the episode goes on after a row, action * S + state, each with its probability times
        `unit`.
        """
        step = self._at(t)
        last = step.first[row + 1] if row + 1 < len(step.first) else len(step.columns)
        for k in range(step.first[row], last):
            if not step.ends[k]:
                yield int(step.columns[k]), int(step.weights.parts[k])

    def successors(self, t: int, taken: Array) -> Array:
        """Return states (S,) in which episodes may go on if they take some actions (A, S) at a time."""
        step = self._at(t)
        rows = np.repeat(taken.reshape(-1), np.diff(step.first, append=len(step.columns)))
        found = np.zeros(self.model.n_states, np.bool_)
        found[step.columns[rows & ~step.ends.astype(np.bool_) & (step.weights.parts > 0)]] = True
        return found

    # -- policies -----------------------------------------------------------------------------------------------------

    def uniform(self) -> Scaled:
        shape = (self.model.n_actions, self.model.n_states)
        return Scaled(np.ones(shape, dtype=object), self.model.n_actions)

    def greedy(self, q: Scaled) -> Scaled:
        """Return all best actions alike."""
        best = q.parts == q.parts.max(axis=0)
        counts = best.sum(axis=0)
        over = math.lcm(*map(int, np.unique(counts)))
        return Scaled(best.astype(object) * np.array([over // int(n) for n in counts], dtype=object), over)

    def tabulated(self, nodes: Sequence[Node], t: int) -> Scaled:
        """Return a policy given by expressions, which may draw and read the time."""
        model = self.model
        given = self.model.reads(t)
        drawn = draws(nodes)
        if not drawn:  # one action in each state
            (branch,) = branches(drawn, given, model.n_states, self.chances)
            chosen = np.zeros((model.n_actions, model.n_states), dtype=object)
            chosen[acted(model.actions, nodes, given, branch, model.n_states)] = 1
            return Scaled(chosen, 1)
        table = _objects([Fraction(0)] * (model.n_actions * model.n_states)).reshape(model.n_actions, model.n_states)
        for branch in branches(drawn, given, model.n_states, self.chances):
            action, at = acted(model.actions, nodes, given, branch, model.n_states)
            np.add.at(table, (action, at), np.broadcast_to(branch.weight, (len(at),)))
        return Scaled.of(table)

    def preference(self, policy: Scaled, wanted: Array) -> Array:
        """In each state (S,): 1 where the most frequent action is a wanted one, -1 where not, 0 where both are alike.

        Frequencies that differ by at most 1e-9 of their size are alike.
        """
        good = np.where(wanted, policy.parts, -1).max(axis=0)
        bad = np.where(wanted, -1, policy.parts).max(axis=0)
        much = EQUAL.denominator
        more = EQUAL.denominator + EQUAL.numerator
        return np.asarray((good * much > bad * more).astype(np.int8) - (bad * much > good * more).astype(np.int8))

    def table(self, policy: Scaled) -> Array:
        """Return a policy as floats."""
        return np.array([v / policy.over for v in policy.parts.reshape(-1)]).reshape(policy.parts.shape)
