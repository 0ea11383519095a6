"""What notices that a spec was changed, for all mutants of a spec in several processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
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

# What notices that a spec was changed: the compiler, the checks, its examples, its claims, or nothing at all.

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
    if _decides_values_alone(mutant):
        wrong = next((d for _, task in pairs for d in _ranges(task)), None)
        return Judgement("range") if wrong is None else Judgement.by("error", wrong)
    if wrong := next((d for _, task in pairs for _, d in wrong_examples(task)), None):
        return Judgement.by("example", wrong)  # which costs least
    pairs = [pair for pair in pairs if not everywhere(same_task, *pair)]
    if not pairs:
        return Judgement("equivalent")
    for look in (_check, _ranges):
        if found := sorted(((_class(d), d) for _, task in pairs for d in look(task)), key=lambda x: _ORDER.index(x[0])):
            return Judgement.by(*found[0])
    return Judgement("order" if mutant.renumbers else "silent")


def _check(task: Task) -> tuple[Diagnostic, ...]:
    return check(task, ranges=False).diagnostics


def _ranges(task: Task) -> tuple[Diagnostic, ...]:
    return check_ranges(task).diagnostics if task.parameters else ()


_ORDER: tuple[Class, ...] = ("error", "claim", "warning")


def _class(diagnostic: Diagnostic) -> Class:
    """Return what a diagnostic counts as."""
    if diagnostic.severity == "warning":
        return "warning"
    return "claim" if diagnostic.code.startswith("E6") else "error"


def _changed(original: Original, document: Document) -> Iterator[tuple[Task, Task]]:
    """Yield the tasks whose data the change is part of, before and after it."""
    for variant, before in original.tasks.items():
        if merge(original.document, variant).data != merge(document, variant).data:
            yield before, build(document, variant)


def _decides_values_alone(mutant: Mutant) -> bool:
    """Return whether only the range of a parameter was changed."""
    return mutant.section == "parameters" and mutant.path[-1] in ("low", "high")


def everywhere(same: Callable[[Task, Task], bool], one: Task, other: Task) -> bool:
    """Return whether two tasks are the same for their parameters as they are, and for all others that are tried."""
    if not same(one, other):
        return False
    for values in cases(one):
        try:
            pair = [build(task.document, task.variant, values, task.suite) for task in (one, other)]
        except SpecError:
            return False
        if not same(*pair):
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


# All mutants of a spec, judged in several processes.

PART = 8
"""Mutants that a process is handed at once."""


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
    with _mapping(jobs) as mapped:
        for mutant, judgement in zip(made, mapped([path] * len(made), range(len(made))), strict=True):
            tick()
            yield mutant, judgement


@contextmanager
def _mapping(jobs: int) -> Iterator[Callable[[list[Path], range], Iterable[Judgement]]]:
    """A way to judge many mutants, here or in other processes."""
    if jobs == 1:
        yield lambda paths, numbers: map(_judge_number, paths, numbers)
        return
    context = multiprocessing.get_context("spawn")  # what is forked from threads may wait for ever
    with ProcessPoolExecutor(jobs, context) as pool:
        yield lambda paths, numbers: pool.map(_judge_number, paths, numbers, chunksize=PART)


def _judge_number(path: Path, number: int) -> Judgement:
    original, found = _prepared(path)
    return judge(original, found[number])


@lru_cache(maxsize=1)
def _prepared(path: Path) -> tuple[Original, list[Mutant]]:
    """Return the spec as it stands, and its mutants; read once in each process."""
    document = read_file(path)
    return Original.of(document), list(mutants(document))
