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

    from taskspec.abstraction.symmetry_proofs import SymmetryCheck
    from taskspec.check.names import Accepted
    from taskspec.check.report import Report
    from taskspec.model.points import Method
    from taskspec.rules.claims import Verdict
    from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of checking one task.

    `how` says in a few words how soundness was decided, `method` in full. `cases` counts the other parameter values that
    were tried, `proved` and `tested` the claims of these statuses (`exact.statuses`), which `verdicts` has one by one, as
    `--json` writes them.
    `accepted` are the warnings that the spec gives a reason for, which are not among the `diagnostics`.
    """

    diagnostics: tuple[Diagnostic, ...]
    how: str = ""
    method: str = ""
    cases: int = 0
    claims: int = 0
    proved: int = 0
    tested: int = 0
    skipped: str | None = None
    accepted: tuple[Accepted, ...] = ()
    examples: int = 0
    wrong_examples: int = 0
    verdicts: tuple[dict[str, Any], ...] = ()
    symmetries: tuple[dict[str, Any], ...] = ()

    @property
    def claims_words(self) -> str:
        """`8 proved`, or what became of them otherwise; `3 (2 tested)` are three of which one is proved."""
        return _words(self.claims, self.proved, self.tested)

    @property
    def symmetries_words(self) -> str:
        """The same of symmetries."""
        statuses = [each["status"] for each in self.symmetries]
        return _words(len(statuses), statuses.count("proved"), statuses.count("tested"))

    @property
    def examples_words(self) -> str:
        """How many examples hold, or how many do not."""
        return f"{self.wrong_examples} wrong" if self.wrong_examples else f"{self.examples}" if self.examples else ""


def _words(count: int, proved: int, tested: int) -> str:
    if count > proved + tested:
        return f"{count - proved - tested} failed"
    if proved and tested:
        return f"{count} ({tested} tested)"
    return f"{proved} proved" if proved else f"{tested} tested" if tested else ""


def finding(report: Report, examples: int) -> Finding:
    """Summarise a report in which so many examples were checked."""
    statuses = [verdict.status for verdict in report.verdicts]
    return Finding(
        report.diagnostics, _how(report.method), str(report.method), len(report.cases), len(statuses),
        statuses.count("proved"), statuses.count("tested"), report.skipped, report.accepted,
        examples, len(report.wrong_examples), tuple(map(_claim, report.verdicts)), tuple(map(_symmetry, report.symmetries)),
    )  # fmt: skip


def _claim(verdict: Verdict) -> dict[str, Any]:
    """Return one claim for one choice of parameters, with its status (`exact.statuses`)."""
    return {
        "claim": verdict.claim.text, "parameters": dict(verdict.parameters), "status": verdict.status,
        "detail": verdict.detail, "episodes": verdict.episodes,
    }  # fmt: skip


def _symmetry(found: SymmetryCheck) -> dict[str, Any]:
    """Return one symmetry: `points` is how many it was tested at, 0 where it is proved."""
    status = "false" if found.problem is not None else "proved" if found.is_proved else "tested"
    return {
        "symmetry": found.symmetry.name, "status": status, "detail": found.problem or "", "points": found.points
    }  # fmt: skip


def _how(method: Method) -> str:
    if not method.exact:
        return f"{method.points:,} samples"
    return f"all {method.points:,} points" if method.points else "bounds"


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
    if processes < 2 or not _can_fork():
        yield lambda: [check.run() for check in telling(checks, lambda check: str(check.path))]
        return
    longest_first = sorted(range(len(checks)), key=lambda i: -_length(checks[i].path))
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


def _can_fork() -> bool:
    """Return whether this process can be forked safely: on macOS none can, nor one with threads, such as those of JAX."""
    return sys.platform not in ("darwin", "win32") and threading.active_count() == 1 and "jax" not in sys.modules


def _length(path: Path) -> int:
    """Return the length of a file, by which the time that its check takes is guessed."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


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
    return FileReport(path, checked, once(checked), accepted_by(checked))


def check_task(file: File, variant: str | None, prove: Examine) -> Checked:
    """Build one task, and check it with `prove`."""
    start = time.perf_counter()
    try:
        task = task_in(file, variant)
    except SpecError as error:
        found = Finding(error.diagnostics, "not built")
        return Checked(_name(file, variant), variant, None, None, found, time.perf_counter() - start)
    tell(task.id)
    try:
        found = prove(task)
    except SpecError as error:  # of one task, so that the others are still looked at
        place = task.document.span(("name",))
        placed = [d if d.span is not None else dataclasses.replace(d, span=place) for d in error.diagnostics]
        found = Finding(in_order(placed), "given up")
    return Checked(task.name, variant, task.id, task, found, time.perf_counter() - start)


def _name(file: File, variant: str | None) -> str:
    try:
        return name_of(file, variant)
    except SpecError:  # an id whose file cannot be read
        return variant or file.path.stem


def settled(checked: Sequence[Checked]) -> tuple[Checked, ...]:
    """Return the same tasks without W511 for an entry of `accept` that another task, which shares it, needs."""
    needed = {a.place for each in checked for a in each.finding.accepted}

    def without(each: Checked) -> Checked:
        left = tuple(d for d in each.diagnostics if not (d.code == "W511" and d.span in needed))
        return dataclasses.replace(each, finding=dataclasses.replace(each.finding, diagnostics=left))

    return tuple(map(without, checked))


def once(checked: Sequence[Checked]) -> tuple[Diagnostic, ...]:
    """Return problems in order of place; those that several variants inherit once, with a note of who shares them."""
    sharing: dict[tuple[Any, ...], list[str]] = {}
    first: dict[tuple[Any, ...], Diagnostic] = {}
    for each in checked:
        told_here: Counter[tuple[Any, ...]] = Counter()
        for diagnostic in each.diagnostics:
            span = diagnostic.span
            place = None if span is None else (span.line, span.column, span.end_line, span.end_column)
            here = (diagnostic.code, place or diagnostic.message)
            told_here[here] += 1
            key = (*here, told_here[here])  # several of one task at one place are several
            first.setdefault(key, diagnostic)
            names = sharing.setdefault(key, [])
            if each.name not in names:
                names.append(each.name)
    names = [each.name for each in checked]
    told = [_with_note(diagnostic, sharing[key], names[0]) for key, diagnostic in first.items()]
    return tuple(sorted(told, key=lambda d: (0, 0) if d.span is None else (d.span.line, d.span.column)))


def accepted_by(checked: Sequence[Checked]) -> tuple[Accepted, ...]:
    """Return the warnings that some task accepts; those that several variants inherit once."""
    found = {(a.warning.code, a.place.line, a.place.column): a for each in checked for a in each.finding.accepted}
    return tuple(found.values())


def _with_note(diagnostic: Diagnostic, names: list[str], spec: str) -> Diagnostic:
    """`spec` is the task of the spec itself, or of its first variant."""
    if names == [spec]:
        return diagnostic
    note = f"the same in {', '.join(names[1:])}" if names[0] == spec else f"in {', '.join(names)}"
    return dataclasses.replace(diagnostic, notes=(*diagnostic.notes, note))


def counts(diagnostics: Iterable[Diagnostic]) -> tuple[int, int]:
    """Return the numbers of errors and of warnings."""
    severities = [d.severity for d in diagnostics]
    return severities.count("error"), severities.count("warning")
