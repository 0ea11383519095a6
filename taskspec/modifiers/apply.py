"""Tasks with modifiers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.lang.types import Refused
from taskspec.modifiers.entry import KEPT, Arguments, Inapplicable, ModifierEntry
from taskspec.modifiers.reading import Written, arguments, modifier
from taskspec.modifiers.table import MODIFIERS
from taskspec.task.invariants import check_on_request
from taskspec.task.options import Ending
from taskspec.task.task import Modifier, Task


def modify(task: Task, *modifiers: Written) -> Task:
    """The task with modifiers, one after the other.

    Args:
        task: the task; `taskspec.load(id, modifiers=[...])` is the same of an id or a path.
        *modifiers: texts as on the command line (`"distractors=3,kind=normal"`), mappings as in YAML
            (`{"distractors": {"count": 3, "kind": "normal"}}`, `{"sticky": 0.25}`), or those of another task (`Task.modifiers`).

    An expert that is written out stays where the best policies do; one that is planned is planned for the changed task. Claims
    and examples are about the task as written, and go, except with `absorbing` and `time_observed`.

    Raises:
        SpecError: E718 for an unknown modifier, E719 for wrong arguments, E720 for one that the task cannot be given.
    """
    if not isinstance(task, Task):
        raise SpecError([Diagnostic("E701", None, f"`modify` takes a task, not {task!r}", "`taskspec.load` gives one")])
    for written in modifiers:
        task = _modified(task, modifier(written))
    return check_on_request(task) if modifiers else task


def with_options(task: Task, ending: Ending, observe_time: bool) -> Task:
    """The task with the modifiers that options of environments stand for."""
    asked = {"absorbing": ending == "absorb", "time_observed": observe_time}
    return modify(task, *(name for name, wanted in asked.items() if wanted))


def is_as_written(task: Task) -> bool:
    """Whether what a spec says about its task (claims, examples, accepted warnings) is about this one, too."""
    return all(MODIFIERS[m.name].claims for m in task.modifiers)


def keeps_observers(task: Task, *modifiers: Written) -> bool:
    """Whether modifiers keep the returns of those who see the observations of a task alone, too, as the table says it.

    Raises:
        SpecError: as `modify` does.
    """
    for written in modifiers:
        given = modifier(written)
        entry = MODIFIERS[given.name]
        if not entry.keeps_observers(task, arguments(entry, given)):
            return False
        task = _modified(task, given)
    return True


def stand_in(task: Task, unmodified: Task) -> Task | None:
    """The finite stand-in of a task from that of the task as written; None where modifiers leave it none."""
    entries = [(m, MODIFIERS[m.name]) for m in task.modifiers]
    ways = [(m, entry.abstraction(arguments(entry, m))) for m, entry in entries]
    if any(way == "lost" for _, way in ways):
        return None
    return modify(unmodified, *(m for m, way in ways if way == "modified as well"))


def sentences(task: Task) -> Iterator[tuple[Modifier, str]]:
    """What each modifier of a task does, in Markdown with mathematics."""
    before = task.unmodified
    for each in task.modifiers:
        entry = MODIFIERS[each.name]
        yield each, entry.says(before, arguments(entry, each))
        before = _modified(before, each)


def _modified(task: Task, given: Modifier) -> Task:
    entry = MODIFIERS[given.name]
    values = arguments(entry, given)
    _check_time_limit(task, given, entry)
    try:
        changed = entry.change(task, values)
    except Inapplicable as found:
        raise _inapplicable(task, given, found.reason, found.hint) from None
    except Refused as refused:  # a limit of vectors or of ints
        raise _inapplicable(task, given, refused.message, refused.hint) from None
    if changed is task:  # it was as the modifier makes it
        return task
    changed = _about(task, changed, entry, values)
    return replace(
        changed,
        modifiers=(*task.modifiers, given),
        written_as=task.unmodified,
        content_hash=hashlib.sha256(f"{task.content_hash}+{given}".encode()).hexdigest(),
    )


def _check_time_limit(task: Task, given: Modifier, entry: ModifierEntry) -> None:
    """Refuse to change a horizon that another modifier has read.

    Raises:
        SpecError: E720.
    """
    if entry.time_limit != "changed":
        return
    for earlier in task.modifiers:
        if MODIFIERS[earlier.name].time_limit == "read":
            reason = f"'{earlier}' depends on when episodes end"
            raise _inapplicable(task, given, reason, "give the horizon before other modifiers")


def _about(task: Task, changed: Task, entry: ModifierEntry, values: Arguments) -> Task:
    """The changed task without what is true of the other one only."""
    if entry.claims:
        return changed
    stays = KEPT.index(entry.kept(task, values)) <= KEPT.index("best policies")
    expert = changed.expert if stays or not isinstance(changed.expert, tuple) else None
    return replace(changed, claims=(), examples=(), expert=expert, memory=changed.memory if stays else None)


def _inapplicable(task: Task, given: Modifier, reason: str, hint: str | None) -> SpecError:
    return SpecError([Diagnostic("E720", None, f"{task.id} cannot be given '{given}': {reason}", hint)])
