"""Modifiers: functions from tasks to tasks, one entry of a table each; and the texts and mappings that name them."""

from __future__ import annotations

import copyreg
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NoReturn, TypeAlias

from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.named import all_names, entries_by_name
from taskspec.language.expressions.types import Refused
from taskspec.language.modifiers import actions, observations, rewards, symmetries
from taskspec.language.modifiers.core import forgetting
from taskspec.language.modifiers.entry import KEPT, Inapplicable
from taskspec.language.modifiers.entry import ModifierArgument as ModifierArgument
from taskspec.language.modifiers.entry import ModifierEntry as ModifierEntry
from taskspec.language.task.build import reduce_task
from taskspec.language.task.parts import Ending, Modifier
from taskspec.language.task.task import Task

__all__ = ["MODIFIERS", "Modifier", "modify"]

MODIFIERS: dict[str, ModifierEntry] = entries_by_name(
    (*actions.TABLE, *observations.TABLE, *symmetries.TABLE, *rewards.TABLE, *actions.EPISODE_TABLE)
)
"""Every modifier by its name: what `modifiers=` and `-m` take."""


# Modifiers as people write them: texts as on the command line, mappings as in YAML; and messages about wrong ones.

Written: TypeAlias = str | Mapping[str, Any] | Modifier
"""A modifier as people write it: `"sticky=0.25"`, `{"distractors": {"count": 3}}`, or one that was read before."""
_NAMED = re.compile(r"([a-z_]+)=(?!=)(.*)", re.DOTALL)
_FIRST = ""
"""Stands for the name of the first argument."""


def modifier(written: Written) -> Modifier:
    """Return a modifier with all that it was given: its first argument, and others where they differ from their defaults.

    Raises:
        SpecError: E718 for one that does not exist, E719 for its arguments.
    """
    name, given = _taken_apart(written)
    entry = MODIFIERS.get(name)
    if entry is None:
        hint = suggest(name, MODIFIERS) or f"there are {', '.join(MODIFIERS)}"
        raise spec_error("E718", f"there is no modifier '{name}'", hint)
    return Modifier(name, tuple(_bound(entry, given)))


def arguments(entry: ModifierEntry, bound: Modifier) -> dict[str, Any]:
    return {a.name: a.default for a in entry.arguments} | dict(bound.arguments)


def _taken_apart(written: Written) -> tuple[str, dict[str, Any]]:
    match written:
        case Modifier():
            return written.name, dict(written.arguments)
        case str():
            name, sign, rest = written.partition("=")
            return name.strip(), _texts(written, rest) if sign else {}
        case Mapping() if len(written) == 1:
            ((name, value),) = written.items()
            if isinstance(value, Mapping):
                return str(name), dict(value)
            return str(name), {} if value is None else {_FIRST: value}
        case _:
            hint = 'for example "sticky=0.25" or {"sticky": 0.25}'
            raise spec_error("E718", f"this is not a modifier: {written!r}", hint)


def _texts(written: str, rest: str) -> dict[str, str]:
    texts: list[str] = []
    for part in rest.split(","):
        if texts and len(re.findall(r"[([{]", texts[-1])) > len(re.findall(r"[)\]}]", texts[-1])):
            texts[-1] += f",{part}"
        else:
            texts.append(part)
    given: dict[str, str] = {}
    for i, part in enumerate(texts):
        named = _NAMED.fullmatch(part.strip())
        if named is None and i:
            _refuse(written, f"'{part.strip()}' is not of the form name=value")
        given |= {_FIRST: part} if named is None else {named[1]: named[2]}
    return given


def _bound(entry: ModifierEntry, given: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    names = all_names(entry.arguments)
    if _FIRST in given and not names:
        _refuse(entry.name, "it has no arguments")
    given = {name or names[0]: value for name, value in given.items()}
    for name in given:
        if name not in names:
            known = ", ".join(names) or "no arguments"
            _refuse(entry.name, f"it has no argument '{name}'", suggest(str(name), names) or f"it has {known}")
    for i, argument in enumerate(entry.arguments):
        if argument.name not in given and argument.default is None:
            _refuse(entry.name, f"'{argument.name}' is missing: {argument.doc}", f"it is {argument.range}")
        asked = given.get(argument.name, argument.default)
        try:
            value = argument.read(asked)
        except ValueError as error:
            _refuse(entry.name, f"'{argument.name}' is {error}, not {asked!r}")
        if i == 0 or value != argument.default:
            yield argument.name, value


def _refuse(name: str, message: str, hint: str | None = None) -> NoReturn:
    raise spec_error("E719", f"the modifier {name}: {message}", hint)


# Tasks with modifiers.


def modify(task: Task, *modifiers: Written) -> Task:
    """Apply modifiers to a task, one after the other.

    Args:
        task: the task; `taskspec.load(id, modifiers=[...])` is the same of an id or a path.
        *modifiers: texts as on the command line (`"distractors=3,kind=normal"`), mappings as in YAML
            (`{"distractors": {"count": 3, "kind": "normal"}}`, `{"sticky": 0.25}`), or another task's `Task.modifiers`.

    An expert that is written out stays where the best policies do; one that is planned is planned for the changed task. Claims
    and examples are about the task as written, and go, except with `absorbing` and `time_observed`.

    Returns:
        Another task; the given one stays the same.

    Raises:
        SpecError: E718 for an unknown modifier, E719 for wrong arguments, E720 for one that the task cannot be given.
    """
    if not isinstance(task, Task):
        raise spec_error("E701", f"`modify` takes a task, not {task!r}", "`taskspec.load` gives one")
    for written in modifiers:
        task = _modified(task, modifier(written))
    return task


def with_options(task: Task, ending: Ending, observe_time: bool) -> Task:
    asked = {"absorbing": ending == "absorb", "time_observed": observe_time}
    return modify(task, *(name for name, wanted in asked.items() if wanted))


def is_as_written(task: Task) -> bool:
    """Test whether statements of a spec about its task (claims, examples, accepted warnings) apply to this task, too."""
    return all(MODIFIERS[m.name].claims for m in task.modifiers)


def keeps_observers(task: Task, *modifiers: Written) -> bool:
    """Return whether modifiers keep the returns of those who see the observations of a task alone, too, as the table says it.

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
    """Modify the finite stand-in of a task alike; None where modifiers leave it none."""
    entries = [(m, MODIFIERS[m.name]) for m in task.modifiers]
    ways = [(m, entry.abstraction(arguments(entry, m))) for m, entry in entries]
    if any(way == "lost" for _, way in ways):
        return None
    return modify(unmodified, *(m for m, way in ways if way == "modified as well"))


def sentences(task: Task) -> Iterator[tuple[Modifier, str]]:
    """Describe each modifier of a task, in Markdown with mathematics."""
    before = task.unmodified
    for each in task.modifiers:
        entry = MODIFIERS[each.name]
        yield each, entry.says(before, arguments(entry, each))
        before = _modified(before, each)


def _modified(task: Task, given: Modifier) -> Task:
    entry = MODIFIERS[given.name]
    values = arguments(entry, given)
    try:
        for earlier in task.modifiers:
            if entry.time_limit == "changed" and MODIFIERS[earlier.name].time_limit == "read":
                reason = f"'{earlier}' depends on when episodes end"
                raise Inapplicable(reason, "give the horizon before other modifiers")
        changed = entry.change(task.new_builder(), task, values)
    except Refused as refused:  # by the modifier, or by a limit of vectors or of ints
        message = f"{task.id} cannot be given '{given}': {refused.message}"
        raise spec_error("E720", message, refused.hint) from None
    if changed is task:  # it was as the modifier makes it
        return task
    if not entry.claims:
        changed = changed.with_annotations(claims=(), examples=())
        if KEPT.index(entry.kept(task, values)) > KEPT.index("best policies"):
            changed = forgetting(changed)
    content_hash = hashlib.sha256(f"{task.content_hash}+{given}".encode()).hexdigest()
    source = replace(changed.source, content_hash=content_hash)
    return replace(changed, source=source, modifiers=(*task.modifiers, given), written_as=task.unmodified)


def _reduce(task: Task) -> tuple[Any, ...]:
    if not task.modifiers:
        return reduce_task(task)
    return _unpickled, (*reduce_task(task.unmodified), task.modifiers, task.annotations.remembers)


def _unpickled(
    unmodified: Callable[..., Task], given: tuple[Any, ...], modifiers: tuple[Modifier, ...], remembers: bool
) -> Task:
    task = modify(unmodified(*given), *modifiers)
    if remembers:
        return task.remembering()
    return task


copyreg.pickle(Task, _reduce)  # in the place of what `build` registers for tasks without modifiers
