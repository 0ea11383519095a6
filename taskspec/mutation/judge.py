"""What notices that a spec was changed: the compiler, the checks, its examples, its claims, or nothing at all."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.check.report import check
from taskspec.mutation.mutants import Mutant, mutants
from taskspec.mutation.same import same_task
from taskspec.rules.examples import wrong_examples
from taskspec.soundness.soundness import cases, check_ranges
from taskspec.source import Document, read_file
from taskspec.task.build import build
from taskspec.task.merge import merge, variant_names
from taskspec.task.task import Task

Class = Literal["error", "example", "claim", "warning", "equivalent", "range", "order", "silent", "slow"]
CLASSES: Mapping[Class, str] = {
    "error": "the changed spec is refused, or unsound",
    "example": "an example does not hold any more",
    "claim": "a claim does not hold any more, or cannot be decided",
    "warning": "the changed spec is warned about",
    "equivalent": "proved to be the same task",
    "range": "the same tasks; other parameter values are allowed",
    "order": "the same task; its labels are numbered otherwise",
    "silent": "nothing notices",
    "slow": "not decided in time",
}
SECONDS = 60
"""After which a change is `slow`, where the system has timers."""
PART = 8
"""Mutants that a process is handed at once."""


def has_timers() -> bool:
    """Return whether changes that take too long can be given up: Windows has no signal for that."""
    return hasattr(signal, "SIGALRM")


@dataclass(frozen=True, slots=True)
class Judgement:
    """What became of a mutant; and what was said of it, which has no place, for nobody has written its text."""

    kind: Class
    code: str | None = None
    message: str | None = None

    @classmethod
    def by(cls, kind: Class, found: Diagnostic) -> Judgement:
        return cls(kind, found.code, found.message)


@dataclass(frozen=True)
class Original:
    """A spec as it stands: its tasks by variant, and what they are for other parameter values."""

    document: Document
    tasks: Mapping[str | None, Task]

    @classmethod
    def of(cls, document: Document) -> Original:
        """Raises SpecError when the document has no task, or one with mistakes that its own sections cause."""
        names = list(variant_names(document.data).values())
        complete = [variant for variant in names if not merge(document, variant).missing]
        return cls(document, {variant: build(document, variant) for variant in complete})


def judge(original: Original, mutant: Mutant) -> Judgement:
    """Return what notices a mutant: the first of the stages that does, and of all that a check says what weighs most."""
    try:
        with _within(SECONDS):
            return _judged(original, mutant)
    except TimeoutError:
        return Judgement("slow")


def _judged(original: Original, mutant: Mutant) -> Judgement:
    try:
        document = mutant.document()
        pairs = list(_changed(original, document))
    except SpecError as error:
        return Judgement.by("error", error.diagnostics[0])
    if mutant.section == "parameters" and mutant.path[-1] in ("low", "high"):  # it decides the range of values alone
        for _, task in pairs:
            for diagnostic in check_ranges(task).diagnostics:
                return Judgement.by("error", diagnostic)
        return Judgement("range")
    for _, task in pairs:
        for _, diagnostic in wrong_examples(task):
            return Judgement.by("example", diagnostic)  # which costs least
    pairs = [pair for pair in pairs if not _are_same_everywhere(*pair)]
    if not pairs:
        return Judgement("equivalent")
    found: list[Diagnostic] = []
    for _, task in pairs:
        found += check(task, ranges=False).diagnostics
    if not found:
        for _, task in pairs:
            found += check_ranges(task).diagnostics
    by_class = {_class_of(diagnostic): diagnostic for diagnostic in reversed(found)}
    for kind in ("error", "claim", "warning"):
        if kind in by_class:
            return Judgement.by(kind, by_class[kind])
    return Judgement("order" if mutant.renumbers else "silent")


def _class_of(diagnostic: Diagnostic) -> Class:
    if diagnostic.severity == "warning":
        return "warning"
    return "claim" if diagnostic.code.startswith("E6") else "error"


def _changed(original: Original, document: Document) -> Iterator[tuple[Task, Task]]:
    """Yield the tasks whose data the change is part of, before and after it."""
    for variant, before in original.tasks.items():
        if merge(original.document, variant).data != merge(document, variant).data:
            yield before, build(document, variant)


def _are_same_everywhere(one: Task, other: Task) -> bool:
    """Return whether two tasks are the same for their parameters as they are, and for all others that are tried."""
    if not same_task(one, other):
        return False
    for values in cases(one):
        try:
            pair = [build(task.document, task.variant, values, task.suite) for task in (one, other)]
        except SpecError:
            return False
        if not same_task(*pair):
            return False
    return True


@contextmanager
def _within(seconds: int) -> Iterator[None]:
    """Raise TimeoutError when the inside takes longer, where the system has timers."""
    if not has_timers():
        yield
        return

    def stop(*_: Any) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def judgements(
    path: Path, jobs: int = 1, tick: Callable[[], None] = lambda: None
) -> Iterator[tuple[Mutant, Judgement]]:
    """Yield what becomes of every mutant of a spec, in the order of the file.

    Args:
        jobs: processes; with one, everything happens here.
        tick: called whenever a mutant is judged.

    Raises:
        SpecError: when the spec itself cannot be built.
    """
    made = _prepared(path)[1]
    with ExitStack() as stack:
        mapped: Any = map
        if jobs > 1:
            context = multiprocessing.get_context("spawn")  # what is forked from threads may wait for ever
            pool = stack.enter_context(ProcessPoolExecutor(jobs, context))
            mapped = partial(pool.map, chunksize=PART)
        numbers = range(len(made))
        for mutant, judgement in zip(made, mapped(_judge_number, [path] * len(made), numbers), strict=True):
            tick()
            yield mutant, judgement


def _judge_number(path: Path, number: int) -> Judgement:
    original, found = _prepared(path)
    return judge(original, found[number])


@lru_cache(maxsize=1)
def _prepared(path: Path) -> tuple[Original, list[Mutant]]:
    """Return the spec as it stands, and its mutants; read once in each process."""
    document = read_file(path)
    return Original.of(document), list(mutants(document))
