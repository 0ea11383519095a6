"""Exams of an experiment: every learner that it names, examined on all of its instances."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.jobs.running import Running
from taskspec.language.task.task import Task
from taskspec.learn.exam.asked_tasks import exam_id
from taskspec.learn.exam.examining import examine
from taskspec.learn.exam.results import Exam, folder_name
from taskspec.learn.exam.verdicts import by_seed, mean_score
from taskspec.learn.experiments.experiment_file import ExperimentFile
from taskspec.learn.experiments.instances import Instance, expand
from taskspec.learn.experiments.sweeping import Measured


@dataclass(frozen=True)
class LearnersExamined:
    """The exams of an experiment by what its learners are called, where each lies, and the tasks of its instances."""

    instances: tuple[Instance, ...]
    tasks: tuple[Task, ...]
    exams: dict[str, Exam]
    folders: dict[str, Path]

    def rows(self) -> tuple[Measured, ...]:
        """For each instance the mean score of every learner, `bc`, and half its 95 % interval, `bc_half`."""
        measured = []
        for instance, task in zip(self.instances, self.tasks, strict=True):
            name = exam_id(task)
            values = dict[str, Any]()
            for learner, exam in self.exams.items():
                found = mean_score(list(by_seed(exam["scores"], name, "printed").values()), None)
                low = found["low"]
                high = found["high"]
                values[learner] = found["mean"]
                if low is None or high is None:
                    values[f"{learner}_half"] = None
                else:
                    values[f"{learner}_half"] = (high - low) / 2
            measured.append(Measured(instance, "done", values))
        return tuple(measured)


def examine_all(
    written: ExperimentFile, folder: Path, *, seeds: int | None = None, steps: int | None = None, transitions: int | None = None,
    twins: int | None = None, peeks: bool | None = None, running: Running | None = None,
) -> LearnersExamined:  # fmt: skip
    """Examine the learners of an experiment, one after another; an exam that is there already is gone on with.

    Args:
        folder: where results go: `exam.json` of each learner lies in a folder that is called as it is.
        seeds, steps, transitions, twins, peeks: in place of those of the file.
        running: how many processes, time limits, a cluster.

    Raises:
        SpecError: with every mistake in the experiment; E713 where it names no learner.
    """
    expanded = expand(written)
    tasks = expanded.tasks()
    if not written.learners:
        hint = "add them to it: `learners: [bc, ppo]`"
        raise SpecError(
            [Diagnostic("E713", None, f"the experiment '{written.experiment.name}' names no learners", hint)]
        )
    given = {"seeds": seeds, "steps": steps, "transitions": transitions, "twins": twins, "peeks": peeks}
    terms = {name: getattr(written.experiment, name) for name in given}
    terms |= {name: value for name, value in given.items() if value is not None}
    terms = {name: value for name, value in terms.items() if value is not None}
    exams = dict[str, Exam]()
    folders = dict[str, Path]()
    for learner in written.learners:
        name = folder_name(learner)
        folders[name] = folder / name
        exams[name] = examine(
            learner, suite=tasks[0].source.suite, tasks=tasks, out=folders[name], running=running, **terms
        )
    return LearnersExamined(expanded.instances, tasks, exams, folders)
