"""Bounds of the best return of an agent who remembers what it saw and did.

A belief is the distribution of the state given all observations and actions so far. The beliefs that episodes come to are
the states of a larger decision problem. It is searched from the start by trials, after T. Smith and R. Simmons, "Heuristic
Search Value Iteration for POMDPs" (UAI 2004): a trial follows the action whose upper bound is highest and the observation
whose gap weighs most, and on the way back narrows the bounds of the beliefs it passed. A new belief is worth at most what
somebody would earn who knew the state, and at least what one action earns that is taken for ever.

Beliefs are exact. Bounds are rationals, exact while they are short; longer ones are rounded outwards to a grid that is fine
beside the largest value of the task, so that the cost of an operation does not grow with the length of a search.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm
from typing import Any, TypeAlias

from taskspec.base.arrays import Array
from taskspec.base.limits import limits, tell
from taskspec.solve.backward import all_values, backward
from taskspec.solve.enclosure import Enclosure, rounded
from taskspec.solve.memoryless import at
from taskspec.solve.rational import WIDE, Rational, Scaled

Belief: TypeAlias = tuple[tuple[int, int], ...]
"""States with their weights, in order; the weights are whole numbers without a common divisor."""
RATE = 300_000
"""Operations on short numbers that are done in a second, nominally."""
CLOSE = Fraction(1, 10**10)
"""The gap at which a search ends, relative to the value."""
SHORT = 256
"""Bits of a denominator up to which bounds are exact."""
FINE = 128
"""The grid of longer bounds: so many bits below the largest value."""


@dataclass(slots=True)
class _Choice:
    """What an action does to a belief: it pays `paid / whole`, and leads to `after[i]` with probability `weights[i] / whole`.

    The probabilities are discounted.
    """

    paid: int
    weights: list[int]
    after: list[_Node]
    whole: int

    def add(self, weight: int, node: _Node) -> None:
        self.weights.append(weight)
        self.after.append(node)

    def reduced(self) -> _Choice:
        """Return the same in lowest terms."""
        divisor = gcd(self.whole, self.paid, *self.weights)
        return _Choice(self.paid // divisor, [w // divisor for w in self.weights], self.after, self.whole // divisor)

    def widest(self, allowed: Fraction) -> _Node:
        """Return the belief that adds most to the gap, beyond a gap that is allowed."""
        excess = []
        for weight, node in zip(self.weights, self.after, strict=True):
            excess.append(weight / self.whole * rounded(node.gap - allowed))
        return self.after[excess.index(max(excess))]


@dataclass(slots=True)
class _Node:
    """A belief at a time, with bounds of what is still to come; `choices` has one entry for each action."""

    t: int
    belief: Belief
    low: Fraction
    high: Fraction
    choices: list[_Choice] | None = None

    @property
    def gap(self) -> Fraction:
        return self.high - self.low


@dataclass
class BeliefSearch:
    """The search; `seen` (T, S) numbers what is seen, as `observation_classes` does."""

    numbers: Rational
    seen: Array
    spent: float = 0.0
    nodes: dict[tuple[int, Belief], _Node] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.grid = _grid(self.numbers)
        self.knowing, self.constant = self._vectors()

    def value(self) -> Enclosure:
        """Return what the best policy that remembers earns; two bounds where time ran out."""
        start = self._parts(0, dict(enumerate(self.numbers.start.parts.tolist())))
        whole = self.numbers.start.over
        first = _Choice(0, [], [], whole)
        for weight, belief in start:
            first.add(weight, self._node(0, belief))
        while True:
            low = self._worth(first, is_high=False)
            high = self._worth(first, is_high=True)
            size = max(abs(low), abs(high))
            close = max(CLOSE * size, Fraction(4 * self.numbers.horizon, self.grid))
            if high - low <= close or self.spent > limits().seconds * RATE:
                return Enclosure(low, high)
            tell(f"{len(self.nodes):,} beliefs, between {rounded(low):.6g} and {rounded(high):.6g}")
            self._trial(first, close)

    def _trial(self, first: _Choice, close: Fraction) -> None:
        """Follow one episode to where bounds are close, and narrow those of the beliefs on the way."""
        choice = first
        path = []
        while choice.after:
            t = choice.after[0].t
            allowed = close * Fraction(2 * self.numbers.horizon - t, 2 * self.numbers.horizon)
            node = choice.widest(allowed)
            if node.gap <= allowed:
                break
            path.append(node)
            if node.choices is None:
                node.choices = [self._choice(node, a) for a in range(self.numbers.model.n_actions)]
            choice = max(node.choices, key=lambda found: self._worth(found, is_high=True))
        for node in reversed(path):
            assert node.choices is not None
            node.high = min(node.high, max(self._worth(found, is_high=True) for found in node.choices))
            node.low = max(node.low, max(self._worth(found, is_high=False) for found in node.choices))

    def _worth(self, choice: _Choice, is_high: bool) -> Fraction:
        """Return a bound of the expected return of a choice."""
        self._charge(1 + len(choice.after), choice.whole)
        ends = [node.high if is_high else node.low for node in choice.after]
        over = lcm(*(end.denominator for end in ends))
        total = choice.paid * over
        for weight, end in zip(choice.weights, ends, strict=True):
            total += weight * end.numerator * (over // end.denominator)
        return self._rounded(total, choice.whole * over, is_high)

    def _choice(self, node: _Node, action: int) -> _Choice:
        """Return what an action does to a belief."""
        numbers = self.numbers
        t = node.t
        reward = numbers.rewards(t)
        total = 0
        paid = 0
        outcomes = 0
        after: dict[int, int] = defaultdict(int)
        for state, weight in node.belief:
            row = action * numbers.model.n_states + state
            total += weight
            paid += weight * reward.parts[row]
            for column, chance in numbers.goes_on(t, row):
                after[column] += weight * chance
                outcomes += 1
        self._charge(len(node.belief) + outcomes, total)
        unit = numbers.unit(t) * numbers.discount.denominator
        over = lcm(unit, reward.over)
        choice = _Choice(paid * (over // reward.over), [], [], total * over)
        if t + 1 < numbers.horizon:
            more = over // unit * numbers.discount.numerator
            for weight, belief in self._parts(t + 1, after):
                choice.add(weight * more, self._node(t + 1, belief))
        return choice.reduced()

    def _parts(self, t: int, weights: dict[int, int]) -> list[tuple[int, Belief]]:
        """Return weighted states by what is seen of them: the total weight of each part, and the belief that it is."""
        look = at(self.seen, t)
        parts = defaultdict[int, list[tuple[int, int]]](list)
        for state, weight in sorted(weights.items()):
            if weight:
                parts[int(look[state])].append((state, weight))
        found = []
        for part in parts.values():
            divisor = gcd(*(weight for _, weight in part))
            found.append((sum(w for _, w in part), tuple((state, weight // divisor) for state, weight in part)))
        return found

    def _node(self, t: int, belief: Belief) -> _Node:
        """Return the node of a belief, which is made when it is first asked for."""
        if (t, belief) not in self.nodes:
            total = sum(weight for _, weight in belief)
            self._charge((1 + len(self.constant)) * len(belief), total)
            low = max(self._expected(values[t], belief, total, is_high=False) for values in self.constant)
            high = self._expected(self.knowing[t], belief, total, is_high=True)
            self.nodes[t, belief] = _Node(t, belief, low, high)
        return self.nodes[t, belief]

    def _expected(self, values: Scaled, belief: Belief, total: int, is_high: bool) -> Fraction:
        expected = sum(weight * values.parts[state] for state, weight in belief)
        return self._rounded(expected, total * values.over, is_high)

    def _charge(self, operations: int, size: int) -> None:
        """Count operations on numbers as long as `size`."""
        self.spent += operations * (1 + size.bit_length() / WIDE)

    # -- rounding -----------------------------------------------------------------------------------------------------

    def _rounded(self, part: int, over: int, is_high: bool) -> Fraction:
        """Return `part / over`, rounded up or down to the grid where it is long."""
        if over.bit_length() <= SHORT:
            return Fraction(part, over)
        return Fraction(_divided(part * self.grid, over, is_high), self.grid)

    def _vectors(self) -> tuple[list[Scaled], list[list[Scaled]]]:
        """Return values (S,) from each time on: of knowing the state, and of each action taken for ever."""
        numbers = self.numbers

        def best(t: int, q: Scaled) -> Scaled:
            return self._shortened(numbers.top(q), is_high=True)

        def taken(action: int) -> Callable[[int, Scaled], Scaled]:
            return lambda t, q: self._shortened(Scaled(q.parts[action], q.over).reduced(), is_high=False)

        def values(choose: Callable[[int, Scaled], Scaled]) -> list[Scaled]:
            return all_values(backward(numbers.backup, choose, numbers.zero(), numbers.horizon))

        return values(best), [values(taken(action)) for action in range(numbers.model.n_actions)]

    def _shortened(self, values: Scaled, is_high: bool) -> Scaled:
        """Return values, rounded up or down to the grid where they are long."""
        if values.over.bit_length() <= SHORT:
            return values
        return Scaled(_divided(values.parts * self.grid, values.over, is_high), self.grid)


def _divided(part: Any, over: int, is_high: bool) -> Any:
    """Return the whole number next to `part / over`, above or below; also of arrays."""
    return -(-part // over) if is_high else part // over


def _grid(numbers: Rational) -> int:
    """Return the denominator of the grid: a power of two, fine beside the largest return that rewards allow."""
    largest = Fraction(0)
    for t in range(len(numbers.model.steps)):
        reward = numbers.rewards(t)
        largest = max(largest, Fraction(max(map(abs, reward.parts.tolist())), reward.over))
    largest *= numbers.horizon
    exponent = largest.numerator.bit_length() - largest.denominator.bit_length()
    return 1 << max(0, FINE - exponent)
