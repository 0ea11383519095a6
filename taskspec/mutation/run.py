"""All mutants of a spec, judged in several processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from taskspec.mutation.judge import Judgement, Original, judge
from taskspec.mutation.mutants import Mutant, mutants
from taskspec.source import read_file

PART = 8
"""Mutants that a process is handed at once."""


def judgements(
    path: Path, jobs: int = 1, tick: Callable[[], None] = lambda: None
) -> Iterator[tuple[Mutant, Judgement]]:
    """What becomes of every mutant of a spec, in the order of the file.

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
        yield lambda paths, numbers: map(_judged, paths, numbers)
        return
    context = multiprocessing.get_context("spawn")  # what is forked from threads may wait for ever
    with ProcessPoolExecutor(jobs, context) as pool:
        yield lambda paths, numbers: pool.map(_judged, paths, numbers, chunksize=PART)


def _judged(path: Path, number: int) -> Judgement:
    original, found = _prepared(path)
    return judge(original, found[number])


@lru_cache(maxsize=1)
def _prepared(path: Path) -> tuple[Original, list[Mutant]]:
    """The spec as it stands, and its mutants; read once in each process."""
    document = read_file(path)
    return Original.of(document), list(mutants(document))
