"""Findings of a source, evaluated on results, and diagnoses: known mistakes that the scores of a learner fit."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.exact.rules.evaluator import Truth
from taskspec.language.expressions.syntax import Expr
from taskspec.learn.documents.document_models import DiagnosisEntry, FindingEntry, FindingsDocument
from taskspec.learn.documents.rule_books import EXAM, FINDINGS, RuleBook, file_of, read_exam, read_findings
from taskspec.learn.documents.score_rules import Comparison, ScoreEvaluator
from taskspec.learn.documents.seed_scores import ONE, SeedScores, short_name
from taskspec.learn.exam.changes import differs
from taskspec.learn.exam.learned import explanations
from taskspec.learn.exam.results import Diagnosis, Exam, Flag, finite
from taskspec.learn.statistics import CONFIDENCE
from taskspec.show.bibliography import Reference

Outcome = Literal["confirmed", "refuted", "undecided", "not run"]
OUTCOMES: tuple[Outcome, ...] = ("confirmed", "refuted", "undecided", "not run")
_WORDS: dict[bool | None, Outcome] = {True: "confirmed", False: "refuted", None: "undecided"}


SLACK = 0.1
"""By how much thresholds are moved to see whether a finding depends on them."""


@dataclass(frozen=True)
class FindingResult:
    """A finding, and whether it holds, by the name of a set of results.

    Attributes:
        comparisons: of known scores that its condition makes.
        varied: whether it holds with other actions or thresholds, in words, by the name of a set.
    """

    name: str
    entry: FindingEntry
    truths: Mapping[str, Truth[Comparison]]
    comparisons: Mapping[str, int]
    varied: Mapping[str, Mapping[str, Truth[Comparison]]]

    def outcome(self, results: str) -> Outcome:
        """Return the outcome: `not run` if all results that could decide it are missing."""
        return _outcome_of(self.truths[results])

    def sensitivity(self, results: str) -> dict[str, Outcome]:
        """Return the outcomes that differ with other actions or thresholds; none of a finding that was not run."""
        outcome = self.outcome(results)
        differing: dict[str, Outcome] = {}
        if outcome == "not run":
            return differing
        for how, truth in self.varied[results].items():
            other = _outcome_of(truth)
            if other not in (outcome, "not run"):
                differing[how] = other
        return differing

    def deciding(self, results: str) -> Comparison | None:
        """Return the closest of the comparisons that decide, or leave it open."""
        known = [each for each in self.truths[results].evidence if not each.is_missing]
        return min(known, key=lambda each: each.margin, default=None)

    def record(self, results: str) -> dict[str, Any]:
        """Return outcome and evidence as JSON data."""
        comparisons = []
        for each in self.truths[results].evidence:
            numbers = {"value": finite(each.value), "low": finite(each.low), "high": finite(each.high)}
            comparisons.append({"text": each.text, **numbers})
        return {
            "outcome": self.outcome(results), "comparisons": comparisons, "of": self.comparisons[results],
            "sensitivity": self.sensitivity(results),
        }  # fmt: skip


def _outcome_of(truth: Truth[Comparison]) -> Outcome:
    if truth.holds is None and all(each.is_missing for each in truth.evidence):
        return "not run"
    return _WORDS[truth.holds]


@dataclass(frozen=True)
class FindingsResult:
    """Findings with their outcomes, in the order of their file."""

    book: RuleBook
    results: tuple[FindingResult, ...]
    sets: tuple[str, ...]

    @property
    def described(self) -> FindingsDocument:
        assert isinstance(self.book.described, FindingsDocument)
        return self.book.described

    def counts(self, results: str) -> dict[Outcome, int]:
        """Return the number of findings with each outcome."""
        outcomes = [each.outcome(results) for each in self.results]
        return {outcome: outcomes.count(outcome) for outcome in OUTCOMES}

    @property
    def data(self) -> list[dict[str, Any]]:
        """All of it as JSON data."""
        data = []
        for each in self.results:
            outcomes = {name: each.record(name) for name in self.sets}
            data.append({"name": each.name, **each.entry.model_dump(), "outcomes": outcomes})
        return data


def evaluate(suite: str | Path, sets: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> FindingsResult:
    """Evaluate a suite's findings.

    Args:
        suite: name or folder.
        sets: results by name of the set, such as `paper` and `corrected`; in each the content of `exam.json`, by learner.

    Raises:
        SpecError: E710 for a suite without findings; for mistakes in its file; E713 for learners that it does not name.
    """
    path = file_of(suite, FINDINGS)
    if path is None:
        raise SpecError([Diagnostic("E710", None, f"the suite '{suite}' has no findings")])
    book = read_findings(path)
    evaluators = {}
    others = {}
    for name, exams in sets.items():
        evaluators[name] = _evaluator(book, exams)
        others[name] = _variations(book, exams, evaluators[name])
    results = []
    for rule in book.rules:
        assert isinstance(rule.entry, FindingEntry)
        truths = {}
        comparisons = {}
        varied: dict[str, dict[str, Truth[Comparison]]] = {}
        for name in sets:
            truths[name], comparisons[name] = _decided(evaluators[name], rule.condition)
            varied[name] = {}
            for how, other in others[name].items():
                varied[name][how], _ = _decided(other, rule.condition)
        results.append(FindingResult(rule.name, rule.entry, truths, comparisons, varied))
    return FindingsResult(book, tuple(results), tuple(sets))


def _decided(evaluator: ScoreEvaluator, condition: Expr) -> tuple[Truth[Comparison], int]:
    """Return whether a finding holds, and the number of comparisons of known scores.

    What rests on all of its comparisons is decided by 95 % intervals. What rests on some of them might do so by chance: each of k
    then needs an interval of 1 - 5 % / k (the first step of Holm, 1979).
    """
    made: list[Comparison] = []
    decided = replace(evaluator, made=made).truth(condition)
    if decided.holds is not None and len(decided.evidence) < len(made):
        confidence = 1 - (1 - CONFIDENCE) / len(made)
        decided = replace(evaluator, confidence=confidence).truth(condition)
    return decided, len(made)


def sets_of(exams: Mapping[Path, Exam]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return exams by set, which is the folder of an exam's folder, and learner; its exams of different tasks are joined.

    Args:
        exams: by their folders.

    Raises:
        SpecError: E713 for two exams of a learner on one task.
    """
    sets: dict[str, dict[str, dict[str, Any]]] = {}
    for place, exam in exams.items():
        known = sets.setdefault(place.parent.name, {}).setdefault(place.name, {"tasks": {}, "scores": []})
        for task in exam["tasks"]:
            if task in known["tasks"]:
                raise spec_error("E713", f"two exams of {place.parent.name}/{place.name} are about {task}")
        known["tasks"] |= exam["tasks"]
        known["scores"] += exam["scores"]
    return sets


def _evaluator(book: RuleBook, exams: Mapping[str, Mapping[str, Any]], other_actions: bool = False) -> ScoreEvaluator:
    """Return the evaluator of findings on one set of results.

    Args:
        other_actions: compare best actions where the file says drawn ones, and the other way round.

    Raises:
        SpecError: E713 for a learner that the findings do not name.
    """
    described = book.described
    assert isinstance(described, FindingsDocument)
    for learner in exams:
        if learner not in book.names.learners:
            hint = f"it is about {', '.join(book.names.learners)}"
            raise SpecError([Diagnostic("E713", None, f"no finding is about a learner '{learner}'", hint)])
    instances = {instance: name for name, instance in described.instances.items()}
    drawn = described.drawn != other_actions
    scores = SeedScores(exams, described.floor, drawn, book.same, instances)
    return ScoreEvaluator(scores, book.names, {name: tuple(tasks) for name, tasks in described.unable.items()})


def _variations(
    book: RuleBook, exams: Mapping[str, Mapping[str, Any]], evaluator: ScoreEvaluator
) -> dict[str, ScoreEvaluator]:
    actions = "drawn actions"
    if evaluator.scores.drawn:
        actions = "best actions"
    return {
        actions: _evaluator(book, exams, other_actions=True),
        f"{SLACK} easier": replace(evaluator, slack=SLACK),
        f"{SLACK} harder": replace(evaluator, slack=-SLACK),
    }


# -- diagnoses --------------------------------------------------------------------------------------------------------


def diagnose(exam: Mapping[str, Any], suite: str | Path) -> list[Diagnosis]:
    """Return the diagnoses whose conditions hold of an exam's results, in the order of the suite's file.

    Args:
        exam: the content of `exam.json`; `tasks` and `scores` are read.
        suite: name or folder; one without an `exam.yaml` has no diagnoses.

    Returns:
        For each: `name`, `message`, `cause`, `try`, `source`, the `tasks` that it rests on (ids), the `evidence`, comparisons
        with their intervals, and whether it says the `place` alone.

    Raises:
        SpecError: for mistakes in the suite's file.
    """
    path = file_of(suite, EXAM)
    if path is None:
        return []
    book = read_exam(path)
    scores = SeedScores({ONE: exam}, same=book.same)
    truths = _truths(book, scores)
    holding = {name for name, truth in truths.items() if truth.holds}
    alone = set()
    for rule in book.rules:
        if isinstance(rule.entry, DiagnosisEntry) and rule.entry.alone:
            alone.add(rule.name)
    if holding & alone:
        holding &= alone
    known = list(explanations(exam["scores"]))
    explained = [each.names for each in known if each.kind == "values"]
    is_named = any(each.is_mistake for each in known)
    diagnoses: list[Diagnosis] = []
    places: list[Diagnosis] = []
    for rule in book.rules:
        entry = rule.entry
        if not isinstance(entry, DiagnosisEntry) or rule.name not in holding:
            continue
        mistakes = set(entry.mistakes)
        is_contradicted = bool(mistakes) and any(mistakes.isdisjoint(names) for names in explained)
        if not holding & set(entry.unless) and not is_contradicted:
            evidence = truths[rule.name].evidence
            tasks = dict.fromkeys(itertools.chain.from_iterable(each.tasks for each in evidence))
            diagnosis: Diagnosis = {
                "name": rule.name, "message": entry.message, "cause": entry.cause, "try": entry.try_,
                "source": _cited(entry, book.references),
                "tasks": [scores.ids[task] for task in tasks if task in scores.ids],
                "evidence": [*map(str, evidence), *_worst_steps(exam, evidence)],
            }  # fmt: skip
            if entry.place:
                places.append(diagnosis | {"place": True})
            else:
                diagnoses.append(diagnosis)
    if diagnoses or is_named:
        return diagnoses
    return places


def _worst_steps(exam: Mapping[str, Any], evidence: Iterable[Comparison]) -> list[str]:
    """Return the step with the largest error of all tasks whose errors of steps are evidence, in words; [] without."""
    errors = "at_ends(", "before_ends(", "apart("
    tasks = set(itertools.chain.from_iterable(each.tasks for each in evidence if each.text.startswith(errors)))
    worst = ""
    largest = 0.0
    for score in exam["scores"]:
        error = max(score.get("at_ends") or 0.0, score.get("before_ends") or 0.0, score.get("apart") or 0.0)
        is_printed = score["peek"] is None and score["twin"] is None
        if is_printed and short_name(score["task"]) in tasks and score.get("worst_step") and error > largest:
            largest = error
            worst = f"{short_name(score['task'])}, seed {score['seed']}: {score['worst_step']}"
    return [worst] if worst else []


def new_diagnoses(exam: Exam, against: Exam, suite: str | Path) -> list[Diagnosis]:
    """Return the diagnoses of an exam that an earlier one does not have, and whose tasks show a significant difference.

    A condition may hold of one exam alone by chance: scores lie at its border, or it looks at the best of the seeds.

    Args:
        exam, suite: as of `diagnose`.
        against: the earlier exam.
    """
    known = {each["name"] for each in diagnose(against, suite)}
    new = []
    for each in diagnose(exam, suite):
        if each["name"] not in known and differs(exam, against, each["tasks"] or exam["tasks"]):
            new.append(each)
    return new


def diagnosis_flag(exam: Exam, diagnosis: Diagnosis) -> Flag:
    """Return the flag of a diagnosis that an earlier exam does not have."""
    task = next(iter(diagnosis["tasks"] or exam["tasks"]))
    message = f"a known mistake is nearest that is not for the baseline: {diagnosis['message']}"
    return Flag(kind="diagnosis", task=task, message=message, effect=None, low=None, high=None)


def undecided(exam: Mapping[str, Any], suite: str | Path) -> list[str]:
    """Return the diagnoses whose conditions hold for the mean scores, but not in all of their intervals, with the nearest number.

    Args:
        exam, suite: as of `diagnose`.
    """
    path = file_of(suite, EXAM)
    if path is None:
        return []
    book = read_exam(path)
    scores = SeedScores({ONE: exam}, same=book.same)
    at_means = ScoreEvaluator(scores, book.names, of_means=True)
    messages = []
    for rule, truth in zip(book.rules, _truths(book, scores).values(), strict=True):
        is_open = truth.holds is None and all(math.isfinite(each.margin) for each in truth.evidence)
        if isinstance(rule.entry, DiagnosisEntry) and is_open and at_means.truth(rule.condition).holds:
            nearest = min(truth.evidence, key=lambda each: each.margin)
            messages.append(f"{rule.entry.message} ({nearest})")
    return messages


def _truths(book: RuleBook, scores: SeedScores) -> dict[str, Truth[Comparison]]:
    evaluator = ScoreEvaluator(scores, book.names)
    return {rule.name: evaluator.truth(rule.condition) for rule in book.rules}


def _cited(entry: DiagnosisEntry, references: Mapping[str, Reference]) -> str:
    """Return a source as a line of text: authors, year, title, and the place in it."""
    key = entry.source.key
    reference = references.get(key)
    source = key
    if reference is not None:
        source = f"{reference.authors} ({reference.plain('year')}). {reference.plain('title')}"
    if entry.source.where:
        return f"{source}, {entry.source.where}"
    return source
