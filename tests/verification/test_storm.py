"""The model checker Storm solves what was written: equal rationals for every finite task of the library."""

from __future__ import annotations

import importlib
from fractions import Fraction
from pathlib import Path

import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results
from taskspec.exact.scores.difficulty import best_observing
from taskspec.language.registry import known
from taskspec.tools.exchange import formats, storm
from taskspec.tools.exchange.formats import imported
from taskspec.tools.exchange.settled import settled
from taskspec.tools.exchange.spec_text import task_of_tables
from tests.shared.commands import Done, spec

FLOATS = {
    "memory/HigherLower-v0",
    "operations/Queue-v0",
    "pomdp/RockSample-v0",
    "seals/RandomTransition-v0",
    "textbook/CarRental-v0",
}
"""Tasks with probabilities that are no rationals: Storm's values lie within our bounds."""
LARGE = {
    "derail/ProcGoal-v0", "derail/ProcGoalSeals-v0", "memory/Minesweeper-v0", "operations/Queue-v0", "planning/Queens-v0",
    "planning/TicTacToe-v0", "planning/ThreeInAColumn-v0", "seals/CliffWorldLarge-v0", "seals/CliffWorldLargeXY-v0",
    "textbook/CarRental-v0", "textbook/Gambler-v0",
}  # fmt: skip
ENDLESS = """\
taskspec: 1
name: Endless
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: choice, values: [left, right]}}
horizon: none
initial: {s: 1}
dynamics: {s': "s if s != 1 else (0 if a == left else 2)"}
reward: s' == 2
terminal: s' == 0
"""
needs_storm = pytest.mark.skipif(not storm.is_installed(), reason="stormpy is not installed")


def verdicts(name: str) -> set[str]:
    """What is said of the optimal, random and worst return; nothing where there is no exact model."""
    try:
        model, found = formats.exported(load(name))
    except SpecError as error:
        assert error.diagnostics[0].code == "E712"
        return set()
    rows = list(storm.compared(model, found))
    assert [row.which for row in rows] == ["optimal", "random", "worst"]
    return {row.verdict for row in rows}


@needs_storm
@pytest.mark.parametrize(
    "names", [pytest.param(LARGE, marks=pytest.mark.slow), {*known()} - LARGE], ids=["large", "small"]
)
def test_storm_finds_the_same_returns(names: set[str]) -> None:
    for name in sorted(names):
        check_returns(name)


def check_returns(name: str) -> None:
    expected = "within the bounds of rounding" if name in FLOATS else "equal rationals"
    assert verdicts(name) <= {expected}, name


@needs_storm
def test_a_file_that_says_something_else_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    done = Done("export", "RiskyPath", "--verify")
    assert done.status == 0
    assert done.out.count("equal rationals") == 3
    right = storm.solved
    monkeypatch.setattr(storm, "solved", lambda *given: [value + Fraction(1, 10**30) for value in right(*given)])
    done = Done("export", "RiskyPath", "--verify")
    assert done.status == 1
    assert done.out.count("different") == 3


@needs_storm
def test_a_task_that_may_never_end_has_no_finite_return(tmp_path: Path) -> None:
    path = spec(tmp_path, ENDLESS)
    done = Done("export", path, "--verify")
    assert done.status == 1
    assert "E712" in done.err


@needs_storm
def test_what_storm_converts_is_read_with_its_observations(tmp_path: Path) -> None:
    """A partially observable process in which only the side that is not shown tells what pays."""
    stormpy = importlib.import_module("stormpy")
    path = tmp_path / "hidden.drn"
    path.write_text(HIDDEN)
    options = stormpy.io.DirectEncodingParserOptions()
    options.build_choice_labeling = True
    model = stormpy.build_model_from_drn(str(path), options=options)
    stormpy.io.export_to_umb(model, str(tmp_path / "hidden.umb"))
    task = imported(str(tmp_path / "hidden.umb"), horizon=2)
    assert task.seen == ((0,), (1,), (1,), (2,))
    results = Results(task_of_tables(task), 1)
    assert results.optimal.value == 1  # type: ignore[union-attr]
    assert best_observing(results, "remembering").high == 0


HIDDEN = """\
@type: POMDP
@parameters

@reward_models
pay
@nr_states
4
@nr_choices
6
@model
state 0 {0} [0] init
\taction __NOLABEL__ [0]
\t\t1 : 0.5
\t\t2 : 0.5
state 1 {1} [0]
\taction left [1]
\t\t3 : 1
\taction right [-1]
\t\t3 : 1
state 2 {1} [0]
\taction left [-1]
\t\t3 : 1
\taction right [1]
\t\t3 : 1
state 3 {2} [0]
\taction __NOLABEL__ [0]
\t\t3 : 1
"""


def test_storm_solves_umb_alone() -> None:
    assert "E726" in Done("export", "RiskyPath", "-f", "npz", "--verify").err


def test_policy_iteration_in_rationals() -> None:
    """Textbook values: a random walk of five states is won from its middle with probability 1/2; gambling is not."""
    walk = settled(formats.exported(load("textbook/RandomWalk"))[1])
    assert {storm.stationary_return(walk, pick) for pick in (max, min, None)} == {Fraction(1, 2)}
    _, found = formats.exported(load("textbook/Gambler?p=0.4"))
    best = storm.stationary_return(settled(found), max)
    assert best == Fraction(2, 5)  # bold play: all of 50 at once
