"""Variants: a spec with the overrides of one variant laid over it, every value still knowing its place in the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from taskspec.diagnostics import Diagnostic, Span, SpecError, suggest
from taskspec.scan import REQUIRED, task_name
from taskspec.source import Document, Path

NAMED = (
    "parameters", "constants", "definitions", "noise", "state", "action", "observation", "initial", "dynamics",
    "accept",
)  # fmt: skip
"""Sections of named entries, which a variant overrides entry by entry."""

FIELDED = ("parameters", "state", "action")
"""Sections whose entries have fields, which a variant overrides field by field."""

_DROPPED = ("variants", "base")
_NOT_ABSTRACT = ("abstraction", "observation", "claims", "figure")


@dataclass(frozen=True)
class Merged:
    """The data of one variant (or of the spec itself), and where in the document each part was written."""

    document: Document
    name: str
    variant: str | None
    data: dict[str, Any]
    moved: dict[Path, Path]

    def source_path(self, path: Path) -> Path:
        """The path in the document of a path in the merged data."""
        for n in range(len(path), 0, -1):
            if path[:n] in self.moved:
                return (*self.moved[path[:n]], *path[n:])
        return path

    def span(self, path: Path, start: int | None = None, end: int | None = None) -> Span:
        return self.document.span(self.source_path(path), start, end)

    def key_span(self, path: Path) -> Span:
        return self.document.key_span(self.source_path(path))

    @property
    def missing(self) -> list[str]:
        """Required sections that are not there: such a spec is only a base for its variants."""
        return [section for section in REQUIRED if section not in self.data]


def variant_names(data: dict[str, Any]) -> dict[str, str | None]:
    """Task names of a document, each with its variant: the spec itself (None) and every variant."""
    name = str(data.get("name", ""))
    names: dict[str, str | None] = {name: None}
    variants = data.get("variants")
    for key in variants if isinstance(variants, dict) else ():
        names[task_name(name, str(key))] = str(key)
    return names


def merge(document: Document, variant: str | None = None) -> Merged:
    """The spec with a variant's overrides (by key or by task name).

    Raises:
        SpecError: when there is no such variant, or variants are based on each other in a circle.
    """
    data: dict[str, Any] = document.data
    name = str(data.get("name", ""))
    base = {key: value for key, value in data.items() if key not in _DROPPED}
    if variant is None or variant == name:
        return Merged(document, name, None, base, {})
    chain = list(_chain(document, data, _key(document, data, name, variant)))
    merged = base
    moved: dict[Path, Path] = {}
    for key in reversed(chain):
        merged = _overlay(merged, data["variants"][key] or {}, key, moved)
    return Merged(document, task_name(name, chain[0]), chain[0], merged, moved)


def abstracted(merged: Merged) -> Merged | None:
    """The finite stand-in that a spec declares, as a spec of its own; None when it declares none.

    The sections under `abstraction` (all but `map`) replace those of the same name.
    """
    over = merged.data.get("abstraction")
    if not over:
        return None
    data = {key: value for key, value in merged.data.items() if key not in _NOT_ABSTRACT}
    moved = dict(merged.moved)
    for section, value in over.items():
        if section != "map" and value is not None:
            data[section] = value
            _move(moved, (section,), merged.source_path(("abstraction", section)))
    return Merged(merged.document, merged.name, merged.variant, data, moved)


def _key(document: Document, data: dict[str, Any], name: str, variant: str) -> str:
    keys = {str(key): str(key) for key in data.get("variants") or {}}
    keys |= {task_name(name, key): key for key in keys}
    if variant in keys:
        return keys[variant]
    listed = ", ".join(data.get("variants") or {}) or "none"
    message = f"{name} has no variant '{variant}'; it has: {listed}"
    raise SpecError([Diagnostic("E211", document.span(("name",)), message, suggest(variant, keys))])


def _chain(document: Document, data: dict[str, Any], key: str) -> Iterator[str]:
    """A variant, the one it is based on, and so on."""
    name, seen = str(data.get("name", "")), set()
    current: str | None = key
    while current is not None:
        seen.add(current)
        yield current
        base = (data["variants"][current] or {}).get("base")
        current = None if base is None else _key(document, data, name, str(base))
        if current in seen:
            span = document.span(("variants", key, "base"))
            raise SpecError([Diagnostic("E212", span, "these variants are based on each other in a circle")])


def _overlay(base: dict[str, Any], over: dict[str, Any], key: str, moved: dict[Path, Path]) -> dict[str, Any]:
    """`base` with one variant's sections laid over it; `moved` records where they came from."""
    result = dict(base)
    for section, value in over.items():
        here: Path = ("variants", key, section)
        if section in _DROPPED:
            continue
        if value is None:
            result.pop(section, None)
        elif section in NAMED and isinstance(value, dict) and isinstance(result.get(section), dict):
            result[section] = _entries(section, result[section], value, here, moved)
        else:
            result[section] = value
            _move(moved, (section,), here)
    return result


def _move(moved: dict[Path, Path], path: Path, here: Path) -> None:
    """Record that everything at a path now comes from `here`, and forget what was known below it."""
    for old in [p for p in moved if p[: len(path)] == path]:
        del moved[old]
    moved[path] = here


def _entries(
    section: str, base: dict[str, Any], over: dict[str, Any], here: Path, moved: dict[Path, Path]
) -> dict[str, Any]:
    result = dict(base)
    for name, value in over.items():
        path, place = (section, name), (*here, name)
        old = result.get(name)
        if value is None:
            result.pop(name, None)
        elif section in FIELDED and isinstance(value, dict) and isinstance(old, dict):
            result[name] = {k: v for k, v in (old | value).items() if v is not None}
            for field in value:
                _move(moved, (*path, field), (*place, field))
        else:
            result[name] = value
            _move(moved, path, place)
    return result
