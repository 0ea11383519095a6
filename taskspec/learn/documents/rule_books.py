"""Read files of rules, `exam.yaml` and `findings.yaml`: the names that rules may use, and every rule parsed and checked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from taskspec.base import ids
from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, suggest
from taskspec.base.named import all_names
from taskspec.language import registry
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse_into
from taskspec.language.source import Document, read_file
from taskspec.learn.documents.document_models import (
    DiagnosisEntry,
    ExamDocument,
    FindingEntry,
    FindingsDocument,
    check_document,
)
from taskspec.learn.documents.score_rules import check_rule
from taskspec.learn.documents.score_words import RuleNames
from taskspec.show.bibliography import Reference, beside

EXAM = "exam.yaml"
FINDINGS = "findings.yaml"
"""Files of a suite's folder."""


@dataclass(frozen=True)
class ScoreRule:
    """An entry of a file with its condition parsed."""

    name: str
    entry: DiagnosisEntry | FindingEntry
    condition: s.Expr


@dataclass(frozen=True)
class RuleBook:
    """A file of rules: its entries, the names that they use, and the sources that they cite.

    Attributes:
        same: tasks whose results count as those of another, where that was not run.
    """

    described: ExamDocument | FindingsDocument
    names: RuleNames
    rules: tuple[ScoreRule, ...]
    references: Mapping[str, Reference]
    same: Mapping[str, str]
    diagnostics: tuple[Diagnostic, ...] = ()


def read_exam(path: str | os.PathLike[str]) -> RuleBook:
    return _read(Path(path), ExamDocument, "diagnoses", "when")


def read_findings(path: str | os.PathLike[str]) -> RuleBook:
    """Read the findings in a file; the exam beside it says which tasks are the same."""
    book = _read(Path(path), FindingsDocument, "entries", "holds")
    exam = Path(path).parent / EXAM
    if not exam.is_file():
        return book
    return replace(book, same=read_exam(exam).same)


def file_of(suite: str | os.PathLike[str], name: str) -> Path | None:
    """Return a file of a suite, `EXAM` or `FINDINGS`, by the name or folder of the suite; None if it has none."""
    for path in (Path(suite) / name, registry.tasks_root() / suite / name):
        if path.is_file():
            return path
    return None


def _read(path: Path, model: type[ExamDocument | FindingsDocument], section: str, key: str) -> RuleBook:
    return _read_once(path.absolute(), model, section, key, _stamp(path.parent))


def _stamp(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """Names, times and sizes of the files in a folder, and of bibliographies above it: rules are read again when one changes."""
    stamp = []
    paths = [*folder.glob("*"), *folder.parent.glob("*.bib")]
    for path in sorted(paths):
        status = path.lstat()
        stamp.append((path.name, status.st_mtime_ns, status.st_size))
    return tuple(stamp)


@lru_cache(64)
def _read_once(
    path: Path, model: type[ExamDocument | FindingsDocument], section: str, key: str, stamp: tuple[tuple[str, int, int], ...]
) -> RuleBook:  # fmt: skip
    document = read_file(path)
    described, diagnostics = check_document(document, model)
    if described is None:
        raise SpecError(diagnostics)
    reader = _RuleReader(document, Collector())
    reader.collector.extend(diagnostics)
    names = reader.names(described, path.parent)
    references = beside([path])
    rules = []
    entries: Mapping[str, Any] = getattr(described, section)
    if isinstance(described, FindingsDocument):
        reader.check_reference(described.source.key, references, ("source", "key"))
    for name, entry in entries.items():
        condition = reader.parsed(getattr(entry, key), (section, name, key))
        if condition is not None:
            check_rule(condition, names, reader.collector)
            rules.append(ScoreRule(name, entry, condition))
        if isinstance(entry, DiagnosisEntry):
            reader.check_reference(entry.source.key, references, (section, name, "source", "key"))
        reader.check_members(getattr(entry, "unless", []), tuple(entries), "diagnosis", (section, name, "unless"))
    reader.collector.raise_if_errors()
    same = described.same if isinstance(described, ExamDocument) else {}
    return RuleBook(described, names, tuple(rules), references, same, reader.collector.diagnostics)


@dataclass(frozen=True)
class _RuleReader:
    """A document, and a collector of mistakes at places in it."""

    document: Document
    collector: Collector

    def parsed(self, text: str, path: tuple[str, ...]) -> s.Expr | None:
        return parse_into(s.SourceText(text, lambda start, end: self.document.span(path, start, end)), self.collector)

    def names(self, described: ExamDocument | FindingsDocument, folder: Path) -> RuleNames:
        """Return the names of a file, and report those of nothing."""
        known = tuple(all_names(registry.entries(folder)))
        self.check_members(described.tasks, known, "task", ("tasks",))
        tasks = tuple(described.tasks) or known
        learners: tuple[str, ...] = ()
        instances: tuple[str, ...] = ()
        if isinstance(described, FindingsDocument):
            learners = tuple(described.learners)
            instances = tuple(described.instances)
        for name, members in described.groups.items():
            kind = "task"
            members_known = tasks
            if members and members[0] in learners:
                kind = "learner"
                members_known = learners
            self.check_members(members, members_known, kind, ("groups", name))
        if isinstance(described, ExamDocument):
            for name, other in described.same.items():
                self.check_members([other], tasks, "task", ("same", name))
        else:
            for name, members in described.unable.items():
                self.check_members([name], learners, "learner", ("unable",))
                self.check_members(members, tasks, "task", ("unable", name))
            for name, instance in described.instances.items():
                self.check_members([ids.parse(instance).name], tasks, "task", ("instances", name))
        groups = {name: tuple(members) for name, members in described.groups.items()}
        return RuleNames(tasks, learners, groups, instances)

    def check_members(self, members: list[str], known: tuple[str, ...], kind: str, at: tuple[str, ...]) -> None:
        for i, member in enumerate(members):
            if member not in known:
                hint = suggest(member, known) or f"one of {', '.join(known) or 'none'}"
                self.collector.add("E302", self.document.span((*at, i)), f"there is no {kind} '{member}' here", hint)

    def check_reference(self, key: str, references: Mapping[str, Reference], at: tuple[str, ...]) -> None:
        if references and key not in references:
            hint = suggest(key, references) or f"one of {', '.join(references)}"
            message = f"`{key}` is not a key of the bibliography next to this file"
            self.collector.add("E206", self.document.span(at), message, hint)
