"""Diagnoses: what the scores of a learner usually mean, by the rules that come with the suite."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from taskspec.bibliography import Reference
from taskspec.exam.results import Diagnosis
from taskspec.exam.rules import Book, Judge, SeedScores, read_exam
from taskspec.exam.rules.reading import exam_of
from taskspec.exam.rules.samples import ONE
from taskspec.task.schema import DiagnosisEntry


def evaluate(exam: Mapping[str, Any], suite: str | Path) -> list[Diagnosis]:
    """The diagnoses whose conditions hold of an exam's results, in the order of the suite's file.

    Args:
        exam: what `exam.json` holds; `tasks` and `scores` are read.
        suite: name or folder; one without an `exam.yaml` has no diagnoses.

    Returns:
        For each: `name`, `message`, `cause`, `try`, `source`, the `tasks` that speak for it (ids), and the `evidence`,
        comparisons with their intervals.

    Raises:
        SpecError: for mistakes in the suite's file.
    """
    path = exam_of(suite)
    return [] if path is None else judged(read_exam(path), exam)


def judged(book: Book, exam: Mapping[str, Any]) -> list[Diagnosis]:
    """The diagnoses of a file that hold of an exam's results (see `evaluate`)."""
    samples = SeedScores({ONE: exam})
    judge = Judge(samples, book.names)
    outcomes = {rule.name: judge.condition(rule.condition) for rule in book.rules}
    holding = {name for name, outcome in outcomes.items() if outcome.holds}
    found: list[Diagnosis] = []
    for rule in book.rules:
        entry, outcome = rule.entry, outcomes[rule.name]
        if rule.name in holding and isinstance(entry, DiagnosisEntry) and not holding & set(entry.unless):
            found.append({
                "name": rule.name, "message": entry.message, "cause": entry.cause, "try": entry.try_,
                "source": _cited(entry, book.references),
                "tasks": [samples.ids[task] for task in outcome.tasks if task in samples.ids],
                "evidence": [str(each) for each in outcome.seen],
            })  # fmt: skip
    return found


def _cited(entry: DiagnosisEntry, references: Mapping[str, Reference]) -> str:
    """A source as a line of text: authors, year, title, and the place in it."""
    key, where = entry.source.key, entry.source.where
    found = references.get(key)
    whole = key if found is None else f"{found.authors} ({found.plain('year')}). {found.plain('title')}"
    return f"{whole}, {where}" if where else whole
