"""Variants: a spec merged with the overrides of one variant, every value still knowing its place in the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from taskspec.base.diagnostics import Diagnostic, Span, SpecError, spec_error, suggest
from taskspec.language.source import Document, Path

REQUIRED = ("state", "action", "initial", "dynamics", "reward", "horizon")
"""Sections without which a spec, or a variant of it, is not a task."""

NAMED = (
    "parameters", "constants", "definitions", "noise", "state", "action", "observation", "initial", "dynamics",
    "measures", "accept", "memory", "symmetries",
)  # fmt: skip
"""Sections of named entries, which a variant overrides entry by entry."""

FIELDED = ("parameters", "state", "action", "memory")
"""Sections whose entries have fields, which a variant overrides field by field."""

_OF_ANY_TYPE = ("default", "shape", "symbol", "doc", "alias")
_DROPPED = ("variants", "base", "extends")
_OF_A_FILE = ("taskspec", "name", "version", "roles")
"""Sections that are about a file as a whole, which none takes over from another."""
_BESIDE = (
    "abstraction", "absorbing_reward", "accept", "claims", "examples", "expert", "figure", "info", "memory", "symmetries",
)  # fmt: skip
"""Sections that neither reset nor step a task."""
_NOT_ABSTRACT = ("abstraction", "observation", "measures", "legal", "claims", "examples", "accept", "figure", "info")


Place: TypeAlias = tuple[Document, Path]
"""A document, and a path in it."""


@dataclass(frozen=True, eq=False)
class Merged:
    """The data of one variant (or of the spec itself), and where, in which document, each part was written."""

    document: Document
    name: str
    variant: str | None
    data: dict[str, Any]
    moved: dict[Path, Place]
    strays: tuple[Path, ...] = ()
    """Entries that the variant changes or removes, though what it is based on has nothing of the name."""
    parsed: dict[Any, Any] = field(default_factory=dict)
    """Expressions that were read, by their places and texts, so that builds for other values read none of them again."""

    def written(self, path: Path) -> Place:
        """Place at which a path of the merged data was written."""
        return _place(self.moved, self.document, path)

    def origin(self, path: Path) -> Place:
        """Document and variant (as a path) that wrote a path."""
        document, there = self.written(path)
        return document, there[: len(there) - len(path)]

    def is_own(self, path: Path) -> bool:
        """Test whether a path was written by this variant, or this spec, and not by its base."""
        return self.origin(path) == (self.document, _root(self.variant))

    def span(self, path: Path, start: int | None = None, end: int | None = None) -> Span:
        document, there = self.written(path)
        return document.span(there, start, end)

    def key_span(self, path: Path) -> Span:
        document, there = self.written(path)
        return document.key_span(there)

    @property
    def missing(self) -> list[str]:
        """Required sections that are not there: such a spec is only a base for its variants."""
        return [section for section in REQUIRED if section not in self.data]


Step: TypeAlias = tuple[Document, str | None]
"""A document, and a variant of it, or the spec itself."""


def task_name(name: str, variant: str) -> str:
    """Name of a variant's task: the key itself when it starts with the task's name, else the two run together."""
    if variant.startswith(name):
        return variant
    return name + variant[:1].upper() + variant[1:]


def variant_names(data: dict[str, Any]) -> dict[str, str | None]:
    """Task names of a document, each with its variant: the spec itself (None) and every variant."""
    name = str(data.get("name", ""))
    names: dict[str, str | None] = {name: None}
    variants = data.get("variants")
    if isinstance(variants, dict):
        for key in variants:
            names[task_name(name, str(key))] = str(key)
    return names


def complete(document: Document) -> list[str | None]:
    """List the variants that are tasks, the spec itself (None) first unless it leaves sections to them."""
    variants = list(variant_names(document.data).values())
    if len(variants) > 1 and merge(document).missing:
        return variants[1:]
    return variants


def merge(document: Document, variant: str | None = None) -> Merged:
    """Merge a variant's overrides (by key or by task name) into all that it is based on.

    Raises:
        SpecError: when there is no such variant, or variants are based on each other in a circle.
    """
    name = str(document.data.get("name", ""))
    if variant is None or variant == name:
        key = None
    else:
        key = _key(document, variant)
    merged: Merged | None = None
    for step in reversed(list(lineage((document, key)))):
        document, key = step
        if key not in document.merged:
            document.merged[key] = _overlaid(document, key, merged)
        merged = document.merged[key]
    assert merged is not None
    return merged


def _overlaid(document: Document, variant: str | None, base: Merged | None) -> Merged:
    name = str(document.data.get("name", ""))
    own = {key: value for key, value in document.data.items() if key not in _DROPPED}
    if base is None:
        return Merged(document, name, None, own, {})
    data = dict(base.data)
    moved = dict(base.moved)
    if base.document is not document:
        data = {key: value for key, value in data.items() if key not in _OF_A_FILE}
        moved = {(key,): (base.document, (key,)) for key in data} | moved
        data |= {key: own[key] for key in _OF_A_FILE if key in own}
    over = _sections(document, variant)
    here: Place = (document, _root(variant))
    strays = [*base.strays]
    for section, value in over.items():
        if section in _DROPPED:
            continue
        if value is not None and section in NAMED:
            data[section], unknown = _entries(section, value, data, moved, here)
            strays += unknown
        elif section == "claims" and isinstance(value, dict):
            data[section], unknown = _claims(value, data, moved, here)
            strays += unknown
        else:
            data.pop(section, None)
            if value is not None:
                data[section] = value
            _move(moved, (section,), here)
    if variant is not None:
        name = task_name(name, variant)
    return Merged(document, name, variant, data, moved, tuple(strays))


def _root(variant: str | None) -> Path:
    if variant is None:
        return ()
    return ("variants", variant)


def _sections(document: Document, variant: str | None) -> dict[str, Any]:
    sections: dict[str, Any] = document.data
    for step in _root(variant):
        sections = sections[str(step)] or {}
    return sections


def _entries(
    section: str, over: dict[str, Any], data: dict[str, Any], moved: dict[Path, Place], here: Place
) -> tuple[dict[str, Any], list[Path]]:
    """Override entries of a section; also the paths of overrides that change no entry."""
    if section not in data:
        _move(moved, (section,), here)
    result = dict(data.get(section) or {})
    strays: list[Path] = []
    for name, value in over.items():
        path = (section, name)
        old = result.get(name)
        fields = section in FIELDED and isinstance(value, dict)
        if name not in result and (value is None or (fields and "type" not in value)):
            strays.append(path)
        if fields and isinstance(old, dict):
            result[name] = _without_nulls(_kept(old, value) | value)
            for key in value:
                _move(moved, (*path, key), here)
            continue
        _move(moved, path, here)
        if fields:
            result[name] = _without_nulls(value)
        else:
            result[name] = value
        if value is None:
            del result[name]
    return result, strays


def _claims(
    over: dict[str, Any], data: dict[str, Any], moved: dict[Path, Place], here: Place
) -> tuple[list[Any], list[Path]]:
    document, start = here
    dropped = {}
    for i, claim in enumerate(over.get("drop") or ()):
        dropped[statement(claim)] = i
    claims = []
    for i, claim in enumerate(data.get("claims") or []):
        if statement(claim) not in dropped:
            claims.append((claim, _place(moved, document, ("claims", i))))
    unknown = set(dropped) - set(map(statement, data.get("claims") or []))
    for i, claim in enumerate(over.get("add") or ()):
        claims.append((claim, (document, (*start, "claims", "add", i))))
    _move(moved, ("claims",), here)
    for i, (_, place) in enumerate(claims):
        moved[("claims", i)] = place
    for claim in unknown:
        moved[("claims", claim)] = (document, (*start, "claims", "drop", dropped[claim]))
    return [claim for claim, _ in claims], [("claims", claim) for claim in dropped if claim in unknown]


def abstracted(merged: Merged) -> Merged | None:
    """Finite stand-in that a spec declares, as a spec of its own; None without one.

    The sections under `abstraction` (all but `map`) replace sections of the same name.
    """
    over = merged.data.get("abstraction")
    if not over:
        return None
    memory = ("memory", "expert") if merged.data.get("memory") else ()  # a stand-in shows no observations to remember
    data = {}
    for key, value in merged.data.items():
        if key not in (*_NOT_ABSTRACT, *memory):
            data[key] = value
    if merged.data.get("symmetries"):  # a stand-in shows other things, and is steered alike
        steering = {}
        for name, s in data["symmetries"].items():
            steering[name] = {"action": s.get("action") or {}}
        data["symmetries"] = steering
    moved = dict(merged.moved)
    for section, value in over.items():
        if section != "map" and value is not None:
            data[section] = value
            document, place = merged.written(("abstraction", section))
            _move(moved, (section,), (document, place[:-1]))
    return Merged(merged.document, merged.name, merged.variant, data, moved)


def stripped(merged: Merged) -> Merged:
    """Keep the sections that reset and step a task."""
    data = {}
    for key, value in merged.data.items():
        if key not in _BESIDE:
            data[key] = value
    return Merged(merged.document, merged.name, merged.variant, data, merged.moved)


def _key(document: Document, variant: str) -> str:
    name = str(document.data.get("name", ""))
    variants: dict[str, Any] = document.data.get("variants") or {}
    if variant in variants:
        return variant
    keys = {task_name(name, key): key for key in variants}
    if variant in keys:
        return keys[variant]
    message = f"{name} has no variant '{variant}'; it has: {', '.join(variants) or 'none'}"
    hint = suggest(variant, [*variants, *keys])
    raise spec_error("E211", message, hint)  # it was asked for from outside, not in the file


def _base(step: Step) -> Step | None:
    document, variant = step
    over = _sections(document, variant)
    if "extends" not in over and variant is None:
        return None
    other = document
    if "extends" in over:
        other = document.others[over["extends"]]
    if over.get("base") is None:
        return other, None
    return other, _key(other, str(over["base"]))


def lineage(step: Step) -> Iterator[Step]:
    """Yield a variant, or a spec, its base, the base of that, and so on."""
    seen: set[Step] = set()
    current: Step | None = step
    while current is not None:
        if current in seen:
            span = step[0].span(("variants", str(step[1]), "base"))
            raise SpecError([Diagnostic("E212", span, "these variants are based on each other in a circle")])
        seen.add(current)
        yield current
        current = _base(current)


def _place(moved: dict[Path, Place], document: Document, path: Path) -> Place:
    """Place at which a path of merged data was written: in the document itself unless it was moved."""
    for n in range(len(path), 0, -1):
        if path[:n] in moved:
            there, start = moved[path[:n]]
            return there, (*start, *path[n:])
    return document, path


def statement(claim: Any) -> str:
    """Normalize the spaces of a claim."""
    return " ".join(str(claim["claim"] if isinstance(claim, dict) else claim).split())


def _kept(old: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Keep parts of an entry when some of its keys are overridden: with another type, the keys of any type."""
    if over.get("type", old.get("type")) == old.get("type"):
        return old
    kept = {}
    for key, value in old.items():
        if key in _OF_ANY_TYPE:
            kept[key] = value
    return kept


def _without_nulls(entry: dict[str, Any]) -> dict[str, Any]:
    changed = {}
    for key, value in entry.items():
        if value is not None:
            changed[key] = value
    return changed


def _move(moved: dict[Path, Place], path: Path, here: Place) -> None:
    """Record that everything at a path is written below `here`, and forget what was known below it."""
    for old in [p for p in moved if p[: len(path)] == path]:
        del moved[old]
    document, start = here
    moved[path] = document, (*start, *path)
