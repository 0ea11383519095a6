"""Returns, probabilities and preferences of small decision processes by brute force, in fractions.

With a horizon by backward induction; without one by solving the equations of every deterministic policy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

from tests.verification.proofs.process import Key, Process, Shares

Value = Fraction | float
"""A rational, or an infinity where an episode that never ends is paid for ever."""
Values = dict[Key, Value]
Gains = list[Value]
Graph = dict[Key, dict[Key, Fraction]]
"""Probabilities of going on, by the state left and the state reached."""
ALIKE = Fraction(1, 10**8)
"""Shares closer than this may count as alike."""


class Unsettled(Exception):
    """There is no such number: episodes never end, and are paid now this and now that."""


@dataclass(frozen=True)
class Rule:
    """A way to choose actions: what it makes of the worth of each, and which share each then has.

    `worth` reduces the gains (A,) of actions to the value that the rule plans with; None: shares do not depend on them.
    """

    text: str
    share: Callable[[Key, int, Gains], Shares]
    worth: Callable[[Gains], Value] | None = None
    shift: Fraction = Fraction(0)


def uniform(actions: int) -> Rule:
    return Rule("uniform", lambda key, t, gains: {a: Fraction(1, actions) for a in range(actions)})


def greedy(text: str = "optimal", shift: Fraction = Fraction(0)) -> Rule:
    """All best actions alike, for the reward plus a constant."""

    def share(key: Key, t: int, gains: Gains) -> Shares:
        best = [a for a, g in enumerate(gains) if g == max(gains)]
        return {a: Fraction(1, len(best)) for a in best}

    return Rule(text, share, max, shift)


def expert(process: Process) -> Rule:
    assert process.expert is not None
    choose = process.expert
    return Rule("expert", lambda key, t, gains: choose(key, t))


@dataclass
class Solved:
    """What is asked of one process; values are kept."""

    process: Process
    _known: dict[Any, Any] = field(default_factory=dict)

    def kept(self, rule: Rule) -> Rule:
        """The rule of this name that was made first, so that what was worked out for it is used again."""
        found: Rule = self._known.setdefault(("rule", rule.text), rule)
        return found

    # -- returns ------------------------------------------------------------------------------------------------------

    @cached_property
    def returns(self) -> dict[str, Fraction]:
        """By the names that claims have for them; those that do not exist are left out."""
        asked: dict[str, Callable[[], Value]] = {
            "optimal_return": lambda: self.extreme(max),
            "worst_return": lambda: self.extreme(min),
            "random_return": lambda: self.value(uniform(self.process.actions)),
        }
        if self.process.expert is not None:
            asked["expert_return"] = lambda: self.value(expert(self.process))
        found = {}
        for name, compute in asked.items():
            with suppress(Unsettled):
                found[name] = compute()
        return {name: value for name, value in found.items() if isinstance(value, Fraction)}

    def extreme(self, pick: Callable[..., Any]) -> Value:
        return self._at_start(self._planned(0, pick, Fraction(0)))

    def value(self, rule: Rule) -> Value:
        if self.process.horizon is None:
            return self._at_start(self._lasting({k: self.shares(rule, k, 0) for k in self.process.states}))
        values: Values = {}
        for t in range(self.process.horizon - 1, -1, -1):
            values = {
                k: mean(self.shares(rule, k, t), self._gains(k, t, values, Fraction(0))) for k in self._layers()[t]
            }
        return self._at_start(values)

    def _at_start(self, values: Values) -> Value:
        return sum((p * values[k] for k, p in self.process.start.items()), Fraction(0))

    def shares(self, rule: Rule, key: Key, t: int) -> Shares:
        if rule.worth is None:
            return rule.share(key, t, [])
        later = self._planned(t + 1, rule.worth, rule.shift)
        if any(isinstance(v, float) for v in later.values()):
            raise Unsettled
        return rule.share(key, t, self._gains(key, t, later, rule.shift))

    def _gains(self, key: Key, t: int, later: Values, shift: Fraction) -> Gains:
        return [self._gain(key, a, t, later, shift) for a in range(self.process.actions)]

    def _gain(self, key: Key, action: int, t: int, later: Values, shift: Fraction) -> Value:
        total: Value = shift
        for o in self.process.row(key, action, t):
            after = Fraction(0) if o.terminated else self.process.discount * later.get(o.state, Fraction(0))
            total += o.probability * (o.reward + after)
        return total

    def _planned(self, t: int, worth: Callable[..., Any], shift: Fraction) -> Values:
        """The values that a rule plans with at a time."""
        horizon = self.process.horizon
        known = self._known.setdefault(("planned", worth, shift), {})
        if horizon is None:
            if not known:
                known[0] = self._settled(worth, shift)
            found: Values = known[0]
            return found
        for at in range(horizon, t - 1, -1):
            if at not in known:
                layer = self._layers()[at] if at < horizon else []
                known[at] = {k: worth(self._gains(k, at, known[at + 1], shift)) for k in layer}
        return known[t] if t <= horizon else {}

    def _layers(self) -> list[list[Key]]:
        if "layers" not in self._known:
            found = list(self.process.layers())
            missing = (self.process.horizon or 0) - len(found)
            self._known["layers"] = found + [[]] * missing
        layers: list[list[Key]] = self._known["layers"]
        return layers

    # -- without a horizon --------------------------------------------------------------------------------------------

    def _settled(self, worth: Callable[..., Any], shift: Fraction) -> Values:
        """The best, or worst, values of all deterministic policies."""
        states = self.process.acting()
        found = {}
        for choice in itertools.product(range(self.process.actions), repeat=len(states)):
            policy = {k: {a: Fraction(1)} for k, a in zip(states, choice, strict=True)}
            for k, v in self._lasting(policy, shift).items():
                found[k] = worth([found[k], v]) if k in found else v
        return found

    def _lasting(self, policy: dict[Key, Shares], shift: Fraction = Fraction(0)) -> Values:
        """The values of a policy that never changes."""
        states = self.process.acting()
        gamma = self.process.discount
        chain = {k: self._chain(k, policy[k]) for k in states}
        paid: dict[Key, Any] = {k: mean(policy[k], self._gains(k, 0, {}, shift)) for k in states}
        if gamma < 1:
            return solved(states, {k: {j: gamma * p for j, p in row.items()} for k, row in chain.items()}, paid)
        return self._total(states, chain, paid)

    def _total(self, states: list[Key], chain: Graph, paid: Values) -> Values:
        """Sums of rewards without a discount: episodes end, or stay in a class of states for ever."""
        ends = {k for k in states if sum(chain[k].values()) < 1}
        reached = {k: seen(chain, k) for k in states}
        closed = {k for k in states if not reached[k] & ends and all(k in reached[j] for j in reached[k])}
        values: Values = {k: eternal([paid[j] for j in reached[k]]) for k in closed}
        for k in set(states) - closed:
            signs = {v for j in reached[k] & closed if isinstance(v := values[j], float)}
            if len(signs) > 1:
                raise Unsettled
            if signs:
                values[k] = signs.pop()
        calm = [k for k in states if k not in values]
        return values | solved(calm, {k: {j: p for j, p in chain[k].items() if j in calm} for k in calm}, paid)

    def _chain(self, key: Key, shares: Shares) -> dict[Key, Fraction]:
        found: dict[Key, Fraction] = {}
        for a, share in shares.items():
            for o in self.process.row(key, a, 0):
                if not o.terminated:
                    found[o.state] = found.get(o.state, Fraction(0)) + share * o.probability
        return found

    # -- probabilities and preferences --------------------------------------------------------------------------------

    def probability(self, rule: Rule, inside: Callable[[Key], bool]) -> Fraction:
        """How likely an episode is ever in such a state, its last one included."""
        if self.process.horizon is None:
            return self._ever(rule, inside)
        later: dict[Key, Fraction] = {}
        for t in range(self.process.horizon - 1, -1, -1):
            later = {k: self._reached(rule, inside, k, t, later) for k in self._layers()[t]}
        return sum((p * (Fraction(1) if inside(k) else later[k]) for k, p in self.process.start.items()), Fraction(0))

    def _reached(
        self, rule: Rule, inside: Callable[[Key], bool], key: Key, t: int, later: dict[Key, Fraction]
    ) -> Fraction:
        total = Fraction(0)
        for a, share in self.shares(rule, key, t).items():
            for o in self.process.row(key, a, t):
                hit = inside(o.state)
                after = Fraction(0) if o.terminated else later.get(o.state, Fraction(0))
                total += share * o.probability * (1 if hit else after)
        return total

    def _ever(self, rule: Rule, inside: Callable[[Key], bool]) -> Fraction:
        states = self.process.acting()
        shares = {k: self.shares(rule, k, 0) for k in states}
        chain = {k: self._chain(k, shares[k]) for k in states}
        at_once = {k: self._reached(rule, inside, k, 0, {}) for k in states}
        open_ = [k for k in leading(chain, {k for k in states if at_once[k]}) if not inside(k)]
        found = solved(open_, {k: {j: p for j, p in chain[k].items() if j in open_} for k in open_}, at_once)
        certain = {k: Fraction(1) for k in self.process.start if inside(k)}
        return Fraction(sum(p * (found | certain).get(k, Fraction(0)) for k, p in self.process.start.items()))

    def prefers(self, rule: Rule, wanted: set[int], at: Callable[[Key], bool]) -> bool:
        """Whether the most frequent actions are wanted ones, as the language reference says it."""
        asked: dict[Key, bool] = {}
        for t, layer in enumerate(self._layers() if self.process.horizon is not None else [self.process.acting()]):
            for k in filter(at, layer):
                shares = self.shares(rule, k, t)
                good = most(shares, wanted)
                bad = most(shares, set(range(self.process.actions)) - wanted)
                if 0 < abs(good - bad) < ALIKE:
                    raise Unsettled
                if good < bad:
                    return False
                asked[k] = asked.get(k, False) or good > bad
        return bool(asked) and all(asked.values())


def most(shares: Shares, among: set[int]) -> Fraction:
    """The largest share among some actions; below 0 where there are none."""
    return max((shares.get(a, Fraction(0)) for a in among), default=Fraction(-1))


def mean(shares: Shares, gains: Gains) -> Value:
    return sum((p * gains[a] for a, p in shares.items()), Fraction(0))


def eternal(paid: list[Value]) -> Value:
    """What it is worth to be paid these for ever."""
    signs = {x > 0 for x in paid if x}
    if len(signs) > 1:
        raise Unsettled
    return Fraction(0) if not signs else math.inf if signs.pop() else -math.inf


def seen(chain: Graph, start: Key) -> set[Key]:
    """The states that can be reached, the first included."""
    found = {start}
    todo = [start]
    while todo:
        new = set(chain[todo.pop()]) - found
        found |= new
        todo += new
    return found


def leading(chain: Graph, to: set[Key]) -> set[Key]:
    return {k for k in chain if seen(chain, k) & to}


def solved(states: list[Key], chain: Graph, paid: Any) -> dict[Key, Fraction]:
    """x = paid + chain x, by elimination."""
    n = len(states)
    table = [[Fraction(i == j) - chain[a].get(b, Fraction(0)) for j, b in enumerate(states)] + [paid[a]]
             for i, a in enumerate(states)]  # fmt: skip
    for i in range(n):
        pivot = next(r for r in range(i, n) if table[r][i])
        table[i], table[pivot] = table[pivot], table[i]
        table[i] = [x / table[i][i] for x in table[i]]
        for r in range(n):
            if r != i and table[r][i]:
                table[r] = [x - table[r][i] * y for x, y in zip(table[r], table[i], strict=True)]
    return {k: table[i][n] for i, k in enumerate(states)}
