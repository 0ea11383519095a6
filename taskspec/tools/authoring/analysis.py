"""The analysis of a spec while it is being typed: its document, its declarations, and every mistake."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from taskspec.base.diagnostics import Diagnostic, Span, SpecError, in_order
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.scope import Scope
from taskspec.language.source import Document, Path
from taskspec.language.task.build import Attempt, attempts
from taskspec.language.task.merge import Merged
from taskspec.language.task.names import Names, declared, signature
from taskspec.tools.authoring.repair import read_tolerantly

_SCOPES = {"absorbing_reward": "absorbing", "definitions": "reward"}
"""The names of scopes that are not called like their sections."""


@dataclass(frozen=True)
class Declaration:
    """A name that a spec declares: what it is, and where."""

    name: str
    noun: str
    path: Path


@dataclass(frozen=True, eq=False)
class Analysis:
    """The analysis of one text. `document` is None where nothing can be read, `diagnostics` are sorted by place."""

    text: str
    name: str
    document: Document | None
    attempts: tuple[Attempt, ...]
    diagnostics: tuple[Diagnostic, ...]

    @property
    def sections(self) -> dict[str, Any]:
        """The sections as they are written; none where the text is no mapping."""
        data = self.document.data if self.document else None
        if isinstance(data, dict):
            return data
        return {}

    def entries(self, *path: str | int) -> list[str]:
        """Return the names of the entries at a path; none where it has no entries."""
        written = self.written(path)
        if isinstance(written, dict):
            return list(written)
        return []

    def written(self, path: Path) -> Any:
        """Return what is written at a path; None where nothing is."""
        written: Any = self.sections
        for step in path:
            try:
                written = written[step]
            except (KeyError, IndexError, TypeError):
                return None
        return written

    def attempt(self, path: Path) -> Attempt | None:
        """Return what was made of the spec or the variant that a path is in."""
        variant = None
        if path[:1] == ("variants",) and len(path) > 1:
            variant = path[1]
        for each in self.attempts:
            if each.merged.variant == variant:
                return each
        if self.attempts:
            return self.attempts[0]
        return None

    def scope(self, path: Path) -> Scope | None:
        """Return the names that are visible in the expression at a path; None where nothing is known."""
        attempt = self.attempt(path)
        if attempt is None:
            return None
        section = str(own(path)[0]) if own(path) else ""
        context = attempt.names.context
        if section in ("parameters", "constants", "state", "action", "horizon", "discount"):
            return Scope(context.constants)
        section = _SCOPES.get(section, section)
        known = context.named_scopes.get(section)
        if known is not None:
            return known
        return _made(attempt.names, section)

    @cached_property
    def declarations(self) -> dict[str, Declaration]:
        """The names that the text declares; labels of choices included."""
        named: dict[str, Declaration] = {}
        for attempt in self.attempts:
            for path, name, noun in declared(attempt.merged):
                named.setdefault(name, Declaration(name, noun, _written(attempt.merged, path)))
            for section in ("parameters", "state", "action"):
                for path, label in _labels(attempt.merged, section):
                    named.setdefault(label, Declaration(label, "label", _written(attempt.merged, path)))
        return named

    def uses(self, name: str) -> Iterator[s.Name | s.Call | s.Quoted]:
        """Yield each use of a name in the expressions of the text, with its prime or without, in no order."""
        seen = set()
        for attempt in self.attempts:
            for expr in attempt.merged.parsed.values():
                for node in s.below(expr):
                    if isinstance(node, s.Name | s.Quoted | s.Call) and _name_of(node) == name:
                        span = name_span(node)
                        if span.origin.name == self.name and span not in seen:
                            seen.add(span)
                            yield node


def analyse(text: str, name: str = "<string>", before: Analysis | None = None) -> Analysis:
    """Return the analysis of a spec's text, which need not be complete. Never raises for a bad text.

    Args:
        text: the text of the spec.
        name: its file, from which the files that it extends are found.
        before: the analysis of the text before its last change; what has not changed is not worked out again, and
            expressions of `before` have their places in this text from now on.
    """
    reading = read_tolerantly(text, name)
    if reading.document is None:
        return Analysis(text, name, None, (), reading.diagnostics)
    problems = list(reading.diagnostics)
    made: list[Attempt] = []
    earlier: tuple[Attempt, ...] = ()
    if before is not None:
        earlier = before.attempts
    try:
        made, mistakes = attempts(reading.document, before=earlier)
        problems += [each for each in mistakes if not _on_lines(each, reading.repaired)]
    except SpecError as error:
        problems += error.diagnostics
    return Analysis(text, name, reading.document, tuple(made), in_order(problems))


def own(path: Path) -> Path:
    """Return a path without the variant that it is in."""
    if path[:1] == ("variants",):
        return path[2:]
    return path


def _made(names: Names, section: str) -> Scope | None:
    if section not in ("dynamics", "reward", "measures", "terminal", "observation", "expert", "absorbing", "noise",
                       "claims", "figure", "legal"):  # fmt: skip
        return None
    return names.scope(section)


def _labels(merged: Merged, section: str) -> Iterator[tuple[Path, str]]:
    for name, entry in (merged.data.get(section) or {}).items():
        values = entry.get("values") if isinstance(entry, dict) else None
        if isinstance(values, list | dict):
            for at, label in enumerate(values):
                step = label if isinstance(values, dict) else at
                yield (section, name, "values", step), str(label)


def _written(merged: Merged, path: Path) -> Path:
    document, there = merged.written(path)
    if document is merged.document:
        return there
    return ()


def _name_of(node: s.Name | s.Quoted | s.Call) -> str:
    match node:
        case s.Name(id=name) | s.Quoted(value=name) | s.Call(function=name):
            return signature(name)[0]


def name_span(node: s.Name | s.Quoted | s.Call) -> Span:
    """Return the place of a name; of a call, that of its function."""
    if isinstance(node, s.Call):
        return node.name_place.span
    return node.place.span


def _on_lines(diagnostic: Diagnostic, repaired: frozenset[int]) -> bool:
    if not repaired or diagnostic.span is None:
        return False
    return diagnostic.span.line in repaired or diagnostic.code in ("E203", "E210", "E217")
