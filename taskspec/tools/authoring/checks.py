"""Checks of specs and of files that are no specs, with the warnings of all wings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from taskspec import exact
from taskspec.base.diagnostics import Diagnostic, SpecError, in_order
from taskspec.exact.check.report import Report
from taskspec.language.source import Kind
from taskspec.language.task.task import Task
from taskspec.learn.documents.rule_books import read_exam, read_findings
from taskspec.learn.experiments.experiment_file import read
from taskspec.learn.experiments.instances import expand
from taskspec.programs.agreement import EVERY, QUICK
from taskspec.show.bibliography import unknown_sources
from taskspec.show.figures import undrawn
from taskspec.show.printers.look_alikes import look_alikes
from taskspec.tools.authoring.file_checks import FileCheck, FileReport, check_file, run_checks
from taskspec.tools.targets import File


def check_files(
    others: Sequence[tuple[Path, Kind]],
    files: Sequence[File],
    prove: Callable[..., Report],
    jobs: int | None = None,
) -> list[FileReport]:
    """Check experiments, exams and findings, then specs.

    Args:
        others: files that are no specs, with their kinds.
        files: specs.
        prove: checks a task; see `examine`.
        jobs: processes; None for one for each processor.

    Returns:
        a report of each file, in this order.
    """
    checks: list[FileCheck] = [(path, partial(check_other, path, kind)) for path, kind in others]
    for file in files:
        checks.append((file.path, partial(check_file, file, partial(prove, defaults=not file.parameters))))
    return run_checks(checks, jobs)


def examine(task: Task, sense: bool = True, defaults: bool = True, all_backends: bool = False) -> Report:
    """Check a task.

    Args:
        task: a task without mistakes of form.
        sense: also check sanity, claims and programs, beyond soundness.
        defaults: whether its parameters have their defaults: claims speak of these, and ranges are checked from there.
        all_backends: whether every backend that is installed is run, not only those that are generated in milliseconds.

    Returns:
        the report of all checks.
    """
    if not sense:
        return exact.check(task, ranges=False, with_warnings=False, claims=False, programs=())
    programs = EVERY if all_backends else QUICK
    return exact.check(task, ranges=defaults, claims=defaults, programs=programs, beside=_looks)


def _looks(task: Task) -> list[Diagnostic]:
    return [*undrawn(task), *look_alikes(task), *unknown_sources(task)]


def check_other(path: Path, kind: Kind) -> FileReport:
    """Check a file that is not a spec: its form, and that all its instances, rules or findings mean something."""
    diagnostics: Sequence[Diagnostic]
    try:
        if kind == "experiment":
            expanded = expand(read(path))
            diagnostics = [*expanded.diagnostics, *expanded.refused]
            entries = len(expanded.instances)
        else:
            read_rules = read_exam if kind == "exam" else read_findings
            book = read_rules(path)
            diagnostics = book.diagnostics
            entries = len(book.rules)
    except SpecError as error:
        return FileReport(str(path), (), error.diagnostics, kind=kind)
    return FileReport(str(path), (), in_order(diagnostics), kind=kind, entries=entries)
