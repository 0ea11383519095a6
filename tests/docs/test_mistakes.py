"""The pages of mistakes: all that an exam can name has one, none is empty, and numbers are those of exact models."""

import ast
import re

import numpy as np
import pytest

import taskspec
from docs.tools import mistakes
from docs.tools.mistake_numbers import GAMMA, q_values
from taskspec import oracle
from taskspec.base.arrays import Array
from taskspec.learn.exam.mistakes import MISTAKES, anchor
from taskspec.learn.exam.operators import OPERATORS
from taskspec.learn.exam.pairings import PAIRINGS
from taskspec.learn.exam.starc import REWARDS
from tests.shared.sparse import sparse


def test_each_name_that_an_exam_gives_has_a_page() -> None:
    names = {*OPERATORS, *REWARDS, *PAIRINGS} - {"right"}
    assert names < set(mistakes.NAMES)
    assert len(mistakes.NAMES) >= 30
    assert len(set(map(anchor, mistakes.NAMES))) == len(mistakes.NAMES)


@pytest.mark.parametrize("name", sparse(mistakes.NAMES, 4))
def test_no_page_is_empty(name: str) -> None:
    text = mistakes.page(name)
    _, *last_cells = re.findall(r"^\|(?!---).*\| *(.*?) *\| *(.*?) *\|$", text, re.MULTILINE)
    assert any(right != wrong for right, wrong in last_cells), "right and wrong numbers are the same"
    for part in ("Where it shows", "Usual code and repair", "What sees it", "Reported"):
        _, _, after = text.partition(f"## {part}")
        assert len(after.split("\n## ")[0].splitlines()) > 2, part
    assert re.search(r"^- (an exam|a unit test)", text, re.MULTILINE)


@pytest.mark.parametrize("name", mistakes.NAMES)
def test_threads_calls_and_changes_are_well_formed(name: str) -> None:
    mistake = MISTAKES[name]
    for thread in mistake.reported:
        assert re.fullmatch(r"[\w.-]+/[\w.-]+#\d+", thread)
    assert set(mistake.oracle) <= set(oracle.__all__)
    (change,) = re.findall(r"```diff\n(.*?)```", mistake.explanation, re.DOTALL)
    assert re.search(r"^[+-]", change, re.MULTILINE)
    for removed in (r"^\+.*\n", r"^-.*\n"):
        kept = re.sub(removed, "", change, flags=re.MULTILINE)
        ast.parse(re.sub("^.", "", kept, flags=re.MULTILINE))


def value_iteration(task: str) -> Array:
    """Action values (S, A) of Gymnasium's table, without a time limit."""
    table = taskspec.make(task).unwrapped.P
    Q = np.zeros((len(table), len(table[0])))
    for _ in range(1000):
        V = Q.max(axis=1)
        for s, actions in table.items():
            for a, outcomes in actions.items():
                Q[s, a] = sum(p * (r + GAMMA * (not terminated) * V[after]) for p, after, r, terminated in outcomes)
    return Q


@pytest.mark.parametrize("task", ["EndInPlace", "SecondThought", "Slip", "ValueLeft"])
def test_right_values_are_those_of_value_iteration(task: str) -> None:
    found = q_values(taskspec.load(f"probes/{task}"), "right")
    assert found is not None
    assert np.allclose(found.T, value_iteration(f"probes/{task}"), atol=1e-9)


@pytest.mark.parametrize(
    ("task", "name", "expected"),
    [
        ("EndInPlace", "ends ignored", [[0.5 + 9, 1 + 9]]),  # quitting pays 1 for ever: V = 10
        ("EndInPlace", "reward discounted", [[0.9 * 5, 0.9]]),
        ("ValueLeft", "immediate reward", [[1, 0], [2.5, 2.5]]),
    ],
)
def test_wrong_values_are_those_worked_out_by_hand(task: str, name: str, expected: list[list[float]]) -> None:
    found = q_values(taskspec.load(f"probes/{task}"), name)
    assert found is not None
    assert np.allclose(found.T, expected, atol=1e-9)
