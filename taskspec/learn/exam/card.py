"""The card of an exam: all that its reports show, as data.

`card_text` shows it on the terminal, `card_charts` in pictures, `report` on pages and in files.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from taskspec.base.display import duration, fixed, listed, plural
from taskspec.learn.documents.seed_scores import short_name
from taskspec.learn.exam.asked_tasks import same_tasks
from taskspec.learn.exam.learned import learned_notes
from taskspec.learn.exam.score_rows import PUBLISHED, TaskRow, task_name, task_rows
from taskspec.learn.exam.verdicts import FEWEST

LEARNED = {
    "values": "The learned values are nearer to those of a known mistake than to the right ones.",
    "reward": "The learned reward is nearer to that of a known mistake than to the right one.",
    "policy": "The policy is nearer to that of a known mistake than to the right one.",
    "diagnosis": "The scores fit a known mistake that those of the baseline do not fit.",
}
"""First lines for kinds of flags whose messages name a mistake, which is a guess and no headline."""
PASSING = ("masters", "passes")
FIXED_PASSES = "Passes, but so does one fixed action"
FLAG_WORDS = {
    "twin": "differs relabelled", "regression": "regression", "peeks": "uses withheld reward", "failed": "failed",
    "impossible": "impossible score", "values": "wrong values", "reward": "wrong reward", "policy": "wrong policy",
    "changed": "has changed", "diagnosis": "new diagnosis", "law": "breaks a law",
    "seeds": "same seeds",
}  # fmt: skip
"""Flags in few words, for the cell of a matrix."""
# -- flags


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


def flag_lines(flags: Iterable[Mapping[str, Any]]) -> list[FlagLine]:
    """Return flags, those with the same message on several tasks as one; numbers in it may differ."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for flag in flags:
        same = re.sub(r"[−-]?\d[\d.,]*(e[+-]?\d+)?", "0", flag_text(flag))
        groups.setdefault((flag["kind"], same), []).append(flag)
    lines = []
    for (kind, _), group in groups.items():
        ordered = sorted(group, key=lambda flag: -abs(flag["effect"] or 0.0))
        tasks = tuple(task_name(flag["task"]) for flag in ordered)
        lines.append(FlagLine(kind, tasks, flag_text(ordered[0])))
    return lines


def flag_text(flag: Mapping[str, Any]) -> str:
    """Return the message of a flag with its advice."""
    if "advice" in flag:
        return f"{flag['message']} Usual code: {flag['advice']}"
    return str(flag["message"])


# -- the card


@dataclass(frozen=True)
class Card:
    """The content of a report of an exam.

    Attributes:
        learner: its name.
        suite: the suite of the exam.
        terms: what it learned from, steps and seeds.
        steps: of each training run, in words.
        lead: what fails, or else what is flagged, in a sentence.
        advice: the nearest known mistake, and what to do.
        passed: the tasks that are passed.
        tasks: all tasks in the order of the exam.
        rows: the tasks that need a look, worst first; all that were run where there is none.
        others: the other tasks that were run.
        diagnoses: as in `exam.json`.
        flags: in lines.
        laws: results of laws, as in `exam.json`.
        notes: what is undecided, what was learned, what the learner is not for.
        facts: how the exam was run: cost, command, versions, machine.
    """

    learner: str
    suite: str
    terms: str
    steps: str
    lead: str
    advice: str
    passed: str
    tasks: tuple[TaskRow, ...]
    rows: tuple[TaskRow, ...]
    others: tuple[TaskRow, ...]
    diagnoses: tuple[Mapping[str, Any], ...]
    flags: tuple[FlagLine, ...]
    laws: tuple[Mapping[str, Any], ...]
    notes: tuple[str, ...]
    facts: Mapping[str, str]


def card(exam: Mapping[str, Any]) -> Card:
    """Return the card of an exam.

    Args:
        exam: the content of `exam.json`.
    """
    tasks = [replace(row, word=_word(exam, row)) for row in task_rows(exam)]
    flagged = {flag["task"] for flag in exam["flags"]}
    rows = []
    passed = []
    for row in tasks:
        if row.grade is None and not row.printed.failed:
            continue
        if row.grade not in PASSING or row.id in flagged:
            rows.append(row)
        else:
            passed.append(row)
    rows.sort(key=lambda row: row.rank)
    lead, advice = _lead(exam, rows, passed)
    is_wrong = bool(exam["diagnoses"]) or any(row.grade in ("fails", None) for row in rows)
    source = " and ".join(exam["learns_from"]) or "nothing"
    steps = f"{exam['steps']:,}"
    return Card(
        learner=exam["learner"], suite=exam["suite"], steps=steps, lead=lead, advice=advice, passed=_passed(passed),
        terms=f"learns from {source}; {steps} steps, {plural(len(exam['seeds']), 'seed')}", tasks=tuple(tasks),
        rows=tuple(rows or passed), others=tuple(passed if rows else ()), diagnoses=tuple(_as_run(exam)),
        flags=tuple(flag_lines(exam["flags"])), laws=tuple(exam.get("laws") or ()),
        notes=tuple(_notes(exam, is_wrong)), facts=_facts(exam),
    )  # fmt: skip


def _word(exam: Mapping[str, Any], row: TaskRow) -> str:
    if row.grade is None:
        return ""
    for flag in exam["flags"]:
        if flag["task"] == row.id:
            return FLAG_WORDS.get(flag["kind"], str(flag["kind"]))
    if row.grade == "masters":
        return ""
    return row.grade


def _as_run(exam: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield diagnoses whose evidence has the names of the tasks that were run, where a rule means them by another."""
    run = set(map(short_name, exam["tasks"]))
    names = {}
    for suite in exam["suite"].split(" and "):
        for own, other in same_tasks(suite).items():
            if own in run and other not in run:
                names[other] = own
    for diagnosis in exam["diagnoses"]:
        evidence = []
        for text in diagnosis["evidence"]:
            evidence.append(re.sub(r"\w+", lambda word: names.get(word[0], word[0]), text))
        yield {**diagnosis, "evidence": evidence}


def _notes(exam: Mapping[str, Any], is_wrong: bool) -> list[str]:
    """Return what is undecided and left out, and what was learned; not that it is right, where something else is wrong."""
    notes = [f"undecided, more seeds would tell: {text}" for text in exam.get("undecided", ())]
    notes += learned_notes(exam["scores"], is_wrong)
    for task, about in exam["tasks"].items():
        if about.get("cannot"):
            notes.append(f"it cannot learn {task_name(task)}: {about['cannot']}")
    return notes


def _facts(exam: Mapping[str, Any]) -> dict[str, str]:

    cost = exam["cost"]
    spent = [f"{int(cost.get('steps', 0)):,} steps"]
    for name, words in (("demonstrations", "demonstrated transitions"), ("comparisons", "comparisons")):
        if cost.get(name):
            spent.append(f"{int(cost[name]):,} {words}")
    spent.append(duration(float(cost.get("seconds", 0.0))))
    return {
        "Cost": ", ".join(spent),
        "Command": exam["command"],
        "Versions": listed_facts(exam["versions"]),
        "Machine": listed_facts(exam["machine"]),
    }


def listed_facts(facts: Mapping[str, Any]) -> str:
    """Return facts in a line, each with its name: `python 3.12.3, numpy 2.1.0`."""
    return ", ".join(f"{name} {value}" for name, value in facts.items())


def _passed(rows: Sequence[TaskRow]) -> str:
    """Return the tasks that are passed, each with its score; apart from them those that one fixed action passes, too."""
    sentences = []
    for grade, words in (("masters", "Passed"), ("passes", FIXED_PASSES)):
        named = [f"{row.name} {row.printed.words}" for row in rows if row.grade == grade]
        if named:
            sentences.append(f"{words}: {', '.join(named)}.")
    return " ".join(sentences)


def _lead(exam: Mapping[str, Any], rows: Sequence[TaskRow], passed: Sequence[TaskRow]) -> tuple[str, str]:
    mistake = _nearest_with_advice(exam)
    failing = [row for row in rows if row.grade in ("fails", None)]
    if failing:
        names = listed([_place(row) for row in failing])
        return f"Fails {names}.", mistake or "No known mistake explains these scores."
    if exam["flags"]:
        first = min(exam["flags"], key=lambda flag: flag["kind"] in LEARNED)
        message = _sentence(f"{task_name(first['task'])}: {first['message']}")
        return LEARNED.get(first["kind"], message), mistake
    lead, advice = _without_fault(rows, passed, len(exam["seeds"]))
    return lead, mistake or advice


def _nearest_with_advice(exam: Mapping[str, Any]) -> str:
    """Return the known mistake that is nearest to what was learned, or else to the scores, and what to do; "" without one."""
    for flag in exam["flags"]:
        if "advice" in flag:
            return f"{_sentence(flag['message'])} {flag['advice']}"
    for diagnosis in exam["diagnoses"]:
        return f"{_sentence(nearest(diagnosis))} {_first_clause(diagnosis['try'])}"
    return ""


def nearest(diagnosis: Mapping[str, Any]) -> str:
    """Return the message of a diagnosis as the nearest known mistake, or as a place; others may have the same scores."""
    message = diagnosis["message"]
    kind = "nearest known mistake"
    if diagnosis.get("place"):
        kind = "where to look"
    return f"{kind}: {message[0].lower()}{message[1:]}"


def _without_fault(rows: Sequence[TaskRow], passed: Sequence[TaskRow], seeds: int) -> tuple[str, str]:
    fixed = [row.name for row in (*rows, *passed) if row.grade == "passes"]
    unsure = [row.name for row in rows if row.grade == "unsure"]
    if unsure:
        advice = ""
        if seeds < FEWEST:
            advice = f"Use {FEWEST} seeds or more: fewer cannot show mastery."
        return f"Nothing fails; undecided after {plural(seeds, 'seed')}: {listed(unsure)}.", advice
    if fixed:
        return f"{FIXED_PASSES}: {listed(fixed)}.", "Run it with twins, which relabel actions."
    if passed:
        return f"Passes {plural(len(passed), 'task')}.", ""
    return "Nothing was run.", ""


def _place(row: TaskRow) -> str:
    """Return `EarlyTermNeg −3.27 relabelled`: a task with its worst score."""
    if row.grade is None:
        return f"{row.name} (it raised an error)"
    score, form = row.worst
    words = f"{row.name} {fixed(score, 2)}"
    if form == PUBLISHED:
        return words
    return f"{words} {form}"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}."


def _first_clause(text: str) -> str:
    return re.split(r"[;.:] ", text)[0].rstrip(".") + "."


# -- several learners


@dataclass(frozen=True)
class LearnerMatrix:
    """The cards of several learners side by side.

    Attributes:
        learners: their names, without the family that all share.
        tasks: the names of all tasks.
        cells: a row of tasks for each learner; without scores where it has none.
        cards: by the whole name of the learner.
    """

    learners: tuple[str, ...]
    tasks: tuple[str, ...]
    cells: tuple[tuple[TaskRow, ...], ...]
    cards: Mapping[str, Card]


def matrix(cards: Mapping[str, Card]) -> LearnerMatrix:
    """Return learners side by side.

    Args:
        cards: by the name of the learner.
    """
    unknown = {}
    for shown in cards.values():
        for row in shown.tasks:
            unknown[row.id] = TaskRow(row.id, row.name)
    cells = []
    for shown in cards.values():
        known = {row.id: row for row in shown.tasks}
        cells.append(tuple((unknown | known).values()))
    names = tuple(_without_family(list(cards)))
    return LearnerMatrix(names, tuple(row.name for row in unknown.values()), tuple(cells), cards)


def _without_family(learners: Sequence[str]) -> list[str]:
    parts = [name.rpartition("/") for name in learners]
    families = {family for family, _, _ in parts}
    if len(families) == 1:
        return [own for _, _, own in parts]
    return list(learners)
