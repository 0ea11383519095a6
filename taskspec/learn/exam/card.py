"""The card of an exam: the cause and what to do in one line, what passes, and a row for each other task, worst first."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.learn.exam import score_rows
from taskspec.learn.exam.learned import learned_notes
from taskspec.learn.exam.score_rows import PUBLISHED, TaskRow, counted, decimal, listed, named
from taskspec.learn.exam.verdicts import FEWEST

CAUSES = ("values", "reward", "policy")
"""Kinds of flags that name a cause: a known mistake explains what was learned."""
PASSING = ("masters", "passes")
FIXED_PASSES = "Passes, but so does one fixed action"
FLAG_WORDS = {
    "twin": "differs relabelled", "regression": "regression", "peeks": "uses withheld reward", "failed": "failed",
    "impossible": "impossible score", "values": "wrong values", "reward": "wrong reward", "policy": "wrong policy",
    "changed": "has changed", "diagnosis": "new diagnosis", "law": "breaks a law",
}  # fmt: skip
"""Flags in few words, for the cell of a matrix."""


@dataclass(frozen=True)
class FlagLine:
    """Flags of one kind that say the same of several tasks."""

    kind: str
    tasks: tuple[str, ...]
    message: str

    @property
    def words(self) -> str:
        """The message about the first task, where the difference is largest, and the names of the others."""
        text = f"{self.tasks[0]}: {self.message}"
        if len(self.tasks) > 1:
            text = f"{text.rstrip('.')}. The same on {listed(self.tasks[1:])}."
        return text


@dataclass(frozen=True)
class Card:
    """The content of a report of an exam, in any format.

    `rows` are the tasks that need a look, worst first; all of them where there is none.
    """

    learner: str
    terms: str
    lead: str
    advice: str
    passed: str
    rows: tuple[TaskRow, ...]
    others: tuple[TaskRow, ...]
    diagnoses: tuple[Mapping[str, Any], ...]
    flags: tuple[FlagLine, ...]
    notes: tuple[str, ...]
    costs: str


def card(exam: Mapping[str, Any]) -> Card:
    """Return the card of an exam.

    Args:
        exam: the content of `exam.json`.
    """
    run = [row for row in score_rows.rows(exam) if row.grade is not None or row.printed.failed]
    flagged = {flag["task"] for flag in exam["flags"]}
    rows = sorted((row for row in run if row.grade not in PASSING or row.id in flagged), key=lambda row: row.rank)
    passed = [row for row in run if row not in rows]
    lead, advice = _lead(exam, rows, passed)
    notes = [f"undecided, more seeds would tell: {text}" for text in exam.get("undecided", ())]
    notes += [*learned_notes(exam["scores"]), *(f"it cannot learn {text}" for text in score_rows.left_out(exam))]
    return Card(
        exam["learner"], score_rows.headline(exam), lead, advice, _passed(passed), tuple(rows or passed),
        tuple(passed if rows else ()), tuple(exam["diagnoses"]), tuple(flag_lines(exam["flags"])), tuple(notes),
        score_rows.costs(exam),
    )  # fmt: skip


def _passed(rows: Sequence[TaskRow]) -> str:
    """Return the tasks that are passed, each with its score; apart from them those that one fixed action passes, too."""
    sentences = []
    for grade, words in (("masters", "Passed"), ("passes", FIXED_PASSES)):
        named = [f"{row.name} {decimal(row.printed.mean)}" for row in rows if row.grade == grade]
        if named:
            sentences.append(f"{words}: {', '.join(named)}.")
    return " ".join(sentences)


def _lead(exam: Mapping[str, Any], rows: Sequence[TaskRow], passed: Sequence[TaskRow]) -> tuple[str, str]:
    """Return what is wrong, in a sentence, and what to do about it."""
    for flag in exam["flags"]:
        if flag["kind"] in CAUSES:
            return _sentence(flag["message"]), flag.get("advice", "")
    if exam["diagnoses"]:
        first = exam["diagnoses"][0]
        places = [row for row in rows if row.id in first["tasks"]]
        where = f" ({_place(places[0])})" if places else ""
        return _sentence(f"{first['message']}{where}"), _first_clause(first["try"])
    failing = [row for row in rows if row.grade in ("fails", None)]
    if failing:
        names = listed([_place(row) for row in failing])
        return f"Fails {names}. No usual cause explains these scores.", ""
    if exam["flags"]:
        first = exam["flags"][0]
        return _sentence(f"{named(first['task'])}: {first['message']}"), ""
    return _without_fault(rows, passed, len(exam["seeds"]))


def _without_fault(rows: Sequence[TaskRow], passed: Sequence[TaskRow], seeds: int) -> tuple[str, str]:
    """Return the first line of an exam in which nothing fails and nothing is flagged."""
    fixed = [row.name for row in (*rows, *passed) if row.grade == "passes"]
    unsure = [row.name for row in rows if row.grade == "unsure"]
    if unsure:
        advice = ""
        if seeds < FEWEST:
            advice = f"Use {FEWEST} seeds or more: fewer cannot show mastery."
        return f"Nothing fails; undecided after {counted(seeds, 'seed')}: {listed(unsure)}.", advice
    if fixed:
        return f"{FIXED_PASSES}: {listed(fixed)}.", "Run it with twins, which relabel actions."
    if passed:
        return f"Passes {counted(len(passed), 'task')}.", ""
    return "Nothing was run.", ""


def _place(row: TaskRow) -> str:
    """Return `EarlyTermNeg −3.27 relabelled`: a task with its worst score."""
    if row.grade is None:
        return f"{row.name} (it raised an error)"
    score, form = row.worst
    words = f"{row.name} {decimal(score)}"
    if form == PUBLISHED:
        return words
    return f"{words} {form}"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}."


def _first_clause(text: str) -> str:
    """Return the first of several pieces of advice."""
    return re.split(r"[;.:] ", text)[0].rstrip(".") + "."


def flag_lines(flags: Iterable[Mapping[str, Any]]) -> list[FlagLine]:
    """Return flags, those with the same message on several tasks as one; numbers in it may differ."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for flag in flags:
        same = re.sub(r"[−-]?\d[\d.,]*(e[+-]?\d+)?", "0", flag_text(flag))
        groups.setdefault((flag["kind"], same), []).append(flag)
    lines = []
    for (kind, _), group in groups.items():
        ordered = sorted(group, key=lambda flag: -abs(flag["effect"] or 0.0))
        lines.append(FlagLine(kind, tuple(named(flag["task"]) for flag in ordered), flag_text(ordered[0])))
    return lines


def flag_text(flag: Mapping[str, Any]) -> str:
    """Return the message of a flag with its advice."""
    if "advice" in flag:
        return f"{flag['message']} Usual code: {flag['advice']}"
    return str(flag["message"])


# -- several learners


@dataclass(frozen=True)
class MatrixCell:
    """One learner on one task: its row, and the diagnosis, flag or verdict in few words."""

    row: TaskRow | None
    word: str

    @property
    def score(self) -> str:
        if self.row is None:
            return ""
        return self.row.printed.words

    @property
    def grade(self) -> str:
        if self.row is None:
            return ""
        return self.row.grade or ""


@dataclass(frozen=True)
class LearnerMatrix:
    """Learners (rows) and tasks (columns): the exams of several learners side by side."""

    learners: tuple[str, ...]
    tasks: tuple[str, ...]
    cells: tuple[tuple[MatrixCell, ...], ...]
    cards: tuple[Card, ...]


def matrix(exams: Mapping[str, Mapping[str, Any]]) -> LearnerMatrix:
    """Return the exams of several learners side by side.

    Args:
        exams: the content of `exam.json`, by the name of the learner.
    """
    found = {name: {row.id: row for row in score_rows.rows(exam)} for name, exam in exams.items()}
    tasks = {task: row.name for by_task in found.values() for task, row in by_task.items()}
    cells = []
    for name, exam in exams.items():
        rows = [found[name].get(task) for task in tasks]
        cells.append(tuple(MatrixCell(row, _word(exam, row)) for row in rows))
    names = tuple(_without_family(list(exams)))
    return LearnerMatrix(names, tuple(tasks.values()), tuple(cells), tuple(card(exam) for exam in exams.values()))


def _word(exam: Mapping[str, Any], row: TaskRow | None) -> str:
    """Return what is wrong with a learner on a task, in few words."""
    if row is None or row.grade is None:
        return ""
    if row.grade not in PASSING:
        for diagnosis in exam["diagnoses"]:
            if row.id in diagnosis["tasks"]:
                return str(diagnosis["name"]).replace("_", " ")
    for flag in exam["flags"]:
        if flag["task"] == row.id:
            return FLAG_WORDS.get(flag["kind"], str(flag["kind"]))
    if row.grade == "masters":
        return ""
    return row.grade


def _without_family(learners: Sequence[str]) -> list[str]:
    """Return the names of learners, without the family or folder if all are in one."""
    parts = [name.rpartition("/") for name in learners]
    families = {family for family, _, _ in parts}
    if len(families) == 1:
        return [own for _, _, own in parts]
    return list(learners)
