"""Findings of a source, evaluated on results, and diagnoses: what the scores of a learner usually mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from taskspec.base.bibliography import Reference
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exam.results import Diagnosis
from taskspec.exam.rules import Book, Compared, Judge, Judged, SeedScores, read_exam, read_findings
from taskspec.exam.rules.judge import ONE
from taskspec.exam.rules.reading import exam_of, findings_of
from taskspec.pages.render.html import page_of
from taskspec.task.schema.experiments import DiagnosisEntry, FindingEntry, FindingsDocument

# ---------- findings
# Findings of a source, evaluated on results: confirmed, refuted, or undecided, with what decides it.

Outcome = Literal["confirmed", "refuted", "undecided", "not run"]
OUTCOMES: tuple[Outcome, ...] = ("confirmed", "refuted", "undecided", "not run")
_WORDS: dict[bool | None, Outcome] = {True: "confirmed", False: "refuted", None: "undecided"}


@dataclass(frozen=True)
class FindingResult:
    """A finding, and what became of it with each set of results, by the name of the set."""

    name: str
    entry: FindingEntry
    judged: Mapping[str, Judged]

    def outcome(self, results: str) -> Outcome:
        """`not run` where nothing that decides it was run."""
        found = self.judged[results]
        missing = found.holds is None and all(each.is_missing for each in found.seen)
        return "not run" if missing else _WORDS[found.holds]

    def deciding(self, results: str) -> Compared | None:
        """The comparison that is the closest of those that decide, or of those that leave it open."""
        known = [each for each in self.judged[results].seen if not each.is_missing]
        return min(known, key=lambda each: each.margin) if known else None


@dataclass(frozen=True)
class FindingsResult:
    """Findings with what became of each, in the order of their file."""

    book: Book
    results: tuple[FindingResult, ...]
    sets: tuple[str, ...]

    @property
    def described(self) -> FindingsDocument:
        assert isinstance(self.book.described, FindingsDocument)
        return self.book.described

    def counts(self, results: str) -> dict[Outcome, int]:
        """How many findings came to which outcome."""
        found = [each.outcome(results) for each in self.results]
        return {outcome: found.count(outcome) for outcome in OUTCOMES}

    @property
    def data(self) -> list[dict[str, Any]]:
        """All of it as JSON data."""
        return [
            {"name": each.name, **each.entry.model_dump(),
             "outcomes": {name: _told(each, name) for name in self.sets}}
            for each in self.results
        ]  # fmt: skip


def evaluate(suite: str | Path, sets: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> FindingsResult:
    """What becomes of a suite's findings.

    Args:
        suite: name or folder.
        sets: results by name of the set, such as `paper` and `corrected`, and in each what `exam.json` holds, by the learner.

    Raises:
        SpecError: E710 for a suite without findings; for mistakes in its file; E713 for learners that it does not name.
    """
    path = findings_of(suite)
    if path is None:
        raise SpecError([Diagnostic("E710", None, f"the suite '{suite}' has no findings")])
    book = read_findings(path)
    judges = {name: judge(book, exams) for name, exams in sets.items()}
    results = tuple(
        FindingResult(rule.name, rule.entry, {name: judges[name].condition(rule.condition) for name in sets})
        for rule in book.rules
        if isinstance(rule.entry, FindingEntry)
    )
    return FindingsResult(book, results, tuple(sets))


def judge(book: Book, exams: Mapping[str, Mapping[str, Any]]) -> Judge:
    """Who judges findings on one set of results.

    Raises:
        SpecError: E713 for a learner that they do not name.
    """
    described = book.described
    assert isinstance(described, FindingsDocument)
    stray = next((name for name in exams if name not in book.names.learners), None)
    if stray is not None:
        hint = f"it is about {', '.join(book.names.learners)}"
        raise SpecError([Diagnostic("E713", None, f"no finding is about a learner '{stray}'", hint)])
    instances = {instance: name for name, instance in described.instances.items()}
    scores = SeedScores(exams, described.floor, described.drawn, described.same, instances)
    return Judge(scores, book.names, {name: tuple(tasks) for name, tasks in described.unable.items()})


def _told(result: FindingResult, name: str) -> dict[str, Any]:
    comparisons = [
        {"text": each.text, "value": _finite(each.value), "low": _finite(each.low), "high": _finite(each.high)}
        for each in result.judged[name].seen
    ]
    return {"outcome": result.outcome(name), "comparisons": comparisons}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


# -- the page ---------------------------------------------------------------------------------------------------------


def markdown(found: FindingsResult, told: Sequence[str] = ()) -> str:
    """A page: how many findings came to what, and a table of them.

    Args:
        told: lines on how the results were obtained: machine, versions, command.
    """
    described = found.described
    lines = [f"# {described.title or 'Findings'}", "", *([described.doc, ""] if described.doc else [])]
    lines += [f"- {line}" for line in told] + ([""] if told else [])
    counts = [[name, *map(str, found.counts(name).values())] for name in found.sets]
    legend = "A finding is confirmed if it holds everywhere in the 95 % bootstrap intervals (in brackets), refuted if nowhere."
    lines += [*_table(["results", *OUTCOMES], counts), "", legend, ""]
    rows = [_row(each, found.sets) for each in found.results]
    return "\n".join([*lines, *_table(["", "the paper says", *found.sets], rows)]) + "\n"


def html(found: FindingsResult, told: Sequence[str] = ()) -> str:
    """The same as a page that stands alone."""
    described = found.described
    findings = [
        {
            "name": each.name, "says": each.entry.says, "where": each.entry.where, "note": each.entry.note,
            "outcomes": [_outcome(each, name) for name in found.sets],
        }
        for each in found.results
    ]  # fmt: skip
    return page_of(
        "findings.html", title=described.title or "Findings", doc=described.doc or "", told=told, findings=findings,
        tallies={name: found.counts(name) for name in found.sets},
    )  # fmt: skip


def _outcome(each: FindingResult, name: str) -> dict[str, Any]:
    outcome, deciding = each.outcome(name), each.deciding(name)
    evidence = str(deciding) if deciding is not None and outcome != "not run" else ""
    return {"set": name, "outcome": outcome, "evidence": evidence, "more": len(each.judged[name].seen) - 1}


def _row(each: FindingResult, sets: Sequence[str]) -> list[str]:
    entry = each.entry
    says = f"{entry.says} *({entry.where})*" + (f" {entry.note}" if entry.note else "")
    return [each.name, says, *(_cell(each, name) for name in sets)]


def _cell(each: FindingResult, name: str) -> str:
    outcome, deciding = each.outcome(name), each.deciding(name)
    if outcome == "not run" or deciding is None:
        return outcome
    others = len(each.judged[name].seen) - 1
    more = f" and {others} more" if others else ""
    return f"**{outcome}**: {_code(deciding)}{more}"


def _code(compared: Compared) -> str:
    head, sign, tail = str(compared).partition(" = ")
    return f"`{head}`{sign}{tail}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [list(header), ["---"] * len(header), *map(list, rows)]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]


# ---------- diagnoses
# Diagnoses: what the scores of a learner usually mean, by the rules that come with the suite.


def diagnose(exam: Mapping[str, Any], suite: str | Path) -> list[Diagnosis]:
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
