"""Modifiers as people write them: texts as on the command line, mappings as in YAML; and what is said of wrong ones."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn, TypeAlias

from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.modifiers.entry import ModifierArgument, ModifierEntry
from taskspec.modifiers.table import MODIFIERS
from taskspec.task.task import Modifier

Written: TypeAlias = str | Mapping[str, Any] | Modifier
"""A modifier as people write it: `"sticky=0.25"`, `{"distractors": {"count": 3}}`, or one that was read before."""
_NAMED = re.compile(r"([a-z_]+)=(?!=)(.*)", re.DOTALL)
_FIRST = ""
"""Stands for the name of the first argument."""


def modifier(written: Written) -> Modifier:
    """A modifier with all that it was given: its first argument, and others where they differ from their defaults.

    Raises:
        SpecError: E718 for one that does not exist, E719 for its arguments.
    """
    name, given = _taken_apart(written)
    entry = MODIFIERS.get(name)
    if entry is None:
        hint = suggest(name, MODIFIERS) or f"there are {', '.join(MODIFIERS)}"
        raise SpecError([Diagnostic("E718", None, f"there is no modifier '{name}'", hint)])
    return Modifier(name, tuple(_bound(entry, given)))


def arguments(entry: ModifierEntry, bound: Modifier) -> dict[str, Any]:
    """All arguments of a modifier that was read."""
    return {a.name: a.default for a in entry.arguments} | dict(bound.arguments)


def _open(text: str) -> bool:
    """Whether a text has brackets that are not closed."""
    return sum(text.count(c) for c in "([{") > sum(text.count(c) for c in ")]}")


def _taken_apart(written: Written) -> tuple[str, dict[str, Any]]:
    """Name and arguments."""
    match written:
        case Modifier():
            return written.name, dict(written.arguments)
        case str():
            name, sign, rest = written.partition("=")
            return name.strip(), dict(_texts(written, rest)) if sign else {}
        case Mapping() if len(written) == 1:
            ((name, value),) = written.items()
            given = {} if value is None else dict(value) if isinstance(value, Mapping) else {_FIRST: value}
            return str(name), given
        case _:
            hint = 'for example "sticky=0.25" or {"sticky": 0.25}'
            raise SpecError([Diagnostic("E718", None, f"this is not a modifier: {written!r}", hint)])


def _texts(written: str, rest: str) -> Iterator[tuple[str, str]]:
    """The arguments of a text, by name."""
    for i, part in enumerate(_split(rest)):
        named = _NAMED.fullmatch(part.strip())
        if named is None and i:
            _refuse(written, f"'{part.strip()}' is not of the form name=value")
        yield (_FIRST, part) if named is None else (named[1], named[2])


def _split(text: str) -> list[str]:
    """Parts between the commas that stand outside of brackets."""
    found: list[str] = []
    for part in text.split(","):
        if found and _open(found[-1]):
            found[-1] += f",{part}"
        else:
            found.append(part)
    return found


def _bound(entry: ModifierEntry, given: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The arguments that are kept, in the order of the table."""
    names = [a.name for a in entry.arguments]
    if _FIRST in given and not names:
        _refuse(entry.name, "it has no arguments")
    given = {name or names[0]: value for name, value in given.items()}
    for name in given:
        if name not in names:
            known = f"it has {', '.join(names)}" if names else "it has no arguments"
            _refuse(entry.name, f"it has no argument '{name}'", suggest(str(name), names) or known)
    for i, argument in enumerate(entry.arguments):
        if argument.name not in given and argument.default is None:
            _refuse(entry.name, f"'{argument.name}' is missing: {argument.doc}", f"it is {argument.range}")
        value = _read(entry, argument, given.get(argument.name, argument.default))
        if i == 0 or value != argument.default:
            yield argument.name, value


def _read(entry: ModifierEntry, argument: ModifierArgument, value: Any) -> Any:
    try:
        return argument.read(value)
    except ValueError as error:
        _refuse(entry.name, f"'{argument.name}' is {error}, not {value!r}")


def _refuse(name: str, message: str, hint: str | None = None) -> NoReturn:
    raise SpecError([Diagnostic("E719", None, f"the modifier {name}: {message}", hint)])
