"""Exams of the calibration: each is kept in build/calibration, and judged again without training."""

from __future__ import annotations

import ast
import hashlib
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.exam import Exam, examine
from taskspec.learn.exam.findings import diagnose
from taskspec.learn.exam.flags import flags
from taskspec.learn.exam.learned import explanations, learned_flags
from tests.verification.calibration.learners import RIGHT
from tests.verification.calibration.wrong import RUN_AS, Mistake
from tests.verification.exam_study.exams import PROBES
from tests.verification.exam_study.tables import Tables

BUILD = Path("build/calibration")
STEPS = 10_000
TASKS = [f"probes/{probe}" for probe in PROBES]


@dataclass(frozen=True)
class Asked:
    """Exams to run: of a learner, or of a mistake in it, with a budget, and the first seed of each exam."""

    learner: str
    budget: float
    firsts: tuple[int, ...]
    seeds: int
    mistake: Mistake | None = None


@dataclass(frozen=True)
class Told:
    """What an exam says: mistakes that are named, what else explains the values, diagnoses, and kinds of flags with their tasks.

    `notes` are names that are no mistake where they are meant: `on policy`, and `until the limit`.
    """

    first: int
    names: tuple[str, ...]
    notes: tuple[str, ...]
    diagnoses: tuple[str, ...]
    flags: tuple[str, ...]


def exam_of(name: str, train: Callable[[Any], Any], program: str, asked: Asked, first: int) -> Exam:
    """Return the exam of a learner on the finite probes; one that was held before with the same program is read again."""
    steps = int(STEPS * asked.budget)
    content = f"{ast.dump(ast.parse(program))} {name} {steps} {first} {asked.seeds}"
    folder = BUILD / hashlib.sha256(content.encode()).hexdigest()[:16]
    if (folder / "exam.json").exists():
        return Tables.explained(folder)
    tables = Tables()
    seeds = range(first, first + asked.seeds)
    exam = examine(tables.keeping(train), suite="probes", tasks=TASKS, seeds=seeds, steps=steps, twins=0)
    tables.write(folder, exam)
    return exam


def told(exam: Exam, against: Exam | None, first: int) -> Told:
    """Return what an exam says, beside another one."""
    explained = list(explanations(exam["scores"]))
    names = [name for each in explained if each.is_mistake for name in each.names]
    notes = [name for each in explained if not each.is_mistake for name in each.names if name != "right"]
    raised = [*flags(exam["tasks"], exam["scores"], against), *learned_flags(exam["scores"])]
    diagnoses = [each["name"] for each in diagnose(exam, "probes")]
    kinds = [f"{flag['kind']} ({flag['task'].removeprefix('probes/').removesuffix('-v0')})" for flag in raised]
    return Told(first, tuple(names), tuple(notes), tuple(diagnoses), tuple(dict.fromkeys(kinds)))


def is_named(causes: Sequence[str], said: Told) -> bool | None:
    """Return whether an exam says one of the causes of a mistake; None where it accuses of nothing and says none."""
    if {*said.names, *said.notes, *said.diagnoses} & set(causes):
        return True
    if said.names or said.diagnoses:
        return False
    return None


def run(asked: Asked) -> list[Told]:
    """Return what each of some exams says: of a right learner beside the exam before, of a wrong one beside the right one."""
    name = asked.learner
    if asked.mistake is not None:
        name = RUN_AS.get(name, name)
    right = RIGHT[name]
    program = inspect.getsource(inspect.getmodule(right) or inspect)
    results = []
    against = None
    for first in asked.firsts:
        if asked.mistake is None:
            exam = exam_of(name, right, program, asked, first)
            results.append(told(exam, against, first))
            against = exam
        else:
            against = exam_of(name, right, program, asked, first + 500)
            wrong = asked.mistake.source()
            exam = exam_of(name, asked.mistake.train(), wrong, asked, first)
            results.append(told(exam, against, first))
    return results
