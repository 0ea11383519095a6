"""Check files: every task and variant of each, every problem once, and what was proved and how."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from taskspec.base.diagnostics import Diagnostic, SpecError, in_order
from taskspec.base.limits import progress_listener, tell, telling
from taskspec.source import scan
from taskspec.targets import File, name_of, task_in, variants_of

if TYPE_CHECKING:
    from pathlib import Path

    from taskspec.check.report import Accepted, Report
    from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of checking one task.

    `how` says in a few words how soundness was decided, `method` in full. `cases` counts the other parameter values that
    were tried; `verdicts` and `symmetries` are as `--json` writes them. `accepted` are the warnings that the spec gives a
    reason for, which are not among the `diagnostics`.
    """

    diagnostics: tuple[Diagnostic, ...]
    how: str = ""
    method: str = ""
    cases: int = 0
    skipped: str | None = None
    accepted: tuple[Accepted, ...] = ()
    examples: int = 0
    wrong_examples: int = 0
    verdicts: tuple[dict[str, Any], ...] = ()
    symmetries: tuple[dict[str, Any], ...] = ()

    @property
    def claims_words(self) -> str:
        """The number of claims that are proved, as `8 proved`; `3 (2 tested)` are three with one that is proved."""
        return _words(self.verdicts)

    @property
    def symmetries_words(self) -> str:
        """The same of symmetries."""
        return _words(self.symmetries)

    @property
    def examples_words(self) -> str:
        """The number of examples that hold, or of those that do not."""
        if self.wrong_examples:
            return f"{self.wrong_examples} wrong"
        return str(self.examples or "")


def _words(records: Sequence[dict[str, Any]]) -> str:
    statuses = Counter(record["status"] for record in records)
    proved = statuses["proved"]
    tested = statuses["tested"]
    if len(records) > proved + tested:
        return f"{len(records) - proved - tested} failed"
    if proved and tested:
        return f"{len(records)} ({tested} tested)"
    if proved:
        return f"{proved} proved"
    return f"{tested} tested" * bool(tested)


def finding(report: Report, examples: int) -> Finding:
    """Summarise a report in which so many examples were checked."""
    method = report.method
    how = f"{method.points:,} samples"
    if method.exact:
        how = f"all {method.points:,} points" if method.points else "bounds"
    claims = []
    for v in report.verdicts:
        record = {"claim": v.claim.text, "parameters": dict(v.parameters), "status": v.status, "detail": v.detail}
        claims.append(record | {"episodes": v.episodes})
    symmetries = []
    for each in report.symmetries:
        status = "false"
        if each.problem is None:
            status = "proved" if each.is_proved else "tested"
        symmetries.append(
            {"symmetry": each.symmetry.name, "status": status, "detail": each.problem or "", "points": each.points}
        )
    return Finding(
        report.diagnostics, how, str(method), len(report.cases), report.skipped, report.accepted, examples,
        len(report.wrong_examples), tuple(claims), tuple(symmetries),
    )  # fmt: skip


Examine = Callable[["Task"], Finding]


@dataclass(frozen=True, slots=True)
class Checked:
    """One task of a file: the result, and the seconds that it took.

    `id` is None where the task could not be built, and `task` also where it was checked in another process.
    """

    name: str
    variant: str | None
    id: str | None
    task: Task | None
    finding: Finding
    seconds: float

    @property
    def title(self) -> str:
        """The task's id; its name where it could not be built."""
        return self.id or self.name

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        return self.finding.diagnostics


@dataclass(frozen=True, slots=True)
class FileReport:
    """One file: its tasks, each of its problems once, and the warnings that it accepts; of other kinds, how many entries."""

    path: str
    tasks: tuple[Checked, ...]
    diagnostics: tuple[Diagnostic, ...]
    accepted: tuple[Accepted, ...] = ()
    kind: scan.Kind = "taskspec"
    entries: int = 0


@dataclass(frozen=True, slots=True)
class FileCheck:
    """The check of one file, to be run here or in another process."""

    path: Path
    run: Callable[[], FileReport]


@contextmanager
def started(checks: Sequence[FileCheck], jobs: int | None = None) -> Iterator[Callable[[], list[FileReport]]]:
    """Start checks; within the block, a function waits for their reports, and gives them in order.

    Args:
        jobs: processes; None for one for each processor. In several, reports leave the tasks out.
    """
    processes = min(jobs or os.cpu_count() or 1, len(checks))
    has_threads = threading.active_count() > 1 or "jax" in sys.modules
    if processes < 2 or has_threads or sys.platform in ("darwin", "win32"):  # such a process cannot be forked safely
        yield lambda: [check.run() for check in telling(checks, lambda check: str(check.path))]
        return
    longest_first = sorted(range(len(checks)), key=lambda i: -checks[i].path.stat().st_size)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork")) as pool:
        running = {i: pool.submit(_run_apart, checks[i]) for i in longest_first}

        def reports() -> list[FileReport]:
            done = {i: running[i].result() for i in telling(longest_first, lambda i: str(checks[i].path))}
            return [done[i] for i in range(len(checks))]

        try:
            yield reports
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _run_apart(check: FileCheck) -> FileReport:
    with progress_listener(lambda what, share: None):  # the first process reports progress
        report = check.run()
    tasks = tuple(dataclasses.replace(each, task=None) for each in report.tasks)
    return dataclasses.replace(report, tasks=tasks)


def check_file(file: File, prove: Examine) -> FileReport:
    """Check all tasks of a file with `prove`; problems are part of the report, not raised."""
    path = str(file.path)
    try:
        variants = variants_of(file)
    except SpecError as error:
        return FileReport(path, (), error.diagnostics)
    checked = settled([check_task(file, variant, prove) for variant in variants])
    accepted = {(a.warning.code, a.place.line, a.place.column): a for each in checked for a in each.finding.accepted}
    return FileReport(path, checked, once(checked), tuple(accepted.values()))


def check_task(file: File, variant: str | None, prove: Examine) -> Checked:
    """Build one task, and check it with `prove`."""
    start = time.perf_counter()
    try:
        task = task_in(file, variant)
    except SpecError as error:
        try:
            name = name_of(file, variant)
        except SpecError:  # an id whose file cannot be read
            name = variant or file.path.stem
        return Checked(name, variant, None, None, Finding(error.diagnostics, "not built"), time.perf_counter() - start)
    tell(task.id)
    try:
        found = prove(task)
    except SpecError as error:  # of one task, so that the others are still looked at
        place = task.source.document.span(("name",))
        placed = [d if d.span is not None else dataclasses.replace(d, span=place) for d in error.diagnostics]
        found = Finding(in_order(placed), "given up")
    return Checked(task.name, variant, task.id, task, found, time.perf_counter() - start)


def settled(checked: Sequence[Checked]) -> tuple[Checked, ...]:
    """Return the same tasks without W511 for an entry of `accept` that another task, which shares it, needs."""
    needed = {a.place for each in checked for a in each.finding.accepted}
    found = []
    for each in checked:
        left = tuple(d for d in each.diagnostics if not (d.code == "W511" and d.span in needed))
        found.append(dataclasses.replace(each, finding=dataclasses.replace(each.finding, diagnostics=left)))
    return tuple(found)


def once(checked: Sequence[Checked]) -> tuple[Diagnostic, ...]:
    """Return problems in order of place; those that several variants inherit once, with a note of who shares them."""
    sharing: dict[tuple[Any, ...], list[str]] = {}
    first: dict[tuple[Any, ...], Diagnostic] = {}
    for each in checked:
        seen: Counter[tuple[Any, ...]] = Counter()
        for diagnostic in each.diagnostics:
            span = diagnostic.span
            place = None
            if span is not None:
                place = (span.line, span.column, span.end_line, span.end_column)
            here = (diagnostic.code, place or diagnostic.message)
            seen[here] += 1
            key = (*here, seen[here])  # several of one task at one place are several
            first.setdefault(key, diagnostic)
            names = sharing.setdefault(key, [])
            if each.name not in names:
                names.append(each.name)
    found = []
    if checked:  # the task of the spec itself, or of its first variant
        spec = checked[0].name
    else:
        spec = ""
    for key, diagnostic in first.items():
        names = sharing[key]
        if names != [spec]:
            note = f"in {', '.join(names)}"
            if names[0] == spec:
                note = f"the same in {', '.join(names[1:])}"
            diagnostic = dataclasses.replace(diagnostic, notes=(*diagnostic.notes, note))
        found.append(diagnostic)
    return tuple(sorted(found, key=lambda d: (0, 0) if d.span is None else (d.span.line, d.span.column)))


def counts(diagnostics: Iterable[Diagnostic]) -> tuple[int, int]:
    """Return the numbers of errors and of warnings."""
    severities = [d.severity for d in diagnostics]
    return severities.count("error"), severities.count("warning")
