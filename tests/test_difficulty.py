"""Measures of difficulty, beside every episode of small tasks written out one by one, and beside closed forms."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import exact, limits, load
from taskspec.diagnostics import SpecError
from taskspec.exact.difficulty import MEASURES, difficulty

HALF = Fraction(1, 2)


# -- every episode, written out ------------------------------------------------------------------------------------


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

    def spec(self) -> str:
        labels = [f"q{s}" for s in range(self.states)]

        def chances(found: dict[int, Fraction]) -> str:
            return "{" + ", ".join(f"q{s}: {p}" for s, p in found.items()) + "}"

        leads = "".join(
            f"      q{s}: {{{', '.join(f'a{a}: {chances(self.leads[s, a])}' for a in range(self.actions))}}}\n"
            for s in range(self.states)
        )
        pays = "".join(
            f"    q{s}:\n"
            + "".join(
                f"      a{a}: {{{', '.join(f'q{n}: {self.pays[s, a, n]}' for n in range(self.states))}}}\n"
                for a in range(self.actions)
            )
            for s in range(self.states)
        )
        ends = " or ".join(f"s' == q{s}" for s in sorted(self.ends)) or "false"
        return (
            f"taskspec: 1\nname: Random\nstate:\n  s: {{type: choice, values: [{', '.join(labels)}]}}\n"
            f"action:\n  a: {{type: choice, values: [{', '.join(f'a{a}' for a in range(self.actions))}]}}\n"
            f"horizon: {self.horizon}\ndiscount: {self.discount}\ninitial:\n  s: {chances(self.start)}\n"
            f"dynamics:\n  s':\n    by: [s, a]\n    rows:\n{leads}"
            f"reward:\n  by: [s, a, s']\n  rows:\n{pays}terminal: {ends}\n"
        )

    def episodes(self) -> Iterator[tuple[Fraction, list[tuple[int, int, int, int]]]]:
        """Every episode of random actions: its probability, and its steps (state, action, next state, reward)."""
        for state, p in self.start.items():
            yield from self._going_on(state, p, [])

    def _going_on(self, state: int, p: Fraction, steps: list[Any]) -> Iterator[tuple[Fraction, list[Any]]]:
        if len(steps) == self.horizon or (steps and state in self.ends):
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
        return sum((self.discount**t * step[3] for t, step in enumerate(steps)), Fraction(0))

    def expected(self, policy: dict[tuple[int, int], int], state: int, t: int = 0) -> Fraction:
        """The return of a policy from a state."""
        total = Fraction(0)
        for after, p in self.leads[state, policy[t, state]].items():
            total += p * self.pays[state, policy[t, state], after]
            if t + 1 < self.horizon and after not in self.ends:
                total += p * self.discount * self.expected(policy, after, t + 1)
        return total


def tables() -> Iterator[Table]:
    rng = np.random.default_rng(3)
    for i in range(12):
        states, actions, horizon = (3, 2, 3) if i % 2 else (2, 2, 4)
        pairs = list(product(range(states), range(actions)))
        leads = {pair: somewhere(rng, states) for pair in pairs}
        rewards = rng.integers(-1, 3, (states, actions, states)) * rng.integers(2, size=(states, actions, states))
        pays = {(s, a, n): int(rewards[s, a, n]) for (s, a), n in product(pairs, range(states))}
        start = {0: Fraction(1)} if i % 3 else {0: Fraction(1, 3), 1: Fraction(2, 3)}
        ends = frozenset({states - 1}) if i % 4 >= 2 else frozenset()
        yield Table(states, actions, horizon, (Fraction(1), HALF)[i % 5 == 0], start, leads, pays, ends)


def somewhere(rng: np.random.Generator, states: int) -> dict[int, Fraction]:
    """One next state, or two with unequal odds."""
    places = [int(place) for place in rng.permutation(states)]
    return {places[0]: Fraction(1)} if rng.integers(2) else {places[0]: Fraction(1, 4), places[1]: Fraction(3, 4)}


TABLES = list(tables())


@pytest.fixture(params=range(len(TABLES)))
def written_out(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Table, exact.Results]:
    table = TABLES[request.param]
    path = tmp_path / "random.yaml"
    path.write_text(table.spec(), encoding="utf-8")
    return table, exact.Results(load(path))


def best_from(table: Table, state: int, t: int = 0) -> Fraction:
    """The optimal return from a state, by going through what every action leads to."""
    if t == table.horizon or (t and state in table.ends):
        return Fraction(0)
    return max(
        sum((p * (table.pays[state, a, n] + table.discount * best_from(table, n, t + 1))
             for n, p in table.leads[state, a].items()), Fraction(0))
        for a in range(table.actions)
    )  # fmt: skip


def test_luck_and_lengths_are_those_of_every_episode(written_out: tuple[Table, exact.Results]) -> None:
    table, results = written_out
    best = paid = length = Fraction(0)
    for p, steps in table.episodes():
        best += p * (table.returned(steps) >= best_from(table, steps[0][0]))
        paid += p * any(step[3] for step in steps)
        length += p * len(steps)
    found = difficulty(results, ["best_at_random", "episodes_to_reward", "random_length"])
    assert found["best_at_random"] == pytest.approx(float(best), abs=1e-12)
    assert found["random_length"] == pytest.approx(float(length))
    assert found["episodes_to_reward"] == (pytest.approx(float(1 / paid)) if paid else None)


def done_after(table: Table, state: int, t: int) -> bool:
    """Whether no action ever pays any more."""
    if t == table.horizon or (t and state in table.ends):
        return True
    return all(
        table.pays[state, a, n] == 0 and done_after(table, n, t + 1)
        for a in range(table.actions) for n in table.leads[state, a]
    )  # fmt: skip


def steps_of(table: Table, policy: dict[tuple[int, int], int], state: int, t: int = 0) -> Fraction:
    """The expected steps of a policy until nothing pays any more."""
    if done_after(table, state, t):
        return Fraction(0)
    leads = table.leads[state, policy[t, state]]
    return 1 + sum((p * steps_of(table, policy, n, t + 1) for n, p in leads.items()), Fraction(0))


def test_the_solution_is_the_shortest_of_all_optimal_policies(written_out: tuple[Table, exact.Results]) -> None:
    table, results = written_out

    def total(function: Any, policy: Any) -> Fraction:
        return sum((p * function(table, policy, s) for s, p in table.start.items()), Fraction(0))

    returns = [(total(Table.expected, policy), policy) for policy in table.policies()]
    top = max(value for value, _ in returns)
    shortest = min(total(steps_of, policy) for value, policy in returns if value == top)
    assert difficulty(results, ["solution_length"])["solution_length"] == pytest.approx(float(shortest))


# -- closed forms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "actions"), [(1, 2), (3, 5), (10, 2), (30, 3)])
def test_branching_is_found_by_luck_as_its_page_says(length: int, actions: int) -> None:
    found = difficulty(load("derail/Branching", L=length, B=actions))
    assert found["best_at_random"] == pytest.approx(actions**-length)
    assert found["episodes_to_reward"] == pytest.approx(actions**length)
    assert found["solution_length"] == found["random_length"] == length
    assert (found["states"], found["actions"]) == (1 + length * actions, actions)


def test_risky_path_by_hand() -> None:
    found = difficulty("derail/RiskyPath")
    # At the start: the detour and then its first action, which is optimal; or the shortcut, which is luckier than that.
    assert found["best_at_random"] == pytest.approx(1 / 4 + 1 / 4)
    # Never paid: the detour, in which all four further actions are the wrong one.
    assert found["episodes_to_reward"] == pytest.approx(1 / (1 - 1 / 2**5))
    results = exact.Results("derail/RiskyPath")
    soft = exact.score("derail/RiskyPath", soft_table()).value.value
    assert results.random is not None
    assert found["soft_gap"] == pytest.approx((4 - soft) / (4 - results.random.value))


def soft_table() -> np.ndarray[Any, Any]:
    """The soft-optimal policy of RiskyPath (T, A, S), by hand."""
    value, tables = np.zeros(4), []
    for _ in range(5):
        goal, trap = 1 + value[2], value[3] - 100
        q = np.array([[value[1], goal, goal, trap], [(goal + trap) / 2, value[1], goal, trap]])
        value = np.logaddexp(q[0], q[1])
        tables.insert(0, np.exp(q - value))
    return np.array(tables)


WAIT = """
taskspec: 1
name: Wait
state:
  s: {type: int, low: 0, high: 3}
action:
  a: {type: choice, values: [stay, go]}
initial:
  s: 0
dynamics:
  s': s + (a == go)
horizon: none
reward: "s' == 3"
terminal: s' == 3
"""


def test_without_a_horizon_lengths_are_those_of_waiting(tmp_path: Path) -> None:
    path = tmp_path / "wait.yaml"
    path.write_text(WAIT, encoding="utf-8")
    found = difficulty(path)
    assert found["random_length"] == pytest.approx(6)  # three times a coin is thrown until heads
    assert found["solution_length"] == pytest.approx(3)
    assert found["episodes_to_reward"] == pytest.approx(1)
    assert found["best_at_random"] is None
    assert "horizon" in found.why_not["best_at_random"]


# -- as a mapping, and what is said ----------------------------------------------------------------------------------


def test_every_measure_has_a_value_or_a_reason_on_every_task() -> None:
    for name in ("RiskyPath", "EarlyTermPos", "LargestSum", "Parabola"):
        found = difficulty(f"derail/{name}")
        assert list(found) == list(MEASURES)
        for measure, value in found.items():
            assert (value is None) == (measure in found.why_not)
            assert value is None or math.isfinite(value)
        assert json.loads(json.dumps(found.record())) == found.record()
        assert all(name in found._repr_html_() for name in MEASURES)


def test_names_choose_measures() -> None:
    assert list(difficulty("derail/RiskyPath", ["states", "soft_gap"])) == ["states", "soft_gap"]
    with pytest.raises(SpecError, match=r"E713.*there is no measure 'state'"):
        difficulty("derail/RiskyPath", ["state"])


@pytest.mark.parametrize("name", MEASURES)
def test_measures_say_what_they_are(name: str) -> None:
    measure = MEASURES[name]
    assert measure.name == name
    assert measure.doc.endswith(".") and measure.formula


def test_measures_that_take_too_long_are_not_begun() -> None:
    results = exact.Results("derail/ProcGoal")
    assert results.model is not None
    with limits.also("seconds=0"):
        found = difficulty(results, ["best_at_random", "episodes_to_reward", "random_length"])
    assert found["random_length"] == 30
    for name in ("best_at_random", "episodes_to_reward"):
        assert found[name] is None
        assert "outcomes" in found.why_not[name]
