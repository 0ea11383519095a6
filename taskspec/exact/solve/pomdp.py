"""The best returns under observations that hide the state, in rationals: of memoryless policies, and of those that remember.

A memoryless policy gives one action to each observation. They are searched best first: with some observations given an action,
and in all others the best action of each state, an episode earns at least as much as any policy that agrees; where no two
states that look alike want different actions, it earns just that.

A belief is the distribution of the state given all observations and actions so far. The beliefs that episodes come to are
the states of a larger decision problem. It is searched from the start by trials, after T. Smith and R. Simmons, "Heuristic
Search Value Iteration for POMDPs" (UAI 2004): a trial follows the action whose upper bound is highest and the observation
whose gap weighs most, and on the way back narrows the bounds of the beliefs it passed. A new belief is worth at most the
return of an agent that knows the state, and at least that of an action which is taken at all times.

Beliefs are exact. Their bounds are rationals, exact while they are short; longer ones are rounded outwards to floats, so that
the cost of an operation does not grow with the length of a search.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import count
from math import gcd, lcm
from typing import TypeAlias

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import limits, tell
from taskspec.exact.model.model import Model
from taskspec.exact.solve.backward import all_values, backward, first_values
from taskspec.exact.solve.enclosure import Enclosure, rounded
from taskspec.exact.solve.rational import WIDE, Rational, Scaled
from taskspec.language.expressions.batch import evaluate
from taskspec.language.task.questions import reads_time

# -- observations -----------------------------------------------------------------------------------------------------


def observation_classes(model: Model) -> Array:
    """Return a number (T, S) for the observation of each state at each time, T being 1 where the time is not observed.

    Nothing seen is random (`modifiers.core.storing_observations`).
    """
    nodes = model.task.observation.nodes
    n = model.n_states
    times = range((model.horizon or 0) + 1 if reads_time(nodes) else 1)
    seen = []
    for t in times:
        rows = [np.zeros((1, n))]
        for value in evaluate(nodes, model.reads(t)):
            rows.append(np.broadcast_to(value, (*value.shape[:-1], n)).reshape(-1, n).astype(np.float64))
        seen.append(np.concatenate(rows).T)
    _, numbers = np.unique(np.concatenate(seen), axis=0, return_inverse=True)
    return np.asarray(numbers).reshape(len(times), n)


def at(seen: Array, t: int) -> Array:
    """Return the observation class of each state (S,) at a time."""
    return np.asarray(seen[t if len(seen) > 1 else 0])


def hides(model: Model, seen: Array) -> bool:
    """Return whether two states in which episodes act at the same time have the same observation."""
    return any(len(np.unique(at(seen, t)[level])) < np.count_nonzero(level) for t, level in model.levels())


# -- memoryless policies ----------------------------------------------------------------------------------------------

POLICY_RATE = 1_000_000
"""Nominal number of operations on short numbers in a second."""
OVERHEAD = 100
"""Operations that a step takes beside those on its outcomes."""
FREE = -1


@dataclass
class ReactiveSearch:
    """The search for the best memoryless policy; `seen` (T, S) has the `observation_classes`."""

    numbers: Rational
    seen: Array

    def value(self) -> Enclosure:
        """Return the return of the best memoryless policy; between two bounds where time ran out."""
        order = count()
        tried = 0
        each = 2 * (self.numbers.work + OVERHEAD * self.numbers.horizon)
        most = max(1, limits().seconds * POLICY_RATE // each)
        first = np.full(int(self.seen.max()) + 1, FREE)
        value, open_at, guess = self._relaxed(first)
        waiting = [(-value, next(order), first, open_at)]
        low = self._relaxed(guess)[0]
        while waiting:
            upper, _, policy, open_at = heapq.heappop(waiting)
            if open_at is None:
                return Enclosure.exactly(max(low, -upper))
            if low >= -upper:
                break
            if tried >= most:
                return Enclosure(low, -upper)
            tell(f"{tried:,} memoryless policies, between {float(low):.6g} and {float(-upper):.6g}")
            for action in range(self.numbers.model.n_actions):
                more = policy.copy()
                more[open_at] = action
                value, still_open, guess = self._relaxed(more)
                tried += 1
                if value > low:
                    heapq.heappush(waiting, (-value, next(order), more, still_open))
                    if still_open is not None:
                        value = self._relaxed(guess)[0]
                    low = max(low, value)
        return Enclosure.exactly(low)

    def _relaxed(self, policy: Array) -> tuple[Fraction, int | None, Array]:
        """Return the value if only some observations bind; one whose states want different actions; a policy near it."""
        numbers = self.numbers
        wanted = []

        def choose(t: int, q: Scaled) -> Scaled:
            bound = policy[at(self.seen, t)]
            parts = np.where(bound == FREE, q.parts.max(axis=0), q.parts[bound, np.arange(len(bound))])
            wanted.append(np.where(bound == FREE, q.parts == parts, np.arange(len(q.parts))[:, None] == bound))
            return Scaled(parts, q.over).reduced()

        values = first_values(backward(numbers.backup, choose, numbers.zero(), numbers.horizon))
        start = numbers.at_start(values).low
        assert isinstance(start, Fraction)
        return start, *self._conflict(policy, wanted[::-1])

    def _conflict(self, policy: Array, wanted: list[Array]) -> tuple[int | None, Array]:
        numbers = self.numbers
        shape = (len(policy), numbers.model.n_actions)
        votes = np.zeros(shape)
        agreed = np.ones(shape, np.bool_)
        level = numbers.start.parts > 0
        met: list[int] = []
        for t, best in enumerate(wanted):
            look = at(self.seen, t)
            here = np.flatnonzero(level)
            met += look[here].tolist()
            np.add.at(votes, look[here], best.T[here])
            np.logical_and.at(agreed, look[here], best.T[here])
            level = numbers.successors(t, level & best)
        votes += agreed * (len(wanted) * len(level))
        guess = np.where(policy == FREE, votes.argmax(axis=1), policy)
        is_open = (policy == FREE) & ~agreed.any(axis=1)
        return next((look for look in met if is_open[look]), None), guess


# -- policies that remember -------------------------------------------------------------------------------------------

Belief: TypeAlias = tuple[tuple[int, int], ...]
"""States with their weights, in order; the weights are whole numbers without a common divisor."""
BELIEF_RATE = 300_000
"""Nominal number of operations on short numbers in a second."""
CLOSE = Fraction(1, 10**10)
"""The gap at which a search ends, relative to the value."""
SHORT = 256
"""Bits of a denominator up to which bounds are exact."""


@dataclass(slots=True)
class _Choice:
    """An action in a belief: it pays `paid / whole`, and leads to `after[i]` with discounted probability `weights[i] / whole`."""

    paid: int
    weights: list[int]
    after: list[_Node]
    whole: int

    def widest(self, allowed: Fraction) -> _Node:
        """Return the belief that adds most to the gap, beyond a gap that is allowed."""
        excess = []
        for weight, node in zip(self.weights, self.after, strict=True):
            excess.append(weight / self.whole * rounded(node.high - node.low - allowed))
        return self.after[excess.index(max(excess))]


@dataclass(slots=True)
class _Node:
    """A belief at a time, with bounds of what is still to come; `choices` has one entry for each action."""

    t: int
    belief: Belief
    low: Fraction
    high: Fraction
    choices: list[_Choice]


@dataclass
class BeliefSearch:
    """The search for the best policy that remembers; `seen` (T, S) has the `observation_classes`."""

    numbers: Rational
    seen: Array
    spent: float = 0.0
    nodes: dict[tuple[int, Belief], _Node] = field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = self.numbers
        largest = max(Fraction(max(map(abs, step.R.parts.tolist())), step.R.over) for step in numbers.steps)
        self.least_gap = largest * numbers.horizon**2 / 2**48  # which rounding may leave
        self.knowing = self._values(lambda t, q: numbers.top(q))
        self.constant: list[list[Scaled]] = []
        for action in range(numbers.model.n_actions):

            def take(t: int, q: Scaled, action: int = action) -> Scaled:
                return Scaled(q.parts[action], q.over).reduced()

            self.constant.append(self._values(take))

    def _values(self, choose: Callable[[int, Scaled], Scaled]) -> list[Scaled]:
        return all_values(backward(self.numbers.backup, choose, self.numbers.zero(), self.numbers.horizon))

    def value(self) -> Enclosure:
        """Return the return of the best policy that remembers; two bounds where time ran out."""
        start = self.numbers.start
        first = _Choice(0, [], [], start.over)
        self._lead_to(first, 0, dict(enumerate(start.parts.tolist())), 1)
        while True:
            low = self._worth(first, is_high=False)
            high = self._worth(first, is_high=True)
            close = max(CLOSE * max(abs(low), abs(high)), self.least_gap)
            if high - low <= close or self.spent > limits().seconds * BELIEF_RATE:
                return Enclosure(low, high)
            tell(f"{len(self.nodes):,} beliefs, between {rounded(low):.6g} and {rounded(high):.6g}")
            self._trial(first, close)

    def _trial(self, first: _Choice, close: Fraction) -> None:
        choice = first
        path = []
        while choice.after:
            t = choice.after[0].t
            allowed = close * Fraction(2 * self.numbers.horizon - t, 2 * self.numbers.horizon)
            node = choice.widest(allowed)
            if node.high - node.low <= allowed:
                break
            path.append(node)
            if not node.choices:
                node.choices = [self._choice(node, a) for a in range(self.numbers.model.n_actions)]
            choice = max(node.choices, key=lambda found: self._worth(found, is_high=True))
        for node in reversed(path):
            node.high = min(node.high, max(self._worth(found, is_high=True) for found in node.choices))
            node.low = max(node.low, max(self._worth(found, is_high=False) for found in node.choices))

    def _worth(self, choice: _Choice, is_high: bool) -> Fraction:
        self._charge(1 + len(choice.after), choice.whole)
        ends = [node.high if is_high else node.low for node in choice.after]
        over = lcm(*(end.denominator for end in ends))
        total = choice.paid * over
        for weight, end in zip(choice.weights, ends, strict=True):
            total += weight * end.numerator * (over // end.denominator)
        return self._rounded(total, choice.whole * over, is_high)

    def _choice(self, node: _Node, action: int) -> _Choice:
        numbers = self.numbers
        step = numbers.step(node.t)
        total = 0
        paid = 0
        outcomes = 0
        after: dict[int, int] = defaultdict(int)
        for state, weight in node.belief:
            row = action * numbers.model.n_states + state
            total += weight
            paid += weight * step.R.parts[row]
            for column, probability in numbers.goes_on(node.t, row):
                after[column] += weight * probability
                outcomes += 1
        self._charge(len(node.belief) + outcomes, total)
        unit = step.weights.over * numbers.discount.denominator
        over = lcm(unit, step.R.over)
        choice = _Choice(paid * (over // step.R.over), [], [], total * over)
        if node.t + 1 < numbers.horizon:
            self._lead_to(choice, node.t + 1, after, over // unit * numbers.discount.numerator)
        divisor = gcd(choice.whole, choice.paid, *choice.weights)
        weights = [w // divisor for w in choice.weights]
        return _Choice(choice.paid // divisor, weights, choice.after, choice.whole // divisor)

    def _lead_to(self, choice: _Choice, t: int, weights: dict[int, int], factor: int) -> None:
        look = at(self.seen, t)
        parts = defaultdict[int, list[tuple[int, int]]](list)
        for state, weight in sorted(weights.items()):
            if weight:
                parts[int(look[state])].append((state, weight))
        for part in parts.values():
            divisor = gcd(*(weight for _, weight in part))
            choice.weights.append(sum(weight for _, weight in part) * factor)
            choice.after.append(self._node(t, tuple((state, weight // divisor) for state, weight in part)))

    def _node(self, t: int, belief: Belief) -> _Node:
        if (t, belief) not in self.nodes:
            total = sum(weight for _, weight in belief)
            self._charge((1 + len(self.constant)) * len(belief), total)
            low = max(self._expected(values[t], belief, total, is_high=False) for values in self.constant)
            high = self._expected(self.knowing[t], belief, total, is_high=True)
            self.nodes[t, belief] = _Node(t, belief, low, high, [])
        return self.nodes[t, belief]

    def _expected(self, values: Scaled, belief: Belief, total: int, is_high: bool) -> Fraction:
        expected = sum(weight * values.parts[state] for state, weight in belief)
        return self._rounded(expected, total * values.over, is_high)

    def _charge(self, operations: int, size: int) -> None:
        self.spent += operations * (1 + size.bit_length() / WIDE)

    def _rounded(self, part: int, over: int, is_high: bool) -> Fraction:
        found = Fraction(part, over)
        if over.bit_length() <= SHORT:
            return found
        low, high = Enclosure.exactly(found).ends
        return Fraction(high if is_high else low)
