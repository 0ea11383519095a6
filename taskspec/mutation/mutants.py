"""Every small change of a spec: of one token of an expression, of one entry, row, label or bound.

What readers read (titles, prose, symbols, figures) is left as it is, and so are claims and examples: they are what a change
is held against.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from taskspec.base.diagnostics import Span
from taskspec.mutation.text_changes import Replacements, changes, off_by_one
from taskspec.source import Document, Path, read_text
from taskspec.task.merge import FIELDED

EXPRESSIONS = ("definitions", "noise", "initial", "dynamics", "constants", "observation", "expert")
"""Sections that map names to expressions."""
SINGLE = ("reward", "terminal", "absorbing_reward", "discount", "horizon")
PRIMES = ("definitions", "dynamics", "reward", "terminal")
"""Sections in which a prime has a meaning."""
OPTIONAL = ("observation", "terminal", "absorbing_reward", "discount", "expert", "abstraction")
_TYPES = {"int": "real", "real": "int", "bool": "int"}
_FORM_KEYS = frozenset({"if", "then", "else", "by", "rows", "space", "value", "low", "high", "grid", "legend"})
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
    yield from walk.spec(document.data, ())
    for key, variant in (document.data.get("variants") or {}).items():
        for section in variant or {}:
            if section in (*EXPRESSIONS, *SINGLE, *FIELDED, "abstraction"):
                yield walk.without(("variants", key, section))
        yield from walk.spec(variant or {}, ("variants", key))


class _Walk:
    """Goes through one document; every method gives the mutants of one part of it."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.alike = _alike(document.data)
        self.states = frozenset(name for data in _specs(document.data) for name in data.get("state") or {})

    def mutant(self, path: Path, place: Span, before: str, after: str, data: Any) -> Mutant:
        return Mutant(path, place, before, after, data, self.document.others)

    def changed(self, path: Path, value: Any, before: str, after: str) -> Mutant:
        data = _replaced(self.document.data, path, value)
        return self.mutant(path, self.document.span(path), before, after, data)

    def without(self, path: Path) -> Mutant:
        data = _replaced(self.document.data, path, MISSING)
        return self.mutant(path, self.document.key_span(path), str(path[-1]), "(left out)", data)

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
        yield self.mutant((*path, one), self.document.key_span((*path, one)), words, EXCHANGED, data)

    def spec(self, data: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        """Yield all sections of a spec, of a variant, or of an abstraction."""
        for section, value in data.items():
            here = (*path, section)
            if value is None:
                continue
            if section in FIELDED:
                yield from self._components(value, here)
            elif section in EXPRESSIONS and isinstance(value, dict) and not (section == "expert" and "rows" in value):
                yield from self._entries(value, here)
            elif section in SINGLE or section in EXPRESSIONS:
                yield from self.expression(value, here)
            elif section == "abstraction":
                yield from self.spec(value, here)
            elif section == "map":
                yield from self._entries(value, here)
            if section in OPTIONAL and len(path) != 2:
                yield self.without(here)

    def _entries(self, entries: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        names = [name for name in entries if name != "space"]
        for name in names:
            if entries[name] is not None:
                yield from self.expression(entries[name], (*path, name))
                yield self.without((*path, name))
        for one, other in pairwise(names):
            yield from self.exchanged(path, one, other)

    def _components(self, entries: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        for name, entry in entries.items():
            here = (*path, name)
            if name == "require":
                for i, item in enumerate(entry):
                    yield from self.expression(item["condition"], (*here, i, "condition"))
                    yield self.without((*here, i))
            elif entry is not None:
                yield from self._component(entry, here)
                yield self.without(here)

    def _component(self, entry: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        for key, value in entry.items():
            here = (*path, key)
            match key:
                case "type" if value in _TYPES:
                    yield self.changed(here, _TYPES[value], value, _TYPES[value])
                case "default" | "initial" | "next":
                    yield from self.expression(value, here)
                case "low" | "high" | "shape":
                    yield from self.expression(value, here)
                    yield self.without(here)
                case "values":
                    yield from self._labels(value, here)

    def _labels(self, labels: Any, path: Path) -> Iterator[Mutant]:
        if isinstance(labels, dict):
            keys = list(labels)
        else:
            keys = list(range(len(labels)))
        for key in keys:
            if isinstance(labels, dict):
                yield from self.expression(labels[key], (*path, key))
            yield self.without((*path, key))
        for one, other in pairwise(keys):
            yield from self.exchanged(path, one, other)

    def expression(self, value: Any, path: Path) -> Iterator[Mutant]:  # noqa: C901
        """Yield changes of an expression in any of its forms."""
        match value:
            case bool():
                yield self.changed(path, not value, str(value).lower(), str(not value).lower())
            case int() | float():
                yield from self._number(value, path)
            case str():
                in_step = any(step in PRIMES for step in path)
                names = Replacements(self.alike, self.states if in_step else frozenset())
                for change in changes(value, names):
                    end = max(change.end, min(change.start + 1, len(value)))
                    place = self.document.span(path, change.start, end)
                    data = _replaced(self.document.data, path, change.apply(value))
                    before = value[change.start : change.end]
                    yield self.mutant(path, place, before, change.new or "(left out)", data)
            case list():
                yield from self._items(value, path)
            case dict() if "rows" in value:
                yield from self.expression(value.get("by"), (*path, "by"))
                yield from self._keyed(value["rows"], (*path, "rows"))
            case dict() if "grid" in value:
                yield from self._entries(value["legend"], (*path, "legend"))
            case dict() if "value" in value:
                for key in value:
                    yield from self.expression(value[key], (*path, key))
            case dict():
                yield from self._keyed(value, path)

    def _number(self, value: int | float, path: Path) -> Iterator[Mutant]:
        text = self.document.text(path)
        digits = text.lstrip("+-")
        sign = "-" * text.startswith("-")
        if math.isfinite(value) and digits[0].isdigit():
            for new in off_by_one(digits):
                yield self.changed(path, type(value)(float(sign + new)), text, sign + new)
        if value:
            yield self.changed(path, -value, text, f"{-value:g}")

    def _items(self, items: list[Any], path: Path) -> Iterator[Mutant]:
        """Change a vector, the columns of a table, or cases; cases are left out and change places, too."""
        is_cases = any(isinstance(item, dict) and item.keys() & {"then", "else"} for item in items)
        for i, item in enumerate(items):
            if not is_cases or not isinstance(item, dict):
                yield from self.expression(item, (*path, i))
                continue
            for key in item:
                if key in ("if", "then", "else"):
                    yield from self.expression(item[key], (*path, i, key))
            if "else" not in item:
                yield self.without((*path, i))
        for i in range(len(items) - 1 - is_cases):
            yield from self.exchanged(path, i, i + 1)

    def _keyed(self, rows: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        """Yield rows of a table, or values with their probabilities: changed, left out, exchanged, under another key."""
        for key, cell in rows.items():
            if isinstance(cell, dict) and not cell.keys() & _FORM_KEYS - {"else"}:
                yield from self._keyed(cell, (*path, key))
            else:
                yield from self.expression(cell, (*path, key))
            yield self.without((*path, key))
            if key == "else":
                continue
            for change in changes(key, Replacements(self.alike, frozenset())):
                other = change.apply(key)
                if other not in rows:
                    renamed = {other if k == key else k: v for k, v in rows.items()}
                    data = _replaced(self.document.data, path, renamed)
                    yield self.mutant((*path, key), self.document.key_span((*path, key)), key, other, data)
        for one, other in pairwise(rows):
            yield from self.exchanged(path, one, other)


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
