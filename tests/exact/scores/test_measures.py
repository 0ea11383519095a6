"""Gaps, constant actions, rewards of states and coverage, beside small tasks written out in fractions and worked out by hand."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec.exact.scores.difficulty import difficulty
from tests.shared.sections import build_text
from tests.shared.written_out import TABLES, Table


def visited(table: Table) -> dict[tuple[int, int], Fraction]:
    """How likely random actions act in a state at a time."""
    found: dict[tuple[int, int], Fraction] = {}
    for p, steps in table.episodes():
        for t, (state, *_) in enumerate(steps):
            found[t, state] = found.get((t, state), Fraction(0)) + p
    return found


@pytest.mark.parametrize("table", TABLES)
def test_gaps_are_those_of_all_actions_that_are_not_optimal(table: Table) -> None:
    gaps = []
    for t, state in visited(table):
        q = table.action_values(state, t, table.best)
        gaps += [max(q) - value for value in q if value < max(q)]
    found = difficulty(table.task(), ["smallest_gap", "inverse_gaps"])
    if not gaps:
        assert found.why_not["smallest_gap"] == "every action is optimal"
        return
    assert found["smallest_gap"] == pytest.approx(float(min(gaps)))
    assert found["inverse_gaps"] == pytest.approx((1 / np.array(gaps, float)).sum())


def score(table: Table, value: Fraction) -> Any:
    """The score of a return, approximately; None where all returns are alike."""
    random = table.at_start(table.random)
    best = table.at_start(table.best)
    if best == random:
        return None
    return pytest.approx(float((value - random) / (best - random)), abs=1e-9)


@pytest.mark.parametrize("table", TABLES)
def test_the_best_constant_action_is_the_best_of_all(table: Table) -> None:
    places = list(product(range(table.horizon), range(table.states)))
    returns = []
    for action in range(table.actions):
        policy = dict.fromkeys(places, action)
        returns.append(table.at_start(partial(table.expected, policy)))
    found = difficulty(table.task(), ["best_constant"])
    assert found["best_constant"] == score(table, max(returns))


def advantages(table: Table) -> list[float]:
    advantages = []
    for t, state in sorted(visited(table)):
        q = np.array(table.action_values(state, t, table.random), float)
        advantages.extend(q - q.mean())
    return advantages


def of_state(table: Table, rewards: Sequence[Fraction]) -> Table:
    """The table with a reward of the next state alone."""
    return replace(table, pays={key: rewards[key[2]] for key in table.pays})  # type: ignore[misc]


@pytest.mark.parametrize("table", TABLES)
def test_the_nearest_reward_of_states_is_that_of_least_squares(table: Table) -> None:
    columns = [advantages(of_state(table, one)) for one in np.eye(table.states, dtype=int).tolist()]
    nearest = np.linalg.lstsq(np.transpose(columns), np.array(advantages(table)), rcond=1e-9)[0]
    simple = of_state(table, [Fraction(reward).limit_denominator(10**6) for reward in nearest.tolist()])

    def value(state: int, t: int) -> Fraction:
        """The true return of the optimal policy for the simple reward, which takes tied actions equally often."""
        if table.is_over(state, t):
            return Fraction(0)
        tied = best_actions(simple, state, t, Fraction(1, 10**5))
        return sum((table.action_value(state, t, a, value) for a in tied), Fraction(0)) / len(tied)

    found = difficulty(table.task(), ["best_state_reward"])
    assert found["best_state_reward"] == score(table, table.at_start(value))


def best_actions(table: Table, state: int, t: int, tolerance: Fraction = Fraction(0)) -> list[int]:
    q = table.action_values(state, t, table.best)
    return [a for a in range(table.actions) if q[a] >= max(q) - tolerance]


BANDIT = """
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
def test_rewards_of_states_succeed_where_states_show_the_action(after: str, expected: float) -> None:
    task = build_text(BANDIT.replace("NEXT", after).replace("LAST", "0" if after == "0" else "2"))
    assert difficulty(task, ["best_state_reward"])["best_state_reward"] == pytest.approx(expected)


@pytest.mark.parametrize("table", TABLES)
def test_coverage_is_the_overlap_of_visits_of_optimal_and_random_actions(table: Table) -> None:
    optimal = np.zeros(table.states)
    random = np.zeros(table.states)
    for (t, state), p in visited(table).items():
        random[state] += p * table.discount**t
    now = dict(table.start)
    for t in range(table.horizon):
        after: dict[int, Fraction] = {}
        for state, p in now.items():
            optimal[state] += p * table.discount**t
            tied = best_actions(table, state, t)
            for a in tied:
                for n, share in table.leads[state, a].items():
                    if n not in table.ends:
                        after[n] = after.get(n, Fraction(0)) + p * share / len(tied)
        now = after
    overlap = np.minimum(optimal / optimal.sum(), random / random.sum()).sum()
    assert difficulty(table.task(), ["coverage"])["coverage"] == pytest.approx(overlap)


def test_an_expert_that_starts_elsewhere_covers_nothing() -> None:
    for name in ("InitShiftLearner", "InitShiftExpert"):
        assert difficulty(name, ["coverage"])["coverage"] == 0
