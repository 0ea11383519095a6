"""Tasks by their names: ids, files, folders, and experiments (all of their instances)."""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language.modifiers import modify
from taskspec.language.targets import files_of, kind_of, tasks_in
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.experiments.experiment_file import read, read_if_experiment
from taskspec.learn.experiments.instances import expand


def tasks_of(targets: Sequence[str], modifiers: Sequence[str] = ()) -> tuple[list[Task], list[Diagnostic]]:
    """Return all tasks of ids, files and folders, and of experiments that are named, and what is wrong with others."""
    named = [target for target in targets if kind_of(target) == "experiment"]
    others = [target for target in targets if target not in named]
    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    if others or not named:
        for found in tasks_in(files_of(others, modifiers=modifiers)):
            if isinstance(found, SpecError):
                problems += found.diagnostics
            else:
                tasks.append(found)
    for target in named:
        try:
            tasks += [modify(task, *modifiers) for task in expand(read(target)).tasks()]
        except SpecError as error:
            problems += error.diagnostics
    return tasks, problems


def tasks_named(names: Sequence[str]) -> list[TaskLike]:
    """Return tasks by name; those of an experiment where one is named."""
    found: list[TaskLike] = []
    for name in names:
        written = read_if_experiment(name)
        if written is None:
            found.append(name)
        else:
            found += expand(written).tasks()
    return found
