"""Measures of difficulty, beside every episode of small tasks written out one by one, and beside closed forms."""

import json
import math
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import exact, load
from taskspec.base import limits
from taskspec.base.diagnostics import SpecError
from taskspec.exact.scores.difficulty import MEASURES, difficulty
from taskspec.language.task.task import Task
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.sparse import sparse
from tests.shared.written_out import TABLES, Table


@pytest.fixture(params=range(len(TABLES)))
def written_out(request: pytest.FixtureRequest) -> tuple[Table, exact.Results]:
    table = TABLES[request.param]
    return table, exact.Results(table.task())


def test_luck_and_lengths_are_those_of_every_episode(written_out: tuple[Table, exact.Results]) -> None:
    table, results = written_out
    best = Fraction(0)
    paid = Fraction(0)
    length = Fraction(0)
    for p, steps in table.episodes():
        best += p * (table.returned(steps) >= table.best(steps[0][0]))
        paid += p * any(step[3] for step in steps)
        length += p * len(steps)
    found = difficulty(results, ["best_at_random", "episodes_to_reward", "random_length"])
    assert found["best_at_random"] == pytest.approx(float(best), abs=1e-12)
    assert found["random_length"] == pytest.approx(float(length))
    assert found["episodes_to_reward"] == (pytest.approx(float(1 / paid)) if paid else None)


def done_after(table: Table, state: int, t: int) -> bool:
    """Whether no action ever pays any more."""
    if table.is_over(state, t):
        return True
    for a in range(table.actions):
        for n in table.leads[state, a]:
            if table.pays[state, a, n] != 0 or not done_after(table, n, t + 1):
                return False
    return True


def steps_of(table: Table, policy: dict[tuple[int, int], int], state: int, t: int = 0) -> Fraction:
    """The expected steps of a policy until nothing pays any more."""
    if done_after(table, state, t):
        return Fraction(0)
    total = Fraction(1)
    for n, p in table.leads[state, policy[t, state]].items():
        total += p * steps_of(table, policy, n, t + 1)
    return total


def test_the_solution_is_the_shortest_of_all_optimal_policies(written_out: tuple[Table, exact.Results]) -> None:
    table, results = written_out
    top = table.at_start(table.best)
    lengths = []
    for policy in table.policies():
        if table.at_start(partial(table.expected, policy)) == top:
            lengths.append(table.at_start(partial(steps_of, table, policy)))
    assert difficulty(results, ["solution_length"])["solution_length"] == pytest.approx(float(min(lengths)))


# -- tasks of the suite, stepped through every sequence of actions -----------------------------------------------------


def outcomes(task: Task) -> Iterator[tuple[float, float, bool, int]]:
    """For every sequence of actions: its probability, the return, whether any reward is not 0, and the steps taken."""
    env = taskspec.make(task)
    horizon = task.horizon or 0
    actions = range(int(env.action_space.n))  # type: ignore[attr-defined]
    for chosen in product(actions, repeat=horizon):
        env.reset(seed=0)
        rewards = []
        for action in chosen:
            _, reward, terminated, truncated, _ = env.step(action)
            rewards.append(float(reward))
            if terminated or truncated:
                break
        yield len(actions) ** -horizon, sum(rewards), any(rewards), len(rewards)


@pytest.mark.parametrize(("name", "parameters"), [
    ("Branching", {"L": 5, "B": 3}), ("BranchingSeals", {"L": 4}), ("EarlyTermPos", {}), ("EarlyTermNeg", {}),
    ("InitShiftLearner", {}),
])  # fmt: skip
def test_tasks_of_the_suite_by_every_sequence_of_actions(name: str, parameters: dict[str, int]) -> None:
    task = load(f"derail/{name}", **parameters)
    found = difficulty(task, ["best_at_random", "episodes_to_reward", "random_length"])
    p, value, is_paid, steps = np.array(list(outcomes(task))).T
    expected = {
        "best_at_random": p[value > value.max() - 1e-9].sum(),
        "episodes_to_reward": 1 / (p @ is_paid),
        "random_length": p @ steps,
    }
    assert dict(found) == pytest.approx(expected)


# -- closed forms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "actions"), sparse([(1, 2), (3, 5), (10, 2), (30, 3)], 2))
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
    """The soft-optimal policy of RiskyPath (T, S, A), by hand."""
    value = np.zeros(4)
    tables = []
    for _ in range(5):
        goal = 1 + value[2]
        trap = value[3] - 100
        q = np.array([[value[1], goal, goal, trap], [(goal + trap) / 2, value[1], goal, trap]])
        value = np.logaddexp(q[0], q[1])
        tables.insert(0, np.exp(q - value).T)
    return np.array(tables)


WAIT = """
state:
  s: {type: int, low: 0, high: 3}
action:
  a: {type: choice, values: [stay, go]}
initial:
  s: 0
dynamics:
  s': s + (a == go)
horizon: none
discount: 9/10
reward: "s' == 3"
terminal: s' == 3
"""


def test_without_a_horizon_lengths_are_those_of_waiting() -> None:
    found = difficulty(build_text(WAIT))
    assert found["random_length"] == pytest.approx(6)  # three times a coin is thrown until heads
    assert found["solution_length"] == pytest.approx(3)
    assert found["episodes_to_reward"] == pytest.approx(1)
    assert found["best_at_random"] is None
    assert "horizon" in found.why_not["best_at_random"]


@pytest.mark.parametrize(("when", "expected"), [("t == 0", 1), ("t > 0", 4)])
def test_branching_is_that_of_the_first_step(when: str, expected: int) -> None:
    text = WAIT.replace("s' == 3\"", "s'\"").replace("terminal: s' == 3\n", "").replace("horizon: none", "horizon: 2")
    text = text.replace("s + (a == go)", f"s if {when} else UniformInt(0, 3)")
    assert difficulty(build_text(text))["branching"] == expected


# -- as a mapping, and what is said ----------------------------------------------------------------------------------


def test_every_measure_has_a_value_or_a_reason_on_every_task() -> None:
    for name in ("RiskyPath", "EarlyTermPos", "LargestSum", "Parabola"):
        found = difficulty(f"derail/{name}")
        assert list(found) == list(MEASURES)
        for measure, value in found.items():
            assert (value is None) == (measure in found.why_not)
            assert value is None or math.isfinite(value)
        assert json.loads(json.dumps(found.record())) == found.record()
        page = found._repr_html_()
        for measure in MEASURES:
            assert measure in page


def test_names_choose_measures() -> None:
    assert list(difficulty("derail/RiskyPath", ["states", "soft_gap"])) == ["states", "soft_gap"]
    with pytest.raises(SpecError, match=r"E713.*there is no measure 'state'"):
        difficulty("derail/RiskyPath", ["state"])


@for_each("name", MEASURES)
def test_measures_say_what_they_are(name: str) -> None:
    measure = MEASURES[name]
    assert measure.name == name
    assert measure.doc.endswith(".")


@pytest.mark.parametrize(("name", "measure", "why"), [
    ("derail/ProcGoal", "best_at_random", "outcomes"), ("derail/ProcGoal", "episodes_to_reward", "outcomes"),
    ("Taxi", "best_constant", "constant actions"), ("Taxi", "best_state_reward", "rewards of all states"),
])  # fmt: skip
def test_measures_that_take_too_long_are_not_begun(name: str, measure: str, why: str) -> None:
    results = exact.Results(name)
    assert results.optimal is not None and results.random is not None
    with limits.also("seconds=0"):
        found = difficulty(results, [measure, "random_length"])
    assert found["random_length"] is not None
    assert found[measure] is None and why in found.why_not[measure]
