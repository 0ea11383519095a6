"""Settings of a learner that a file changes, checked against its dataclasses, each with its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.source import Document, Path

T = TypeVar("T")
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", NoneType: "null"}


def changed(base: T, document: Document, path: Path) -> T:
    """A configuration with the settings that stand at a path of a document laid over it, section by section.

    Raises:
        SpecError: with every mistake: E201 for what is no mapping, E202 for an unknown setting, E204 and E206 for its value.
    """
    data: Any = document.data
    for step in path:
        data = data[step]
    problems: list[Diagnostic] = []
    found = _changed(base, data, document, path, problems)
    if problems:
        raise SpecError(problems)
    return found  # type: ignore[no-any-return]


def _changed(base: Any, data: Any, document: Document, path: Path, problems: list[Diagnostic]) -> Any:
    if not isinstance(data, dict):
        problems.append(Diagnostic("E201", document.span(path), "settings are a mapping: `name: value`"))
        return base
    hints, found = _hints(type(base)), {}
    for name, value in data.items():
        place = (*path, name)
        if name not in hints:
            message = f"{type(base).__name__} has no setting '{name}'"
            hint = suggest(name, hints) or f"it has {', '.join(hints)}"
            problems.append(Diagnostic("E202", document.key_span(place), message, hint))
            continue
        now = getattr(base, name)
        section = next((t for t in _options(hints[name]) if is_dataclass(t)), None)
        if section is not None and value is not None:
            found[name] = _changed(now if now is not None else section(), value, document, place, problems)  # type: ignore[operator]
        elif (fitting := list(_fitting(hints[name], value))) != []:
            found[name] = fitting[0]
        else:
            problems.append(_unfit(hints[name], value, document, place))
    return replace(base, **found)


def _unfit(hint: Any, value: Any, document: Document, place: Path) -> Diagnostic:
    words = [repr(word) for option in _options(hint) if get_origin(option) is Literal for word in get_args(option)]
    if words:
        return Diagnostic("E206", document.span(place), f"{value!r} is not one of {', '.join(words)}")
    kinds = [_KINDS.get(option, "a list of numbers") for option in _options(hint)]
    return Diagnostic("E204", document.span(place), f"{value!r} is not {' or '.join(kinds)}")


def _fitting(hint: Any, value: Any) -> Iterator[Any]:
    """The value as one of the types that are allowed."""
    for option in _options(hint):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if get_origin(option) is Literal and value in get_args(option):
            yield value
        elif get_origin(option) is tuple and isinstance(value, list):
            of = get_args(option)
            each = [list(_fitting(of[0], v)) for v in value]
            if all(each) and (of[-1] is Ellipsis or len(of) == len(value)):
                yield tuple(v[0] for v in each)
        elif option is float and number:
            yield float(value)
        elif (option is int and number and isinstance(value, int)) or (option is bool and isinstance(value, bool)):
            yield value
        elif option is NoneType and value is None:
            yield None


def _options(hint: Any) -> tuple[Any, ...]:
    """The types of a union; a single one by itself."""
    return (hint,) if isinstance(hint, type) or get_origin(hint) in (tuple, Literal) else get_args(hint)


def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in fields(kind)}
