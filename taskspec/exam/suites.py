"""Which tasks an exam asks."""

from __future__ import annotations

from collections.abc import Sequence

from taskspec import registry
from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.task.task import Task, TaskLike


def tasks_of(suite: str, wanted: Sequence[TaskLike] | None) -> list[Task]:
    """The tasks of an exam, in the variants in which a learner acts.

    Args:
        wanted: those to ask, by their names in the suite, or as anything that `taskspec.load` takes; None for all of the suite,
            but those that are there for comparison with the packages of others.

    Raises:
        SpecError: E701 for what is none; E713 for an unknown suite.
    """
    known = {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if not known and wanted is None:
        suites = {e.suite for e in registry.known().values()}
        raise SpecError([Diagnostic("E713", None, f"there is no suite '{suite}'", suggest(suite, suites))])
    found = [registry.load(known.get(t, t) if isinstance(t, str) else t) for t in (known if wanted is None else wanted)]
    if wanted is None:
        found = [t for t in found if not _compares(t) and t.roles.get("learner", t.variant) == t.variant]
    ids = [task.id for task in found]
    twice = next((i for i in ids if ids.count(i) > 1), None)
    if twice is not None:
        raise SpecError([Diagnostic("E713", None, f"{twice} is asked twice", "an exam asks each task once")])
    return found


def _compares(task: Task) -> bool:
    """Whether a task is a copy of what another package runs, beside the one that the suite is about."""
    return task.name.endswith("Seals")
