"""Variants: a spec with the overrides of one variant laid over it, every value still knowing its place in the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
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

_OF_ANY_TYPE = ("default", "shape", "symbol", "doc", "alias")
_DROPPED = ("variants", "base")
_NOT_ABSTRACT = ("abstraction", "observation", "claims", "examples", "accept", "figure", "info")


@dataclass(frozen=True)
class Merged:
    """The data of one variant (or of the spec itself), and where in the document each part was written."""

    document: Document
    name: str
    variant: str | None
    data: dict[str, Any]
    moved: dict[Path, Path]
    strays: tuple[Path, ...] = ()
    """Entries that the variant changes or removes, though what it is based on has nothing of the name."""

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
    name = str(document.data.get("name", ""))
    if variant is None or variant == name:
        return _overlaid(document, None)
    for key in reversed(list(_chain(document, _key(document, variant)))):
        merged = _overlaid(document, key)  # each finds what it is based on done
    return merged


@lru_cache(maxsize=512)
def _overlaid(document: Document, variant: str | None) -> Merged:
    """A spec without its variants, or a variant laid over what it is based on."""
    name = str(document.data.get("name", ""))
    if variant is None:
        return Merged(document, name, None, {k: v for k, v in document.data.items() if k not in _DROPPED}, {})
    over = document.data["variants"][variant] or {}
    base = _overlaid(document, _base(document, variant))
    overlay = _Overlay(dict(base.data), dict(base.moved), variant)
    overlay.lay(over)
    strays = (*base.strays, *overlay.strays)
    return Merged(document, task_name(name, variant), variant, overlay.data, overlay.moved, strays)


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


def _key(document: Document, variant: str) -> str:
    """The key of a variant that is given by its key or by the name of its task."""
    name = str(document.data.get("name", ""))
    variants: dict[str, Any] = document.data.get("variants") or {}
    if variant in variants:
        return variant
    keys = {task_name(name, key): key for key in variants}
    if variant in keys:
        return keys[variant]
    message = f"{name} has no variant '{variant}'; it has: {', '.join(variants) or 'none'}"
    hint = suggest(variant, [*variants, *keys])
    raise SpecError([Diagnostic("E211", document.span(("name",)), message, hint)])


def _base(document: Document, variant: str) -> str | None:
    """The variant that a variant says it is based on; None for the spec itself."""
    base = (document.data["variants"][variant] or {}).get("base")
    return None if base is None else _key(document, str(base))


def _chain(document: Document, variant: str) -> Iterator[str]:
    """A variant, the one it is based on, and so on."""
    seen: set[str] = set()
    current: str | None = variant
    while current is not None:
        if current in seen:
            span = document.span(("variants", variant, "base"))
            raise SpecError([Diagnostic("E212", span, "these variants are based on each other in a circle")])
        seen.add(current)
        yield current
        current = _base(document, current)


class _Overlay:
    """One variant being laid over `data`; `moved` records where each part was written.

    `strays` are the entries that it changes or removes though there is nothing of the name.
    """

    def __init__(self, data: dict[str, Any], moved: dict[Path, Path], variant: str) -> None:
        self.data, self.moved, self.variant = data, moved, variant
        self.strays: list[Path] = []

    def lay(self, over: dict[str, Any]) -> None:
        for section, value in over.items():
            if section in _DROPPED:
                continue
            if value is not None and section in NAMED:
                self.data[section] = self._entries(section, value)
                continue
            self._written((section,))
            if value is None:
                self.data.pop(section, None)
            else:
                self.data[section] = value

    def _entries(self, section: str, over: dict[str, Any]) -> dict[str, Any]:
        if section not in self.data:
            self._written((section,))
        result = dict(self.data.get(section) or {})
        for name, value in over.items():
            path, old = (section, name), result.get(name)
            fields = section in FIELDED and isinstance(value, dict)
            if name not in result and (value is None or (fields and "type" not in value)):
                self.strays.append(path)
            if fields and isinstance(old, dict):
                result[name] = _without_nulls(_kept(old, value) | value)
                for field in value:
                    self._written((*path, field))
                continue
            self._written(path)
            if value is None:
                result.pop(name, None)
            else:
                result[name] = _without_nulls(value) if fields else value
        return result

    def _written(self, path: Path) -> None:
        """Everything at a path was written in this variant."""
        _move(self.moved, path, ("variants", self.variant, *path))


def _kept(old: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """What an entry keeps when some of its keys are overridden: of another type, what does not hang on the type."""
    if over.get("type", old.get("type")) == old.get("type"):
        return old
    return {key: value for key, value in old.items() if key in _OF_ANY_TYPE}


def _without_nulls(entry: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entry.items() if value is not None}


def _move(moved: dict[Path, Path], path: Path, here: Path) -> None:
    """Record that everything at a path now comes from `here`, and forget what was known below it."""
    for old in [p for p in moved if p[: len(path)] == path]:
        del moved[old]
    moved[path] = here
