"""Exams of several learners, and those of an experiment: every learner that it names, examined on all of its instances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import spec_error
from taskspec.base.files import safe_name
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import Experiment
from taskspec.learn.exam import report
from taskspec.learn.exam.asked_tasks import exam_id
from taskspec.learn.exam.comparison import compare
from taskspec.learn.exam.examining import examine
from taskspec.learn.exam.plan import PRINTED
from taskspec.learn.exam.results import NAME, Exam, folder_name
from taskspec.learn.exam.verdicts import by_seed, mean_score
from taskspec.learn.experiments.experiment_file import ExperimentFile
from taskspec.learn.experiments.instances import Instance, expand
from taskspec.learn.experiments.picture import figure
from taskspec.learn.experiments.sweeping import Measured
from taskspec.learn.jobs.running import Running
from taskspec.show.figures import chart

EXAMS = Path("build/exams")
"""The folder of exams, unless another is given."""


@dataclass(frozen=True)
class LearnersExamined:
    """The exams of several learners.

    Attributes:
        folder: for reports of all.
        exams: by the name of the learner.
        folders: where each exam lies.
        experiment: that named the learners.
        instances: of the experiment.
        tasks: of the instances.
    """

    folder: Path
    exams: dict[str, Exam]
    folders: dict[str, Path]
    experiment: Experiment | None = None
    instances: Sequence[Instance] = ()
    tasks: tuple[Task, ...] = ()

    @property
    def data(self) -> Any:
        """The exam of one learner; of several, their exams and the comparison."""
        if len(self.exams) == 1:
            return next(iter(self.exams.values()))
        return {"exams": self.exams, "comparison": compare(self.exams)}

    def rows(self) -> tuple[Measured, ...]:
        """List the scores of all learners.

        Returns:
            For each instance the mean score of every learner, `bc`, and half its 95 % interval, `bc_half`.
        """
        measured = []
        for instance, task in zip(self.instances, self.tasks, strict=True):
            name = exam_id(task)
            values = dict[str, Any]()
            for learner, exam in self.exams.items():
                score = mean_score(list(by_seed(exam["scores"], name, "printed").values()), None)
                low = score["low"]
                high = score["high"]
                values |= {learner: score["mean"], f"{learner}_half": None}
                if low is not None and high is not None:
                    values[f"{learner}_half"] = (high - low) / 2
            measured.append(Measured(instance, "done", values))
        return tuple(measured)

    def write_reports(self) -> list[Path]:
        """Write the page of each exam, and of several a page and pictures of them all, those that can be drawn.

        Returns:
            The files written, after the results of a single exam.
        """
        written: list[Path] = []
        for name, exam in self.exams.items():
            written += [self.folders[name] / NAME, *report.write(exam, self.folders[name])]
            printed = self.folders[name] / PRINTED
            if printed.exists():
                written.append(printed)
        if len(self.exams) > 1:
            written += report.write_several(self.exams, self.folder, chart.possible(["html", "svg"]))
        if self.experiment is not None and chart.is_available() and any(each.varied for each in self.instances):
            path = self.folder / f"{safe_name(self.experiment.name)}.svg"
            chart.save(figure(self.experiment, self.rows(), tuple(self.exams)), path)
            written.append(path)
        return written


def examine_learners(
    learners: Sequence[str], folder: Path | None = None, *, running: Running | None = None, **terms: Any
) -> LearnersExamined:
    """Examine learners, one after another; an exam that is there already is gone on with.

    Args:
        learners: as `examine` takes them.
        folder: for the exam of one learner; of several, for a folder of each. `build/exams` has a folder of each unless given.
        running: how many processes, time limits, a cluster.
        terms: of each exam, other arguments of `examine`.

    Raises:
        SpecError: E713 for two learners of one name; as `examine`.
    """
    names = [folder_name(learner) for learner in learners]
    if len(set(names)) < len(names):
        raise spec_error("E713", "two of these learners have the same name", "each needs a name of its own")
    place = folder or EXAMS
    folders = {learner: place / name for learner, name in zip(learners, names, strict=True)}
    if len(learners) == 1 and folder is not None:
        folders = {learners[0]: folder}
    exams = {learner: examine(learner, **terms, out=folders[learner], running=running) for learner in learners}
    return LearnersExamined(place, exams, folders)


def examine_all(
    written: ExperimentFile, folder: Path | None = None, *, running: Running | None = None, **terms: Any
) -> LearnersExamined:
    """Examine the learners of an experiment, one after another; an exam that is there already is gone on with.

    Args:
        written: the experiment.
        folder: for a folder of each learner; `build/exams/NAME` unless given.
        running: how many processes, time limits, a cluster.
        terms: `seeds`, `steps`, `transitions`, `twins`, `peeks` in place of those of the file.

    Returns:
        The exams by learner, with the instances that they asked.

    Raises:
        SpecError: with every mistake in the experiment; E713 where it names no learner.
    """
    expanded = expand(written)
    tasks = expanded.tasks()
    experiment = written.experiment
    if not written.learners:
        hint = "add them to it: `learners: [bc, ppo]`"
        raise spec_error("E713", f"the experiment '{experiment.name}' names no learners", hint)
    for name in ("seeds", "steps", "transitions", "twins", "peeks"):
        value = getattr(experiment, name)
        if value is not None:
            terms.setdefault(name, value)
    place = folder or EXAMS / safe_name(experiment.name)
    terms |= {"suite": tasks[0].source.suite, "tasks": tasks, "running": running}
    exams = dict[str, Exam]()
    folders = dict[str, Path]()
    for learner in written.learners:
        name = folder_name(learner)
        folders[name] = place / name
        exams[name] = examine(learner, out=folders[name], **terms)
    return LearnersExamined(place, exams, folders, experiment, expanded.instances, tasks)
