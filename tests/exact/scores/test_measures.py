"""Gaps, constant actions, rewards of states and coverage, beside small tasks written out in fractions and worked out by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from taskspec.base.limits import also
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.returns import Results
from tests.shared.written_out import TABLES, Table, best_from


def written(table: Table, folder: Path) -> Path:
    path = folder / "random.yaml"
    path.write_text(table.spec(), encoding="utf-8")
    return path


def visited(table: Table) -> dict[tuple[int, int], Fraction]:
    """How likely random actions act in a state at a time."""
    found: dict[tuple[int, int], Fraction] = {}
    for p, steps in table.episodes():
        for t, (state, *_) in enumerate(steps):
            found[t, state] = found.get((t, state), Fraction(0)) + p
    return found


def optimal_value(table: Table, t: int, state: int, action: int) -> Fraction:
    return sum(
        (p * (table.pays[state, action, n] + table.discount * best_from(table, n, t + 1))
         for n, p in table.leads[state, action].items()), Fraction(0),
    )  # fmt: skip


@pytest.mark.parametrize("table", TABLES)
def test_gaps_are_those_of_all_actions_that_are_not_optimal(table: Table, tmp_path: Path) -> None:
    gaps = []
    for t, state in visited(table):
        q = [optimal_value(table, t, state, action) for action in range(table.actions)]
        gaps += [max(q) - value for value in q if value < max(q)]
    found = difficulty(written(table, tmp_path), ["smallest_gap", "inverse_gaps"])
    if not gaps:
        assert found.why_not["smallest_gap"] == "every action is optimal"
        return
    assert found["smallest_gap"] == pytest.approx(float(min(gaps)))
    assert found["inverse_gaps"] == pytest.approx(float(sum(1 / gap for gap in gaps)))


def at_start(table: Table, policy: dict[tuple[int, int], int]) -> Fraction:
    return sum((p * table.expected(policy, state) for state, p in table.start.items()), Fraction(0))


def random_value(table: Table, state: int, t: int = 0) -> Fraction:
    """The return of random actions from a state."""
    if t == table.horizon or (t and state in table.ends):
        return Fraction(0)
    return sum((random_action_value(table, t, state, a) for a in range(table.actions)), Fraction(0)) / table.actions


def random_action_value(table: Table, t: int, state: int, action: int) -> Fraction:
    return sum(
        (p * (table.pays[state, action, n] + table.discount * random_value(table, n, t + 1))
         for n, p in table.leads[state, action].items()), Fraction(0),
    )  # fmt: skip


def score(table: Table, value: Fraction) -> float | None:
    random = sum((p * random_value(table, s) for s, p in table.start.items()), Fraction(0))
    best = sum((p * best_from(table, s) for s, p in table.start.items()), Fraction(0))
    if best == random:
        return None
    return float((value - random) / (best - random))


@pytest.mark.parametrize("table", TABLES)
def test_the_best_constant_action_is_the_best_of_all(table: Table, tmp_path: Path) -> None:
    places = list(product(range(table.horizon), range(table.states)))
    best = max(at_start(table, dict.fromkeys(places, action)) for action in range(table.actions))
    found = difficulty(written(table, tmp_path), ["best_constant"])
    assert found["best_constant"] == (None if score(table, best) is None else pytest.approx(score(table, best)))


def advantages(table: Table) -> Iterator[float]:
    for t, state in sorted(visited(table)):
        q = [random_action_value(table, t, state, action) for action in range(table.actions)]
        for value in q:
            yield float(value - sum(q) / len(q))


def of_state(table: Table, rewards: dict[int, Fraction]) -> Table:
    """The table with a reward of the next state alone."""
    return replace(table, pays={key: rewards.get(key[2], Fraction(0)) for key in table.pays})  # type: ignore[misc]


@pytest.mark.parametrize("table", TABLES)
def test_the_nearest_reward_of_states_is_that_of_least_squares(table: Table, tmp_path: Path) -> None:
    columns = [list(advantages(of_state(table, {state: Fraction(1)}))) for state in range(table.states)]
    nearest = np.linalg.lstsq(np.array(columns).T, np.array(list(advantages(table))), rcond=1e-9)[0]
    simple = of_state(table, {s: Fraction(float(x)).limit_denominator(10**6) for s, x in enumerate(nearest)})

    def value(state: int, t: int = 0) -> Fraction:
        """The true return of the optimal policy for the simple reward, which takes tied actions equally often."""
        if t == table.horizon or (t and state in table.ends):
            return Fraction(0)
        q = [optimal_value(simple, t, state, a) for a in range(table.actions)]
        tied = [a for a in range(table.actions) if q[a] >= max(q) - Fraction(1, 10**5)]
        total = Fraction(0)
        for a in tied:
            for n, p in table.leads[state, a].items():
                total += p * (table.pays[state, a, n] + table.discount * value(n, t + 1))
        return total / len(tied)

    wanted = score(table, sum((p * value(s) for s, p in table.start.items()), Fraction(0)))
    found = difficulty(written(table, tmp_path), ["best_state_reward"])["best_state_reward"]
    assert found == (None if wanted is None else pytest.approx(wanted, abs=1e-9))


BANDIT = """
taskspec: 1
name: Bandit
state:
  s: {type: int, low: 0, high: LAST}
action:
  a: {type: int, low: 0, high: 2}
initial:
  s: 0
dynamics:
  s': NEXT
horizon: 3
reward: a == 1
"""


@pytest.mark.parametrize(("after", "expected"), [("0", 0), ("a", 1)])
def test_rewards_of_states_succeed_where_states_show_the_action(after: str, expected: float, tmp_path: Path) -> None:
    path = tmp_path / "bandit.yaml"
    path.write_text(BANDIT.replace("NEXT", after).replace("LAST", "0" if after == "0" else "2"), encoding="utf-8")
    assert difficulty(path, ["best_state_reward"])["best_state_reward"] == pytest.approx(expected)


@pytest.mark.parametrize("table", TABLES)
def test_coverage_is_the_overlap_of_visits_of_optimal_and_random_actions(table: Table, tmp_path: Path) -> None:
    optimal = dict.fromkeys(range(table.states), Fraction(0))
    random = dict.fromkeys(range(table.states), Fraction(0))
    for (t, state), p in visited(table).items():
        random[state] += p * table.discount**t
    now = dict(table.start)
    for t in range(table.horizon):
        after: dict[int, Fraction] = {}
        for state, p in now.items():
            optimal[state] += p * table.discount**t
            q = [optimal_value(table, t, state, a) for a in range(table.actions)]
            tied = [a for a in range(table.actions) if q[a] == max(q)]
            for n, share in (led for a in tied for led in table.leads[state, a].items()):
                if n not in table.ends:
                    after[n] = after.get(n, Fraction(0)) + p * share / len(tied)
        now = after
    overlap = sum(
        min(optimal[s] / sum(optimal.values()), random[s] / sum(random.values())) for s in range(table.states)
    )
    assert difficulty(written(table, tmp_path), ["coverage"])["coverage"] == pytest.approx(float(overlap))


def test_an_expert_that_starts_elsewhere_covers_nothing() -> None:
    found = {name: difficulty(name, ["coverage"])["coverage"] for name in ("InitShiftLearner", "InitShiftExpert")}
    assert found == {"InitShiftLearner": 0, "InitShiftExpert": 0}


def test_what_would_take_too_long_is_not_begun() -> None:
    names = ["best_constant", "best_state_reward"]
    results = Results("Taxi")
    assert results.optimal is not None and results.random is not None
    with also("seconds=0"):
        found = difficulty(results, names)
    assert "constant actions" in found.why_not["best_constant"]
    assert "rewards of all states" in found.why_not["best_state_reward"]
