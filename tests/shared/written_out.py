"""Small random tasks in fractions, whose every episode and every policy can be written out: no code of ours plans here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from taskspec.language.task.task import Task
from tests.shared.sections import build_text

HALF = Fraction(1, 2)
Value = Callable[[int, int], Fraction]
"""Of a state and a time."""


@dataclass(frozen=True)
class Table:
    """A random task of S states and A actions in fractions: where each action leads, what that pays, and where it ends."""

    states: int
    actions: int
    horizon: int
    discount: Fraction
    start: dict[int, Fraction]
    leads: dict[tuple[int, int], dict[int, Fraction]]
    pays: dict[tuple[int, int, int], int]
    ends: frozenset[int]

    def spec(self, seen: str = "") -> str:
        leads = ""
        pays = ""
        for s in range(self.states):
            leads += f"      q{s}:\n"
            pays += f"    q{s}:\n"
            for a in range(self.actions):
                leads += f"        a{a}: {_written(self.leads[s, a])}\n"
                pays += f"      a{a}: {_written({n: self.pays[s, a, n] for n in range(self.states)})}\n"
        ends = " or ".join(f"s' == q{s}" for s in sorted(self.ends)) or "false"
        return (
            f"state:\n  s: {{type: choice, values: [{_names('q', self.states)}]}}\n"
            f"action:\n  a: {{type: choice, values: [{_names('a', self.actions)}]}}\n"
            f"horizon: {self.horizon}\ndiscount: {self.discount}\ninitial:\n  s: {_written(self.start)}\n"
            f"dynamics:\n  s':\n    by: [s, a]\n    rows:\n{leads}"
            f"reward:\n  by: [s, a, s']\n  rows:\n{pays}terminal: {ends}\n{seen}"
        )

    def task(self, seen: str = "") -> Task:
        return build_text(self.spec(seen))

    def is_over(self, state: int, t: int) -> bool:
        return t == self.horizon or (t > 0 and state in self.ends)

    def episodes(self) -> Iterator[tuple[Fraction, list[tuple[int, int, int, int]]]]:
        """Every episode of random actions: its probability, and its steps (state, action, next state, reward)."""
        for state, p in self.start.items():
            yield from self._going_on(state, p, [])

    def _going_on(self, state: int, p: Fraction, steps: list[Any]) -> Iterator[tuple[Fraction, list[Any]]]:
        if self.is_over(state, len(steps)):
            yield p, steps
            return
        for action in range(self.actions):
            for after, chance in self.leads[state, action].items():
                step = (state, action, after, self.pays[state, action, after])
                yield from self._going_on(after, p * chance / self.actions, [*steps, step])

    def policies(self) -> Iterator[dict[tuple[int, int], int]]:
        """Every deterministic policy: an action for each time and state."""
        places = list(product(range(self.horizon), range(self.states)))
        for choice in product(range(self.actions), repeat=len(places)):
            yield dict(zip(places, choice, strict=True))

    def returned(self, steps: list[tuple[int, int, int, int]]) -> Fraction:
        total = Fraction(0)
        for t, (_, _, _, reward) in enumerate(steps):
            total += self.discount**t * reward
        return total

    def action_value(self, state: int, t: int, action: int, value: Value) -> Fraction:
        """The expected reward of an action, and the value after it."""
        total = Fraction(0)
        for after, p in self.leads[state, action].items():
            total += p * (self.pays[state, action, after] + self.discount * value(after, t + 1))
        return total

    def action_values(self, state: int, t: int, value: Value) -> list[Fraction]:
        return [self.action_value(state, t, action, value) for action in range(self.actions)]

    def expected(self, policy: dict[tuple[int, int], int], state: int, t: int = 0) -> Fraction:
        """The return of a policy from a state."""
        if self.is_over(state, t):
            return Fraction(0)
        return self.action_value(state, t, policy[t, state], partial(self.expected, policy))

    def best(self, state: int, t: int = 0) -> Fraction:
        """The optimal return from a state."""
        if self.is_over(state, t):
            return Fraction(0)
        return max(self.action_values(state, t, self.best))

    def random(self, state: int, t: int = 0) -> Fraction:
        """The return of random actions from a state."""
        if self.is_over(state, t):
            return Fraction(0)
        return sum(self.action_values(state, t, self.random), Fraction(0)) / self.actions

    def at_start(self, value: Value) -> Fraction:
        total = Fraction(0)
        for state, p in self.start.items():
            total += p * value(state, 0)
        return total


def _names(letter: str, count: int) -> str:
    return ", ".join(f"{letter}{i}" for i in range(count))


def _written(values: Mapping[int, Fraction | int]) -> str:
    """A row of a table in YAML, by state."""
    return "{" + ", ".join(f"q{s}: {value}" for s, value in values.items()) + "}"


def tables() -> Iterator[Table]:
    rng = np.random.default_rng(3)
    for i in range(12):
        states, actions, horizon = (3, 2, 3) if i % 2 else (2, 2, 4)
        leads = {pair: somewhere(rng, states) for pair in product(range(states), range(actions))}
        rewards = rng.integers(-1, 3, (states, actions, states)) * rng.integers(2, size=(states, actions, states))
        pays = {(s, a, n): int(reward) for (s, a, n), reward in np.ndenumerate(rewards)}
        start = {0: Fraction(1)} if i % 3 else {0: Fraction(1, 3), 1: Fraction(2, 3)}
        ends = frozenset({states - 1}) if i % 4 >= 2 else frozenset()
        yield Table(states, actions, horizon, (Fraction(1), HALF)[i % 5 == 0], start, leads, pays, ends)


def somewhere(rng: np.random.Generator, states: int) -> dict[int, Fraction]:
    """One next state, or two with unequal odds."""
    first, second = rng.permutation(states)[:2].tolist()
    return {first: Fraction(1)} if rng.integers(2) else {first: Fraction(1, 4), second: Fraction(3, 4)}


TABLES = list(tables())
