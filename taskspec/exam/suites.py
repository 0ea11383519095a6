"""Which tasks an exam asks."""

from __future__ import annotations

from collections.abc import Sequence

from taskspec import registry
from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.ids import InstanceId
from taskspec.rules.books import exam_of, read_exam
from taskspec.task.task import Task, TaskLike


def tasks_of(suite: str, wanted: Sequence[TaskLike] | None) -> list[Task]:
    """The tasks of an exam, in the variants in which a learner acts.

    Args:
        wanted: those to ask, by their names in the suite, or as anything that `taskspec.load` takes; None for those that the
            suite's `exam.yaml` names, or all where it names none.

    Raises:
        SpecError: E701 for what is none; E713 for an unknown suite.
    """
    known = {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if not known and wanted is None:
        suites = {e.suite for e in registry.known().values()}
        raise SpecError([Diagnostic("E713", None, f"there is no suite '{suite}'", suggest(suite, suites))])
    if wanted is None:
        path = exam_of(suite)
        wanted = (read_exam(path).described.tasks if path is not None else ()) or tuple(known)
    found = [registry.load(known.get(task, task) if isinstance(task, str) else task) for task in wanted]
    ids = [exam_id(task) for task in found]
    twice = next((i for i in ids if ids.count(i) > 1), None)
    if twice is not None:
        raise SpecError([Diagnostic("E713", None, f"{twice} is given twice", "an exam has each task once")])
    return found


def exam_id(task: Task) -> str:
    """What a task is called in results: its id, with the values of parameters that are not their defaults, and modifiers."""
    values = {p.name: p.value for p in task.parameters if p.value != p.default}
    return str(InstanceId(task.id, dict(sorted(values.items())), tuple(map(str, task.modifiers))))
