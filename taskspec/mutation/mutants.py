"""Every small change of a spec: of one token of an expression, of one entry, row, label or bound.

What readers read (titles, prose, symbols, figures) is left as it is, and so are claims and examples: they are what a change
is held against.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from taskspec.base.diagnostics import Span
from taskspec.mutation.expressions import Change, Replacements, changes, off_by_one
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
        """Whether it lists the labels of a choice in another order, and does nothing else."""
        return self.path[-2:-1] == ("values",) and isinstance(self.path[-1], int) and self.after == EXCHANGED

    def document(self) -> Document:
        """Return the changed spec as a document. Its places are those of a text that nobody has written."""
        return read_text(written(self.data), "mutant", self.others)


def mutants(document: Document) -> Iterator[Mutant]:
    """Yield every change of a spec, in the order of the file's sections; what it extends stays as it is."""
    for each in _mutants(document):
        yield replace(each, others=document.others)


def _mutants(document: Document) -> Iterator[Mutant]:
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

    # -- making mutants -------------------------------------------------------------------------------------------

    def changed(self, path: Path, value: Any, before: str, after: str, place: Span | None = None) -> Mutant:
        span = self.document.span(path) if place is None else place
        return Mutant(path, span, before, after, _replaced(self.document.data, path, value))

    def without(self, path: Path) -> Mutant:
        place = self.document.key_span(path)
        return Mutant(path, place, f"{path[-1]}", "(left out)", _replaced(self.document.data, path, MISSING))

    def exchanged(self, path: Path, one: Any, other: Any) -> Iterator[Mutant]:
        """Yield the values under two keys of a mapping, or two items of a list, exchanged."""
        here = _at(self.document.data, path)
        if here[one] != here[other]:
            data = _replaced(_replaced(self.document.data, (*path, one), here[other]), (*path, other), here[one])
            words = " and ".join(_named(here, key) for key in (one, other))
            yield Mutant((*path, one), self.document.key_span((*path, one)), words, EXCHANGED, data)

    # -- sections -------------------------------------------------------------------------------------------------

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
            elif section in ("abstraction", "map"):
                yield from self.spec(value, here) if section == "abstraction" else self._entries(value, here)
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
        keys = list(labels) if isinstance(labels, dict) else list(range(len(labels)))
        for key in keys:
            if isinstance(labels, dict):
                yield from self.expression(labels[key], (*path, key))
            yield self.without((*path, key))
        for one, other in pairwise(keys):
            yield from self.exchanged(path, one, other)

    # -- expressions ----------------------------------------------------------------------------------------------

    def expression(self, value: Any, path: Path) -> Iterator[Mutant]:
        """Changes of an expression in any of its forms."""
        match value:
            case bool():
                yield self.changed(path, not value, str(value).lower(), str(not value).lower())
            case int() | float():
                yield from self._number(value, path)
            case str():
                yield from self._text(value, path)
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
        for new in off_by_one(text.lstrip("+-")) if math.isfinite(value) and text.lstrip("+-")[0].isdigit() else ():
            sign = "-" if text.startswith("-") else ""
            number = type(value)(float(sign + new))
            yield self.changed(path, number, text, sign + new)
        if value:
            yield self.changed(path, -value, text, f"{-value:g}")

    def _text(self, text: str, path: Path) -> Iterator[Mutant]:
        in_step = any(step in PRIMES for step in path)
        names = Replacements(self.alike, self.states if in_step else frozenset())
        for change in changes(text, names):
            yield self._edited(text, change, path)

    def _edited(self, text: str, change: Change, path: Path) -> Mutant:
        end = max(change.end, min(change.start + 1, len(text)))
        place = self.document.span(path, change.start, end)
        before = text[change.start : change.end]
        return self.changed(path, change.apply(text), before, change.new or "(left out)", place)

    def _items(self, items: list[Any], path: Path) -> Iterator[Mutant]:
        """Of a vector, of the columns of a table, or of cases; cases are left out and change places too."""
        is_cases = any(isinstance(item, dict) and item.keys() & {"then", "else"} for item in items)
        for i, item in enumerate(items):
            keys = [k for k in item if k in ("if", "then", "else")] if isinstance(item, dict) and is_cases else [None]
            for key in keys:
                inner = item if key is None else item[key]
                yield from self.expression(inner, (*path, i) if key is None else (*path, i, key))
            if is_cases and "else" not in item:
                yield self.without((*path, i))
        last = len(items) - 1 if is_cases else len(items)
        for i in range(last - 1):
            yield from self.exchanged(path, i, i + 1)

    def _keyed(self, rows: Mapping[str, Any], path: Path) -> Iterator[Mutant]:
        """Yield rows of a table, or values with their probabilities: changed, left out, exchanged, under another key."""
        for key, cell in rows.items():
            if isinstance(cell, dict) and not cell.keys() & _FORM_KEYS - {"else"}:
                yield from self._keyed(cell, (*path, key))
            else:
                yield from self.expression(cell, (*path, key))
            yield self.without((*path, key))
            if key != "else":
                yield from self._renamed(rows, key, path)
        keys = list(rows)
        for one, other in pairwise(keys):
            yield from self.exchanged(path, one, other)

    def _renamed(self, rows: Mapping[str, Any], key: str, path: Path) -> Iterator[Mutant]:
        """Yield a row under another key."""
        others = [c.apply(key) for c in changes(key, Replacements(self.alike, frozenset()))]
        for other in dict.fromkeys(others):
            if other not in rows:
                renamed = {other if k == key else k: v for k, v in rows.items()}
                place = self.document.key_span((*path, key))
                yield Mutant((*path, key), place, key, other, _replaced(self.document.data, path, renamed))


# -- names --------------------------------------------------------------------------------------------------------


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
                if isinstance(entry, dict) and "type" in entry:
                    groups.setdefault(_type(entry), {})[name] = None
                if isinstance(entry, dict) and entry.get("values"):
                    groups.setdefault(f"labels {name}", {}).update(dict.fromkeys(map(str, entry["values"])))
    alike: dict[str, list[str]] = {}
    for group in groups.values():
        for name in group:
            known = alike.setdefault(name, [])
            known += [other for other in group if other != name and other not in known]
    return alike


def _type(entry: Mapping[str, Any]) -> str:
    return f"{entry['type']} {json.dumps(entry.get('shape') or [], default=str)} {list(entry.get('values') or ())}"


def _named(parent: Any, key: str | int) -> str:
    """Return a key, or an item of a list: the item itself where it is short."""
    item = parent[key]
    return str(key) if isinstance(key, str) else str(item) if isinstance(item, str | int | float) else f"item {key}"


# -- data ---------------------------------------------------------------------------------------------------------


def _at(data: Any, path: Path) -> Any:
    for step in path:
        data = data[step]
    return data


def _replaced(data: Any, path: Path, value: Any) -> Any:
    """Return the same data with another value at a path, or without it."""
    if not path:
        return value
    step = path[0]
    rest = path[1:]
    inner = MISSING if value is MISSING and not rest else _replaced(data[step], rest, value)
    if isinstance(data, list):
        changed = [inner if i == step else item for i, item in enumerate(data)]
        return [item for item in changed if item is not MISSING]
    return {k: inner if k == step else v for k, v in data.items() if not (k == step and inner is MISSING)}


def written(data: Any) -> str:
    """Return data as YAML that reads as the same data."""
    match data:
        case dict():
            return "{" + ", ".join(f"{json.dumps(k)}: {written(v)}" for k, v in data.items()) + "}"
        case list():
            return "[" + ", ".join(map(written, data)) + "]"
        case float() if not math.isfinite(data):
            return ".nan" if data != data else ".inf" if data > 0 else "-.inf"
        case _:
            return json.dumps(data)
