"""Reads exams and findings: YAML with its places, the names that rules may use, and every rule parsed and checked."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec import registry
from taskspec.base import ids
from taskspec.base.bibliography import Reference, beside
from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, suggest
from taskspec.exam.rules.check import RuleChecker, RuleNames
from taskspec.lang import syntax as s
from taskspec.lang.parse import parse_into
from taskspec.source import Document, read_file
from taskspec.task.schema.experiments import (
    DiagnosisEntry,
    ExamDocument,
    FindingEntry,
    FindingsDocument,
    check_exam,
    check_findings,
)

EXAM, FINDINGS = "exam.yaml", "findings.yaml"
"""Files of a suite's folder."""


@dataclass(frozen=True)
class ScoreRule:
    """An entry of a file with its condition parsed."""

    name: str
    entry: DiagnosisEntry | FindingEntry
    condition: s.Expr


@dataclass(frozen=True)
class Book:
    """A file of rules: what it describes, the names that they use, and the sources that they cite."""

    described: ExamDocument | FindingsDocument
    names: RuleNames
    rules: tuple[ScoreRule, ...]
    references: Mapping[str, Reference]
    diagnostics: tuple[Diagnostic, ...] = ()


def read_exam(path: str | os.PathLike[str]) -> Book:
    """The exam in a file.

    Raises:
        SpecError: with every mistake in it, each at its place.
    """
    return _read(Path(path), check_exam, "diagnoses", "when")


def read_findings(path: str | os.PathLike[str]) -> Book:
    """The findings in a file.

    Raises:
        SpecError: with every mistake in it, each at its place.
    """
    return _read(Path(path), check_findings, "entries", "holds")


def exam_of(suite: str | os.PathLike[str]) -> Path | None:
    """The exam of a suite, by its name or folder; None where it has none."""
    return _of(suite, EXAM)


def findings_of(suite: str | os.PathLike[str]) -> Path | None:
    """The findings of a suite, by its name or folder; None where it has none."""
    return _of(suite, FINDINGS)


def _of(suite: str | os.PathLike[str], name: str) -> Path | None:
    places = (Path(suite) / name, registry.tasks_root() / suite / name)
    return next((path for path in places if path.is_file()), None)


def _read(path: Path, check: Any, section: str, key: str) -> Book:
    document = read_file(path)
    described, found = check(document)
    if described is None:
        raise SpecError(found)
    collector = Collector()
    collector.extend(found)
    names = _names(document, described, path.parent, collector)
    references = beside([path])
    for at, source in _sources(described):
        _known_key(source.key, references, document, (*at, "key"), collector)
    rules = []
    entries: Mapping[str, Any] = getattr(described, section)
    for name, entry in entries.items():
        condition = _parsed(getattr(entry, key), document, (section, name, key), collector)
        if condition is not None:
            RuleChecker(names, collector).condition(condition, {})
            rules.append(ScoreRule(name, entry, condition))
        _all_in(
            getattr(entry, "unless", []), tuple(entries), "diagnosis", (section, name, "unless"), document, collector
        )
    collector.raise_if_errors()
    return Book(described, names, tuple(rules), references, collector.diagnostics)


def _parsed(text: str, document: Document, path: tuple[str, ...], collector: Collector) -> s.Expr | None:
    return parse_into(s.SourceText(text, lambda start, end: document.span(path, start, end)), collector)


# -- names ------------------------------------------------------------------------------------------------------------


def _names(
    document: Document, described: ExamDocument | FindingsDocument, folder: Path, collector: Collector
) -> RuleNames:
    """The names of a file; those that stand for nothing go to the collector."""
    known = tuple(entry.name for entry in registry.entries(folder))
    _all_in(described.tasks, known, "task", ("tasks",), document, collector)
    tasks = tuple(described.tasks) or known
    learners = tuple(described.learners) if isinstance(described, FindingsDocument) else ()
    for name, members in described.groups.items():
        is_learners = bool(members) and members[0] in learners
        kind = "learner" if is_learners else "task"
        _all_in(members, learners if is_learners else tasks, kind, ("groups", name), document, collector)
    if isinstance(described, FindingsDocument):
        for name, other in described.same.items():
            _all_in([other], tasks, "task", ("same", name), document, collector)
        for name, members in described.unable.items():
            _all_in([name], learners, "learner", ("unable",), document, collector)
            _all_in(members, tasks, "task", ("unable", name), document, collector)
        for name, instance in described.instances.items():
            _all_in([ids.parse(instance).name], tasks, "task", ("instances", name), document, collector)
    groups = {name: tuple(members) for name, members in described.groups.items()}
    instances = tuple(described.instances) if isinstance(described, FindingsDocument) else ()
    return RuleNames(tasks, learners, groups, instances)


def _all_in(
    members: list[str], known: tuple[str, ...], kind: str, at: tuple[str, ...], document: Document, collector: Collector
) -> None:
    for i, member in enumerate(members):
        if member not in known:
            hint = suggest(member, known) or f"one of {', '.join(known) or 'none'}"
            collector.add("E302", document.span((*at, i)), f"there is no {kind} '{member}' here", hint)


def _sources(described: ExamDocument | FindingsDocument) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(described, FindingsDocument):
        yield ("source",), described.source
        return
    for name, entry in described.diagnoses.items():
        yield ("diagnoses", name, "source"), entry.source


def _known_key(
    key: str, references: Mapping[str, Reference], document: Document, at: tuple[str, ...], collector: Collector
) -> None:
    if references and key not in references:
        hint = suggest(key, references) or f"one of {', '.join(references)}"
        collector.add("E206", document.span(at), f"`{key}` is not a key of the bibliography next to this file", hint)
