"""The best that an agent can earn who remembers what it saw and did: bounds of the value over beliefs, in rationals.

A belief is the distribution of the state given all observations and actions so far. Beliefs that episodes come to are the
states of a larger decision problem. It is searched from the start by trials, after T. Smith and R. Simmons, "Heuristic
Search Value Iteration for POMDPs" (UAI 2004): each follows the action whose upper bound is highest and the observation
whose gap weighs most, and on the way back narrows the bounds of the beliefs it passed. A new belief is worth at most what
somebody would earn who knew the state, and at least what one action earns that is taken for ever. No operation rounds.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd
from typing import Any, TypeAlias

import numpy as np

from taskspec.exact.planning.certified.enclosure import Enclosure
from taskspec.exact.planning.certified.rational import Rational, Scaled
from taskspec.exact.planning.looks import at
from taskspec.limits import limits
from taskspec.progress import tell

Array = np.ndarray[Any, Any]
Belief: TypeAlias = tuple[tuple[int, int], ...]
"""States with their weights, in order; the weights are whole numbers without a common divisor."""
RATE = 100_000
"""Outcomes of beliefs that are worked out in a second, nominally."""
CLOSE = Fraction(1, 10**10)
"""The gap at which a search ends, relative to the value."""


@dataclass(slots=True)
class _Node:
    """A belief at a time, with bounds of what is still to come; `choices` are what each action pays and leads to."""

    t: int
    belief: Belief
    low: Fraction
    high: Fraction
    choices: list[tuple[Fraction, list[tuple[Fraction, _Node]]]] | None = None

    @property
    def gap(self) -> Fraction:
        return self.high - self.low


@dataclass
class BeliefSearch:
    """The search; `seen` (T, S) numbers what is seen, as `looks` does."""

    numbers: Rational
    seen: Array
    spent: int = 0
    nodes: dict[tuple[int, Belief], _Node] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.knowing, self.constant = _vectors(self.numbers)

    def value(self) -> Enclosure:
        """What is earned by the best policy that remembers; between two bounds where time ran out."""
        start = self._parts(0, dict(enumerate(self.numbers.start.parts.tolist())))
        whole = self.numbers.start.over
        first = [(Fraction(weight, whole), self._node(0, belief)) for weight, belief in start]
        while True:
            low, high = (sum((p * getattr(n, end) for p, n in first), Fraction(0)) for end in ("low", "high"))
            if high - low <= CLOSE * max(abs(low), abs(high)) or self.spent > limits().seconds * RATE:
                return Enclosure(low, high)
            tell(f"{len(self.nodes):,} beliefs, between {float(low):.6g} and {float(high):.6g}")
            self._trial(max(first, key=lambda part: part[0] * part[1].gap)[1])

    def _trial(self, node: _Node) -> None:
        path = []
        while node.gap and node.t < self.numbers.horizon:
            path.append(node)
            if node.choices is None:
                node.choices = [self._choice(node, a) for a in range(self.numbers.model.n_actions)]
            _, after = max(node.choices, key=lambda choice: self._worth(choice, "high"))
            if not after:
                break
            node = max(after, key=lambda part: part[0] * part[1].gap)[1]
        for node in reversed(path):
            assert node.choices is not None
            node.high = min(node.high, max(self._worth(choice, "high") for choice in node.choices))
            node.low = max(node.low, max(self._worth(choice, "low") for choice in node.choices))

    def _worth(self, choice: tuple[Fraction, list[tuple[Fraction, _Node]]], end: str) -> Fraction:
        paid, after = choice
        return paid + self.numbers.discount * sum((p * getattr(n, end) for p, n in after), Fraction(0))

    def _choice(self, node: _Node, action: int) -> tuple[Fraction, list[tuple[Fraction, _Node]]]:
        """What an action pays on average, and the beliefs that it leads to with their probabilities."""
        numbers, t = self.numbers, node.t
        total, paid = sum(w for _, w in node.belief), 0
        after: dict[int, int] = defaultdict(int)
        reward = numbers.rewards(t)
        for state, weight in node.belief:
            row = action * numbers.model.n_states + state
            paid += weight * reward.parts[row]
            for column, chance in numbers.goes_on(t, row):
                after[column] += weight * chance
            self.spent += 1 + len(after)
        whole = total * numbers.unit(t)
        parts = self._parts(t + 1, after) if t + 1 < numbers.horizon else []
        return Fraction(paid, total * reward.over), [(Fraction(w, whole), self._node(t + 1, b)) for w, b in parts]

    def _parts(self, t: int, weights: dict[int, int]) -> list[tuple[int, Belief]]:
        """Weighted states by what is seen of them: the total weight of each part, and the belief that it is."""
        look, parts = at(self.seen, t), defaultdict[int, list[tuple[int, int]]](list)
        for state, weight in sorted(weights.items()):
            if weight:
                parts[int(look[state])].append((state, weight))
        found = []
        for part in parts.values():
            divisor = gcd(*(weight for _, weight in part))
            found.append((sum(w for _, w in part), tuple((state, weight // divisor) for state, weight in part)))
        return found

    def _node(self, t: int, belief: Belief) -> _Node:
        if (t, belief) not in self.nodes:
            low = max(_expected(values[t], belief) for values in self.constant)
            self.nodes[t, belief] = _Node(t, belief, low, _expected(self.knowing[t], belief))
        return self.nodes[t, belief]


def _expected(values: Scaled, belief: Belief) -> Fraction:
    total = sum(weight for _, weight in belief)
    return Fraction(sum(weight * values.parts[state] for state, weight in belief), total * values.over)


def _vectors(numbers: Rational) -> tuple[list[Scaled], list[list[Scaled]]]:
    """Values (S,) from each time on: of knowing the state, and of each action taken for ever."""
    knowing, constant = [numbers.zero()], [[numbers.zero()] for _ in range(numbers.model.n_actions)]
    for t in range(numbers.horizon - 1, -1, -1):
        knowing.append(numbers.top(numbers.backup(t, knowing[-1])))
        for action, values in enumerate(constant):
            q = numbers.backup(t, values[-1])
            values.append(Scaled(q.parts[action], q.over).reduced())
    return knowing[::-1], [values[::-1] for values in constant]
