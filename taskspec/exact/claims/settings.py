"""What is wrong with the parameter values that a claim or an example is about, said where they stand in its `for:`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from taskspec.diagnostics import Diagnostic, Span, SpecError
from taskspec.source import Path
from taskspec.task.merge import Merged, merge
from taskspec.task.task import Task

_CODES = {"claims": "E603", "examples": "E613"}


def wrong_setting(task: Task, section: str, number: int, case: Mapping[str, Any], error: SpecError) -> Diagnostic:
    """The first thing that is wrong with the values of a case.

    Args:
        section, number: `claims` or `examples`, and which of them.
        error: what building the task with these values came to.
    """
    found = error.diagnostics[0]
    span = _place(
        merge(task.document, task.variant), (section, number, "for") if case else (section, number), case, found
    )
    return Diagnostic(_CODES[section], span, found.message, found.hint)


def _place(merged: Merged, path: Path, case: Mapping[str, Any], found: Diagnostic) -> Span:
    """The name of a parameter that is not there, a value that it cannot have, or all that is given."""
    for start, name in _names(merged, path) if case else ():
        if name in case and f"has no parameter '{name}'" in found.message:
            return merged.key_span((*start, name))
        if name in case and found.message.startswith(f"parameter {name} "):
            for at in _values(merged, (*start, name), case[name]):
                return merged.span(at)
    return merged.key_span(path)


def _names(merged: Merged, path: Path) -> Iterator[tuple[Path, str]]:
    """Every parameter of `for:`, with the path of the mapping in which it stands."""
    grid = merged.data[str(path[0])][path[1]]["for"]
    entries = [((*path, i), entry) for i, entry in enumerate(grid)] if isinstance(grid, list) else [(path, grid)]
    yield from ((start, name) for start, entry in entries for name in entry)


def _values(merged: Merged, path: Path, value: Any) -> Iterator[Path]:
    """Where a value stands among those of a parameter."""
    written: Any = merged.data
    for step in path:
        written = written[step]
    if not isinstance(written, list):
        yield from [path] if written == value else []
    elif value in written:
        yield (*path, written.index(value))
