"""Every small change of a spec: of one token of an expression, of one entry, row, label or bound.

What readers read (titles, prose, symbols, figures) is left as it is, and so are claims and examples: they are what a change
is held against.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from taskspec.base.diagnostics import Span
from taskspec.language.source import Document, Path, read_text
from taskspec.language.task.merge import FIELDED
from tests.verification.spec_changes.text_changes import Replacements, changes, off_by_one

CHANGED = (
    *FIELDED, "definitions", "noise", "initial", "dynamics", "constants", "observation", "expert", "reward", "terminal",
    "absorbing_reward", "discount", "horizon", "map", "abstraction",
)  # fmt: skip
"""Sections that are changed, those of an abstraction included."""
PRIMES = ("definitions", "dynamics", "reward", "terminal")  # sections in which a prime has a meaning
OPTIONAL = ("observation", "terminal", "absorbing_reward", "discount", "expert", "abstraction")
KEPT = frozenset({"doc", "symbol", "symbols", "message", "alias", "space", "grid"})
"""Keys whose values are for readers, or are of a form without small changes."""
_TYPES = {"int": "real", "real": "int", "bool": "int"}
MISSING = object()
EXCHANGED = "(exchanged)"


@dataclass(frozen=True, slots=True)
class Mutant:
    """A changed spec: where it was changed, the words there before and after, and the whole data."""

    path: Path
    place: Span
    before: str
    after: str
    data: Any
    others: Mapping[str, Document] = field(default_factory=dict)
    """What the spec extends."""

    @property
    def section(self) -> str:
        """The section that was changed, that of a variant without the variant."""
        return str(self.path[2] if self.path[0] == "variants" else self.path[0])

    @property
    def renumbers(self) -> bool:
        """True if it lists the labels of a choice in another order, and does nothing else."""
        return self.path[-2:-1] == ("values",) and isinstance(self.path[-1], int) and self.after == EXCHANGED

    def document(self) -> Document:
        """Return the changed spec as a document. Its places are those of a text that nobody has written."""
        return read_text(written(self.data), "mutant", self.others)


def mutants(document: Document) -> Iterator[Mutant]:
    """Yield every change of a spec, in the order of the file's sections; what it extends stays as it is."""
    walk = _Walk(document)
    yield from walk.sections(document.data, (), OPTIONAL)
    for key, variant in (document.data.get("variants") or {}).items():
        yield from walk.sections(variant or {}, ("variants", key), CHANGED)


class _Walk:
    """Goes through one document; every method gives the mutants of one part of it."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.alike = _alike(document.data)
        self.states = frozenset(name for data in _specs(document.data) for name in data.get("state") or {})

    def changed(self, path: Path, value: Any, before: str, after: str, place: Span | None = None) -> Mutant:
        data = _replaced(self.document.data, path, value)
        return Mutant(path, place or self.document.span(path), before, after, data, self.document.others)

    def without(self, path: Path) -> Mutant:
        return self.changed(path, MISSING, str(path[-1]), "(left out)", self.document.key_span(path))

    def exchanged(self, path: Path, one: Any, other: Any) -> Iterator[Mutant]:
        """Yield the values under two keys of a mapping, or two items of a list, exchanged."""
        here: Any = self.document.data
        for step in path:
            here = here[step]
        if here[one] == here[other]:
            return
        data = _replaced(_replaced(self.document.data, (*path, one), here[other]), (*path, other), here[one])
        names = [one, other]
        if isinstance(here, list):  # an item is named by itself where it is short
            names = [here[i] if isinstance(here[i], str | int | float) else f"item {i}" for i in names]
        words = " and ".join(map(str, names))
        place = self.document.key_span((*path, one))
        yield Mutant((*path, one), place, words, EXCHANGED, data, self.document.others)

    def sections(self, data: Mapping[str, Any], path: Path, optional: Sequence[str]) -> Iterator[Mutant]:
        """Yield changes of the sections of a spec, of a variant, or of an abstraction; those that are optional are left out."""
        for section, value in data.items():
            if section not in CHANGED or value is None:
                continue
            here = (*path, section)
            if section == "abstraction":
                yield from self.sections(value, here, OPTIONAL)
            else:
                yield from self.values(value, here, section)
            if section in optional:
                yield self.without(here)

    def values(self, value: Any, path: Path, section: str) -> Iterator[Mutant]:
        """Yield changes of a value, and of all that is in it."""
        match value:
            case dict():
                keys = [key for key in value if key not in KEPT and value[key] is not None]
                yield from self._entries(value, keys, path, section)
            case list():
                yield from self._entries(value, list(range(len(value))), path, section)
            case bool():
                yield self.changed(path, not value, str(value).lower(), str(not value).lower())
            case int() | float():
                yield from self._number(value, path)
            case str() if path[-1] == "type":
                if value in _TYPES:
                    yield self.changed(path, _TYPES[value], value, _TYPES[value])
            case str() if path[-2:-1] != ("values",):
                yield from self._expression(value, path)

    def _entries(self, entries: Any, keys: list[Any], path: Path, section: str) -> Iterator[Mutant]:
        """Yield entries, rows, items or labels that are changed, left out, or exchanged with their neighbours.

        Neither declarations nor their fields are exchanged.
        """
        for key in keys:
            here = (*path, key)
            yield from self.values(entries[key], here, section)
            if key not in ("type", "default"):
                yield self.without(here)
        if section not in FIELDED or path[-1] == "values":
            for one, other in pairwise(keys):
                yield from self.exchanged(path, one, other)

    def _expression(self, text: str, path: Path) -> Iterator[Mutant]:
        in_step = any(step in PRIMES for step in path)
        names = Replacements(self.alike, self.states if in_step else frozenset())
        for change in changes(text, names):
            end = max(change.end, min(change.start + 1, len(text)))
            place = self.document.span(path, change.start, end)
            before = text[change.start : change.end]
            yield self.changed(path, change.apply(text), before, change.new or "(left out)", place)

    def _number(self, value: int | float, path: Path) -> Iterator[Mutant]:
        text = self.document.text(path)
        digits = text.lstrip("+-")
        sign = "-" * text.startswith("-")
        if math.isfinite(value) and digits[0].isdigit():
            for new in off_by_one(digits):
                yield self.changed(path, type(value)(float(sign + new)), text, sign + new)
        if value:
            yield self.changed(path, -value, text, f"{-value:g}")


def _specs(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return a spec, its variants, and the abstractions of all of them."""
    whole = [data, *((data.get("variants") or {}).values())]
    found = [each for each in whole if isinstance(each, dict)]
    return found + [each["abstraction"] for each in found if isinstance(each.get("abstraction"), dict)]


def _alike(data: Mapping[str, Any]) -> dict[str, list[str]]:
    """For every component, parameter and label those that have its type."""
    groups: dict[str, dict[str, None]] = {}
    for spec in _specs(data):
        for section in FIELDED:
            for name, entry in (spec.get(section) or {}).items():
                if not isinstance(entry, dict):
                    continue
                labels = list(map(str, entry.get("values") or ()))
                groups.setdefault(f"labels {name}", {}).update(dict.fromkeys(labels))
                if "type" in entry:
                    kind = f"{entry['type']} {entry.get('shape') or []} {labels}"
                    groups.setdefault(kind, {})[name] = None
    alike: dict[str, list[str]] = {}
    for group in groups.values():
        for name in group:
            known = alike.setdefault(name, [])
            known += [other for other in group if other != name and other not in known]
    return alike


def _replaced(data: Any, path: Path, value: Any) -> Any:
    """Return the same data with another value at a path, or without it."""
    changed = copy.copy(data)
    inner = changed
    for step in path[:-1]:
        inner[step] = copy.copy(inner[step])
        inner = inner[step]
    if value is MISSING:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return changed


def written(data: Any) -> str:
    """Return data as YAML that reads as the same data."""
    match data:
        case dict():
            return "{" + ", ".join(f"{json.dumps(k)}: {written(v)}" for k, v in data.items()) + "}"
        case list():
            return "[" + ", ".join(map(written, data)) + "]"
        case float() if not math.isfinite(data):
            return f"{data:+}".replace("+", "").replace("inf", ".inf").replace("nan", ".nan")
        case _:
            return json.dumps(data)
