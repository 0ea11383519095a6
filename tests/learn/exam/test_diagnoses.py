"""Diagnoses of the probes: each is told for its own mistakes, from their exact scores, and for no other learner."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.exact.policies.values import policy_value
from taskspec.exact.scores.returns import Results
from taskspec.learn.documents.document_models import DiagnosisEntry
from taskspec.learn.documents.rule_books import EXAM, file_of, read_exam
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.exam.findings import diagnose
from taskspec.learn.exam.mistakes import MISTAKES
from taskspec.learn.exam.operators import OPERATORS
from taskspec.learn.exam.pairings import PAIRINGS, shown_of
from tests.shared.exams import entry

PROBES = (
    "EndInPlace",
    "Hazard",
    "ValueLeft",
    "SecondThought",
    "Slip",
    "CoinToss",
    "Sizes",
    "Patience",
    "Echo",
    "LongFailures",
)
HIDDEN = ("LookAlikes", "Votes")
TOLD = {
    "ends ignored": "past_ends", "next episode": "past_ends", "flags exchanged": "past_ends",
    "reset at the end": "past_ends", "rewards centred": "past_ends", "rewards standardised": "past_ends",
    "limit is an end": "limit_ends", "reset at the limit": "limit_ends",
    "immediate reward": "one_step", "mask inverted": "one_step", "same state": "one_step",
    "rewards clipped": "sizes_unseen", "signs of rewards": "sizes_unseen", "rewards squashed": "sizes_unseen",
    "soft maximum": "lengths",
    "reward before": "off_by_one", "reward after": "off_by_one",
    "reward negated": "reversed",
}  # fmt: skip
"""The diagnosis of each operator that has one."""


def told(by_task: dict[str, float], learns_from: str = "reward", **others: Any) -> list[str]:
    """Return the diagnoses of a learner with the same scores on five seeds; tasks that are not named are mastered."""
    each = {task: by_task.get(task, 1.0) for task in (*PROBES, *HIDDEN, "Aim")}
    records = []
    for task, score in each.items():
        records += [entry(task, seed, score, **others) | {"task": f"probes/{task}-v0"} for seed in range(5)]
    exam = {
        "tasks": {f"probes/{task}-v0": {"constant": 0.0} for task in each},
        "scores": records,
        "learns_from": [learns_from],
    }
    return [each["name"] for each in diagnose(exam, "probes")]


def test_the_mistakes_of_the_rules_are_those_of_the_table() -> None:
    assert set(TOLD) <= set(OPERATORS)
    path = file_of("probes", EXAM)
    assert path is not None
    of_rules = {}
    for rule in read_exam(path).rules:
        assert isinstance(rule.entry, DiagnosisEntry)
        assert set(rule.entry.mistakes) <= set(MISTAKES)
        of_rules |= dict.fromkeys(rule.entry.mistakes, rule.name)
    of_groups = {name: of_rules.pop(name) for name in ("length normalised", "deviation divided")}
    assert of_groups == {"length normalised": "lengths", "deviation divided": "deviations"}
    assert of_rules == {name: rule for name, rule in TOLD.items() if rule != "reversed"}


@pytest.mark.parametrize(("probe", "rule"), [("LongFailures", "lengths"), ("Votes", "deviations")])
def test_estimators_of_groups_are_told_by_their_probe_alone(probe: str, rule: str) -> None:
    assert told({probe: -1.0}) == [rule]
    assert told({probe: -1.0, "Slip": 0.5}) == [rule]
    assert told({probe: -1.0, "CoinToss": -1.0}) == []


def _score(probe: str, pi: Any) -> float:
    results = Results(load(f"probes/{probe}"), 1)
    assert results.random is not None and results.expert is not None
    value = policy_value(results, np.asarray(pi), True).value.value
    return (value - results.random.value) / (results.expert.value - results.random.value)


TARGETS = ("EndInPlace", "Hazard", "ValueLeft", "SecondThought", "CoinToss", "Sizes", "Patience", "Echo")


@pytest.mark.parametrize(
    ("failed", "explained", "expected"),
    [
        (TARGETS[:5], 0.9, ["critic_alone"]),
        (TARGETS[:5], 0.3, []),  # neither has learned
        (TARGETS[:5], None, []),  # there is no critic
        (TARGETS[:4], 0.9, []),  # it is on its way
        (TARGETS, 0.9, ["at_random"]),
    ],
)
def test_a_policy_that_does_not_follow_its_critic_is_told(
    failed: Sequence[str], explained: float | None, expected: list[str]
) -> None:
    assert told(dict.fromkeys(failed, 0.0), explained=explained) == expected


def test_imitators_that_end_episodes_early_are_told() -> None:
    by_task = {"EndInPlace": _score("EndInPlace", [1]), "Slip": _score("Slip", [0, 0, 0])}
    assert told(by_task, "demonstrations") == ["ends_early"]
    assert told({"Slip": by_task["Slip"]}, "demonstrations") == []
    assert told(by_task) == []


def test_broken_learners_have_no_diagnosis() -> None:
    """Constant actions, random ones, and what is untrained."""
    for action in (0, 1):
        constant = {}
        for probe in PROBES:
            constant[probe] = _score(probe, np.full(load(f"probes/{probe}").observation_layout.counts[0], action))
        for source in ("reward", "demonstrations"):
            assert told(constant, source) == []
    at_random = dict.fromkeys((*PROBES, *HIDDEN, "Aim"), 0.0)
    assert told(at_random) == ["at_random"]
    assert told(at_random, "demonstrations") == []


def test_clones_are_told_nothing_about_targets() -> None:
    """Whatever pairs they imitate: they have none."""
    for name in PAIRINGS:
        by_task = {}
        for probe in PROBES:
            task = load(f"probes/{probe}")
            case = Case(task, (0,), ExamTerms(1, ("demonstrations",), 400))
            by_task[probe] = _score(probe, PAIRINGS[name](shown_of(task, case.demonstrations)))
        expected = {"avoided": ["reversed"]}.get(name, [])
        assert set(told(by_task, "demonstrations")) <= {*expected, "off_by_one"}, name


@pytest.mark.parametrize(
    ("operators", "expected"), [(None, ["limit_ends"]), ({"right": 0.02}, []), ({"right": 0.6}, [])]
)
def test_a_diagnosis_that_values_contradict_is_not_told(operators: Any, expected: list[str]) -> None:
    assert told({"ValueLeft": 0.0}, operators=operators) == expected
