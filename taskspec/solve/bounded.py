"""Backward induction in float64 with a bound on the error of every value, for models of any size.

A value v with an error e stands for all numbers within e of v. Errors are carried state by state: those of the next
values weighted by the probabilities, plus what rounding can add, by the usual bounds (Higham, Accuracy and Stability of
Numerical Algorithms, 2002, chapter 3): a sum of n products errs by at most n units times the sum of their sizes. The
bounds are computed in floats themselves, and inflated by more than that can lose.

Deterministic tasks that pay whole numbers are free of rounding, and their errors are 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.ir import Node, draws
from taskspec.model.model import Model, Step
from taskspec.model.transitions import Steps, acted, branches, count
from taskspec.solve.enclosure import EQUAL, Enclosure
from taskspec.solve.following import Bound, Policy, followed
from taskspec.solve.pieces import PIECE, every, pieces
from taskspec.solve.rounding import FAINT, FLOOR, TINIEST, UNIT, Slack, StepBounds

UNKNOWN = 2
DEEPEST = 1e4
"""Exponents from here on make weights of 0, which are less than `FLOOR` off."""
STATES = 65_536
"""In how many states at once an expert is asked, and followed."""


@dataclass(frozen=True, slots=True)
class _Later:
    """Values (S,) of the next time: `off` what a row is off by in proportion to its probabilities, and `lost` besides."""

    value: Array
    off: Array
    lost: float
    has_errors: bool


class Bounded:
    """Arithmetic on values (S,), action values (A, S) and policies (A, S) as floats with bounds."""

    def __init__(self, model: Model) -> None:
        self.model, self.horizon = model, model.horizon or 0
        steps = Steps(model.task)
        builder = model.task.builder
        self.slack, self.is_faint = Slack.of(steps.draws, builder, steps.reward), steps.is_faint
        first = draws(steps.first)
        self.start_slack, self.start_terms = Slack.of(first, builder), count(first, {})
        self._parts: dict[int, StepBounds] = {}
        self._chain: tuple[StepBounds, Policy, StepBounds] | None = None

    @cached_property
    def is_whole(self) -> bool:
        """Whether values of deterministic policies are never rounded: one outcome for each action, whole rewards, small sums."""
        steps = self.model.steps
        return (
            self.model.discount == 1
            and not self.is_faint
            and max(s.scale for s in steps) * max(1, self.horizon) < 2**53
            and all(s.terms == 1 and _ones(s) for s in steps)
            and all(every(self._acting(s.reward), lambda paid: np.mod(paid, 1) == 0) for s in steps)
        )

    @property
    def floor(self) -> float:
        return 0.0 if self.is_whole else FLOOR

    @property
    def rounding(self) -> float:
        """The relative error of discounting, and of adding a reward to a value that is known without an error."""
        return 0.0 if self.is_whole else 4 * UNIT

    def _acting(self, rows: Array) -> Array:
        """What is paid (A*S,); 0 for what is no number, which only states that no episode acts in may have."""
        known = np.isfinite(rows)
        return rows if known.all() else np.where(known | np.tile(self.model.acting, self.model.n_actions), rows, 0.0)

    def part(self, t: int) -> StepBounds:
        step = self.model.step(t)
        if id(step) not in self._parts:
            self._parts[id(step)] = self._prepared(step)
        return self._parts[id(step)]

    def _prepared(self, step: Step) -> StepBounds:
        reward, slack, n = self._acting(step.reward), self.slack, step.terms
        if self.is_whole:
            return StepBounds(step, reward, reward, 0.0, 0.0, 0.0, 1 + 128 * UNIT, 0.0, False)
        c = (n + 2) * UNIT + slack.relative
        sizes = reward if step.spread is None else self._acting(step.spread)
        faint = not all(every(m.data, lambda p: p >= FAINT) for m in (step.going, step.ending) if m is not None)
        absolute = (slack.absolute + (TINIEST if faint else 0.0)) * n
        hidden = FLOOR if self.is_faint or step.least < FLOOR else 0.0
        beyond = absolute * step.scale + slack.missing * slack.beyond + hidden
        inflate, lost = 1 + (n + 16) * 8 * UNIT, absolute + 2 * slack.missing
        return StepBounds(step, reward, sizes, c + 8 * UNIT, beyond, c, inflate, lost, faint, hidden)

    # -- values -------------------------------------------------------------------------------------------------------

    def zero(self) -> Bound:
        return Bound(np.zeros(self.model.n_states), np.zeros(self.model.n_states))

    def backup(self, t: int, value: Bound, shift: Fraction = Fraction(0)) -> Bound:
        """Action values at a time from the values at the next one; `shift` is added to every reward."""
        part = self.part(t)
        q = self._backed_up(part, self._later(part, value), slice(0, part.step.going.shape[0]), float(shift))
        return self._table(q.value, q.error)

    def followed(self, policy: Policy, t: int, value: Bound) -> Bound:
        """The value of acting by a policy at a time; where tables are large, in some states at once, one action after another."""
        n, actions = self.model.n_states, self.model.n_actions
        if policy.actions is not None:
            part = self._acted(self.part(t), policy, policy.actions)
            return self._backed_up(part, self._later(part, value), slice(0, n))
        if n * actions <= PIECE:
            return self.follow(policy, self.backup(t, value))
        part, found = self.part(t), self.zero()
        later = self._later(part, value)
        for low in range(0, n, STATES):
            here = slice(low, min(low + STATES, n))
            rows = [slice(a * n + here.start, a * n + here.stop) for a in range(actions)]
            some = followed(policy.of(here), (self._backed_up(part, later, r) for r in rows))
            found.value[here], found.error[here] = some.value, some.error
        return found

    def _acted(self, part: StepBounds, policy: Policy, actions: Array) -> StepBounds:
        """What comes of one action (S,) in each state; kept, as most policies are the same at all times."""
        if self._chain is None or self._chain[0] is not part or self._chain[1] is not policy:
            n = self.model.n_states
            self._chain = part, policy, part.of(actions * n + np.arange(n))
        return self._chain[2]

    def _backed_up(self, part: StepBounds, later: _Later, rows: slice, more: float = 0.0) -> Bound:
        """The values of some actions in states (A*S,), and bounds of their errors."""
        q, error = self._through(part.step.going, later, rows)
        if self.model.discount != 1:
            q *= self.model.discount
            error = error * self.model.discount + self.floor * (error > 0)
        reward = part.reward[rows]
        if more or not self.is_whole or later.has_errors:  # values with an error need not be whole
            for low in range(0, len(q), PIECE):
                here = slice(low, min(low + PIECE, len(q)))
                paid = part.reward_error(slice(rows.start + here.start, rows.start + here.stop))
                error[here] += paid + 4 * UNIT * (np.abs(q[here]) + np.abs(reward[here]) + abs(more))
            error *= part.inflate
        q += reward
        if more:
            q += more
        return Bound(q, error)

    def reached(self, t: int, value: Bound, states: Array) -> Bound:
        """Probabilities (A, S) of being in `states` in the next step, or later by `value`, which is 1 there."""
        part = self.part(t)
        rows = slice(0, part.step.going.shape[0])
        q, error = self._through(part.step.going, self._later(part, value), rows)
        if part.step.ending is not None:
            ends = Bound(states.astype(np.float64), np.zeros(len(states)))
            p, more = self._through(part.step.ending, self._later(part, ends), rows)
            q, error = q + p, error + more + self.rounding * (q + p)  # with one outcome, one of them is 0
        return self._table(q, error * part.inflate)

    def marked(self, value: Bound, states: Array) -> Bound:
        """Values with 1 in `states`."""
        return Bound(np.where(states, 1.0, value.value), np.where(states, 0.0, value.error))

    def _later(self, part: StepBounds, value: Bound) -> _Later:
        """Values of the next time, and what expectations of them are off by."""
        size = np.abs(value.value)
        off = value.error + part.c * size + self.floor * (size > 0)
        return _Later(value.value, off, self.lost(part, value.value, value.error), bool(value.error.any()))

    def _through(self, matrix: Any, later: _Later, rows: slice) -> tuple[Array, Array]:
        """Expected values of some rows (A*S,) after a step, and bounds of their errors."""
        q, error = np.empty(rows.stop - rows.start), np.zeros(rows.stop - rows.start)
        for at, some in pieces(matrix, rows):
            q[at] = some @ later.value
        if not (later.off.any() or later.lost):
            return q, error
        for at, some in pieces(matrix, rows):
            found = some @ later.off
            error[at] = found + self.floor * (found > 0) + later.lost
        return q, error

    def lost(self, part: StepBounds, value: Array, error: Array) -> float:
        """What is not relative to the size of a row: outcomes left out, and products of which nothing is left."""
        if not (part.lost or part.faint):
            return 0.0
        most = float(np.max(np.abs(value) + error, initial=0.0))
        return part.lost * most + (self.floor if most else 0.0)

    def _table(self, q: Array, error: Array) -> Bound:
        shape = (self.model.n_actions, self.model.n_states)
        return Bound(q.reshape(shape), error.reshape(shape))

    def top(self, q: Bound) -> Bound:
        """The largest action value: off by no more than any that may be the largest."""
        return Bound(q.value.max(axis=0), _largest_error(q, _possible(q)))

    def bottom(self, q: Bound) -> Bound:
        found = self.top(Bound(-q.value, q.error))
        return Bound(-found.value, found.error)

    def follow(self, policy: Policy, q: Bound) -> Bound:
        """The value of acting by a policy."""
        return followed(policy, map(Bound, q.value, q.error))

    def at_start(self, value: Bound) -> Enclosure:
        start = self.model.start
        first = np.flatnonzero(start)
        if len(first) == 1:
            return Enclosure.around(float(value.value[first[0]]), float(value.error[first[0]]))
        relative = self.start_slack.relative + (self.start_terms + 4) * UNIT
        weights, values, errors = start[first], value.value[first], value.error[first]
        faint = TINIEST if (weights < FAINT).any() else 0.0
        lost = self.start_slack.absolute * self.start_terms + (2 * self.start_slack.missing + faint) * len(first)
        most = float(np.max(np.abs(values) + errors))
        lost = lost * most + (FLOOR if most else 0.0)
        error = math.fsum(weights * (errors + relative * np.abs(values))) * (1 + 1e-12) + lost
        return Enclosure.around(math.fsum(weights * values), error)

    # -- policies -----------------------------------------------------------------------------------------------------

    def uniform(self) -> Policy:
        return self._uniform

    @cached_property
    def _uniform(self) -> Policy:
        shape = (self.model.n_actions, self.model.n_states)
        return Policy(np.broadcast_to(1 / self.model.n_actions, shape))

    def greedy(self, q: Bound) -> Policy:
        """All best actions alike; open where errors leave it undecided which these are."""
        best = _possible(q)
        count = best.sum(axis=0)
        unsure = best & (count > 1) & (_largest_error(q, best) > 0)
        return Policy(best / count, None, unsure if unsure.any() else None)

    # Elementary functions err by less than 4 units, and exp(-x) by 2 x units more for the rounding of its argument.

    def soft(self, q: Bound, beta: float) -> Bound:
        """Return the soft values log(sum over a of exp(beta Q)) / beta."""
        total = np.exp(-_depth(q, beta)).sum(axis=0)
        value = q.value.max(axis=0) + np.log(total) / beta
        error = q.error.max(axis=0) + _units(q) * (1 / beta + np.abs(value))
        return Bound(value, error)

    def boltzmann(self, q: Bound, beta: float) -> Policy:
        """Return the policy of actions in proportion to exp(beta Q)."""
        depth = _depth(q, beta)
        weights = np.exp(-depth)
        table = weights / weights.sum(axis=0)
        with np.errstate(over="ignore"):
            exponent = beta * (q.error + q.error.max(axis=0))
        apart = np.expm1(np.minimum(exponent, 30.0)) + _units(q) + 4 * UNIT * depth
        off = np.where(exponent > 30, 1.0, np.minimum(table * apart + 1e-300, 1.0))
        return Policy(table, off)

    def tabulated(self, nodes: Sequence[Node], t: int) -> Policy:
        """A policy given by expressions, which may draw and read the time."""
        model = self.model
        table, drawn = np.zeros((model.n_actions, model.n_states)), draws(nodes)
        for low in range(0, model.n_states, STATES):
            some = slice(low, min(model.n_states, low + STATES))
            given, here = model.reads(t, some), table[:, some]
            for branch in branches(drawn, given, here.shape[1]):
                action, at = acted(model.actions, nodes, given, branch, here.shape[1])
                np.add.at(here, (action, at), np.broadcast_to(branch.weight, (len(at),)))
        slack = Slack.of(drawn, model.task.builder)
        terms = count(drawn, {})  # so many may have been added up
        relative, off = slack.relative + (8 + terms) * UNIT, slack.absolute * terms + slack.missing
        faint = np.where((table > 0) & (table < FAINT), TINIEST * terms, 0.0)
        return Policy(table, table * relative + off + faint if drawn else None)

    def preference(self, policy: Policy, wanted: Array) -> Array:
        """In each state (S,): 1 where the most frequent action is a wanted one, -1 where not, 0 where both are alike.

        Frequencies that differ by at most 1e-9 of their size are alike. `UNKNOWN` where errors leave it undecided.
        """
        error = 0.0 if policy.error is None else policy.error
        low, high = policy.table - error, policy.table + error
        good, bad = _most(low, high, wanted), _most(low, high, ~wanted)
        apart = 1 + float(EQUAL)
        found = np.full(len(good[0]), UNKNOWN, np.int8)
        found[(good[1] <= bad[0] * apart) & (bad[1] <= good[0] * apart)] = 0
        found[good[0] > bad[1] * apart] = 1
        found[bad[0] > good[1] * apart] = -1
        if policy.open is not None:
            some, every = (policy.open & wanted).any(axis=0), ~(policy.open & ~wanted).any(axis=0)
            found = np.where(policy.open.any(axis=0), np.where(every, 1, np.where(some, UNKNOWN, -1)), found)
        return found.astype(np.int8)

    def table(self, policy: Policy) -> Array:
        return policy.table


def _ones(step: Step) -> bool:
    parts = [step.going.data] + ([] if step.ending is None else [step.ending.data])
    return all(every(data, lambda p: (p == 0) | (p == 1)) for data in parts)


def _depth(q: Bound, beta: float) -> Array:
    """Return by how much beta Q is below the largest in its state, (A, S)."""
    with np.errstate(over="ignore"):  # of floats near the largest
        return np.asarray(np.minimum(beta * (q.value.max(axis=0) - q.value), DEEPEST))


def _units(q: Bound) -> float:
    """Return the relative error of sums of exponentials over the actions."""
    return (16 * len(q.value) + 32) * UNIT


def _possible(q: Bound) -> Array:
    """Which actions (A, S) may be the best; the factor 2 makes up for rounding in the comparison."""
    chosen = q.value.argmax(axis=0)
    each = np.arange(q.value.shape[1])
    top, off = q.value[chosen, each], q.error[chosen, each]
    return np.array([v >= top - 2 * (e + off) for v, e in zip(q.value, q.error, strict=True)])


def _largest_error(q: Bound, among: Array) -> Array:
    """The largest error (S,) of some actions (A, S), of which there is one in each state."""
    return np.asarray(np.max(q.error, axis=0, where=among, initial=0.0))


def _most(low: Array, high: Array, among: Array) -> tuple[Array, Array]:
    """Bounds of the largest probability among some actions; below 0 where there are none."""
    return np.where(among, low, -1.0).max(axis=0), np.where(among, high, -1.0).max(axis=0)
