"""Checks of specs and of files that are no specs, with the warnings of all wings."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec import exact
from taskspec.base.diagnostics import Diagnostic, SpecError, in_order
from taskspec.base.limits import progress_listener, tell, telling
from taskspec.exact.check.report import Accepted, Coverage, Report
from taskspec.language.source import Kind
from taskspec.language.task.task import Task
from taskspec.learn.documents.rule_books import read_exam, read_findings
from taskspec.learn.experiments.experiment_file import read
from taskspec.learn.experiments.instances import expand
from taskspec.programs.agreement import EVERY, QUICK
from taskspec.show.bibliography import unknown_sources
from taskspec.show.figures import undrawn
from taskspec.show.printers.look_alikes import look_alikes
from taskspec.tools.targets import File, name_of, task_in, variants_of

if TYPE_CHECKING:
    from taskspec.exact.model.points import Method


READERS = {"exam": read_exam, "findings": read_findings}


def check_files(
    others: Sequence[tuple[Path, Kind]], files: Sequence[File], prove: Callable[..., Report], jobs: int | None = None
) -> list[FileReport]:
    """Check experiments, exams and findings, then specs, whose tasks `prove` checks (see `examine`)."""
    checks: list[FileCheck] = [(path, partial(check_other, path, kind)) for path, kind in others]
    for file in files:
        checks.append((file.path, partial(check_file, file, partial(prove, defaults=not file.parameters))))
    return run_checks(checks, jobs)


def examine(task: Task, sense: bool = True, defaults: bool = True, all_backends: bool = False) -> Report:
    """Check a task.

    Args:
        sense: also check sanity, claims and programs, beyond soundness.
        defaults: whether its parameters have their defaults: claims speak of these, and ranges are checked from there.
        all_backends: whether every backend that is installed is run, not only those that are generated in milliseconds.
    """
    if not sense:
        return exact.check(task, ranges=False, with_warnings=False, claims=False, programs=())
    programs: tuple[str, ...] = QUICK
    if all_backends:
        programs = EVERY
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
            book = READERS[kind](path)
            diagnostics = book.diagnostics
            entries = len(book.rules)
    except SpecError as error:
        return FileReport(str(path), (), error.diagnostics, kind=kind)
    return FileReport(str(path), (), in_order(diagnostics), kind=kind, entries=entries)


@dataclass(frozen=True, slots=True)
class Checked:
    """The check of one task of a file: plain data, beside the task.

    Args:
        name: of the task.
        variant: of the spec; None for the spec itself.
        diagnostics: errors and warnings, without those that the spec accepts.
        how: the method of the check of soundness, in a few words.
        seconds: time that building and checking took.
        id: of the task; None where it could not be built.
        task: None where it could not be built, or was checked in another process.
        method: of the check of soundness, in full.
        accepted: warnings for which the spec gives a reason.
        claims: a record of each claim that was evaluated, as `--json` writes it.
        symmetries: a record of each declared symmetry.
        coverage: as in `Report`.
    """

    name: str
    variant: str | None
    diagnostics: tuple[Diagnostic, ...]
    how: str
    seconds: float
    id: str | None = None
    task: Task | None = None
    method: str = ""
    accepted: tuple[Accepted, ...] = ()
    claims: tuple[dict[str, Any], ...] = ()
    symmetries: tuple[dict[str, Any], ...] = ()
    coverage: Coverage = field(default_factory=Coverage)


@dataclass(frozen=True, slots=True)
class FileReport:
    """The check of a file: its tasks, each problem once, accepted warnings; for other kinds of files, the number of entries."""

    path: str
    tasks: tuple[Checked, ...]
    diagnostics: tuple[Diagnostic, ...]
    accepted: tuple[Accepted, ...] = ()
    kind: Kind = "taskspec"
    entries: int = 0


FileCheck = tuple[Path, Callable[[], FileReport]]  # a file, and what checks it, here or in another process


def run_checks(checks: Sequence[FileCheck], jobs: int | None = None) -> list[FileReport]:
    """Run checks of files, and return their reports in order.

    Args:
        jobs: processes; None for one for each processor. In several, reports leave the tasks out.
    """
    processes = min(jobs or os.cpu_count() or 1, len(checks))
    has_threads = threading.active_count() > 1 or "jax" in sys.modules
    if processes < 2 or has_threads or sys.platform in ("darwin", "win32"):  # such a process cannot be forked safely
        return [run() for _, run in telling(checks, lambda check: str(check[0]))]
    longest_first = sorted(range(len(checks)), key=lambda i: -checks[i][0].stat().st_size)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork")) as pool:
        running = {i: pool.submit(_run_apart, checks[i][1]) for i in longest_first}
        try:
            done = {i: running[i].result() for i in telling(longest_first, lambda i: str(checks[i][0]))}
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [done[i] for i in range(len(checks))]


def _run_apart(run: Callable[[], FileReport]) -> FileReport:
    with progress_listener(lambda what, share: None):  # the first process reports progress
        report = run()
    return replace(report, tasks=tuple(replace(each, task=None) for each in report.tasks))


def check_file(file: File, prove: Callable[[Task], Report]) -> FileReport:
    """Check all tasks of a file with `prove`; problems are part of the report, not raised."""
    path = str(file.path)
    try:
        variants = variants_of(file)
    except SpecError as error:
        return FileReport(path, (), error.diagnostics)
    checked = [check_task(file, variant, prove) for variant in variants]
    accepted = {}
    for task in checked:
        for each in task.accepted:
            accepted[each.warning.code, each.place.line, each.place.column] = each
    needed = {each.place for each in accepted.values()}
    tasks = []
    for task in checked:  # without W511 for an entry of `accept` that another task, which shares it, needs
        left = []
        for diagnostic in task.diagnostics:
            if diagnostic.code != "W511" or diagnostic.span not in needed:
                left.append(diagnostic)
        tasks.append(replace(task, diagnostics=tuple(left)))
    return FileReport(path, tuple(tasks), once(tasks), tuple(accepted.values()))


def check_task(file: File, variant: str | None, prove: Callable[[Task], Report]) -> Checked:
    start = time.perf_counter()
    try:
        task = task_in(file, variant)
    except SpecError as error:
        try:
            name = name_of(file, variant)
        except SpecError:  # an id whose file cannot be read
            name = variant or file.path.stem
        return Checked(name, variant, error.diagnostics, "not built", time.perf_counter() - start)
    tell(task.id)
    try:
        report = prove(task)
    except SpecError as error:  # of one task, so that the others are still looked at
        place = task.source.document.span(("name",))
        placed = []
        for diagnostic in error.diagnostics:
            placed.append(replace(diagnostic, span=diagnostic.span or place))
        return Checked(task.name, variant, in_order(placed), "given up", time.perf_counter() - start, task.id, task)
    return Checked(
        name=task.name,
        variant=variant,
        diagnostics=report.diagnostics,
        how=_in_short(report.method),
        seconds=time.perf_counter() - start,
        id=task.id,
        task=task,
        method=str(report.method),
        accepted=report.accepted,
        claims=tuple(verdict.record() for verdict in report.verdicts),
        symmetries=tuple(symmetry.record() for symmetry in report.symmetries),
        coverage=report.coverage,
    )


def _in_short(method: Method) -> str:
    if not method.exact:
        return f"{method.points:,} samples"
    if method.points:
        return f"all {method.points:,} points"
    return "bounds"


def once(checked: Sequence[Checked]) -> tuple[Diagnostic, ...]:
    """List problems in order of place; a problem that several variants inherit once, with a note of who shares it."""
    sharing: dict[tuple[Any, ...], list[str]] = {}
    first: dict[tuple[Any, ...], Diagnostic] = {}
    for each in checked:
        seen: Counter[tuple[Any, ...]] = Counter()
        for diagnostic in each.diagnostics:
            span = diagnostic.span
            here: tuple[Any, ...] = (diagnostic.code, diagnostic.message)
            if span is not None:
                here = (diagnostic.code, span.line, span.column, span.end_line, span.end_column)
            seen[here] += 1
            key = (*here, seen[here])  # several of one task at one place are several
            first.setdefault(key, diagnostic)
            names = sharing.setdefault(key, [])
            if each.name not in names:
                names.append(each.name)
    noted = []
    for key, diagnostic in first.items():
        names = sharing[key]
        spec = checked[0].name  # the task of the spec itself, or of its first variant
        if names != [spec]:
            note = f"in {', '.join(names)}"
            if names[0] == spec:
                note = f"the same in {', '.join(names[1:])}"
            diagnostic = replace(diagnostic, notes=(*diagnostic.notes, note))
        noted.append(diagnostic)
    return tuple(sorted(noted, key=_line_and_column))


def _line_and_column(diagnostic: Diagnostic) -> tuple[int, int]:
    if diagnostic.span is None:
        return 0, 0
    return diagnostic.span.line, diagnostic.span.column


def problems_of(reports: Iterable[FileReport]) -> list[Diagnostic]:
    problems: list[Diagnostic] = []
    for report in reports:
        problems += report.diagnostics
    return problems


def counts(diagnostics: Iterable[Diagnostic]) -> tuple[int, int]:
    """Count errors, and warnings."""
    severities = [d.severity for d in diagnostics]
    return severities.count("error"), severities.count("warning")
