"""Which tests are asked about a change: those that run its line, fast ones first."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from tests.verification.mutants.changes import Mutant
from tests.verification.mutants.rooms import ROOT, Room, asked, is_own

BUDGETS = (20.0, 40.0)
"""Seconds of tests of the room, and of all others, that a change is put through. Under coverage they took about twice as long."""
AGAIN = 3
"""How many times as many for a change that they have not noticed, and that is asked about again."""


class Timed(NamedTuple):
    name: str
    seconds: float


@dataclass(frozen=True)
class Seen:
    """What one file of tests runs: by file of the source and by line the numbers of its tests."""

    path: Path
    tests: list[Timed]
    lines: dict[str, dict[int, list[int]]]

    def of(self, file: str, first: int, last: int) -> list[Timed]:
        """The tests that run one of the lines, the fastest first."""
        numbers = {n for line, ran in self.lines.get(file, {}).items() if first <= line <= last for n in ran}
        return sorted((self.tests[n] for n in numbers), key=lambda test: test.seconds)


def chosen(mutant: Mutant, room: Room, seen: Sequence[Seen], again: bool = False) -> list[Timed]:
    """Tests that are asked about a change: those about the room, then all others, files with little to run first.

    A line of a table runs once, when the module is read: what runs anything of its file is asked then, or of the room. Where a
    change is asked about `again`, these tests come as well, last: a test that finds a result in a cache does not run the line.
    """
    ways = [(mutant.line, mutant.line), mutant.span] if mutant.place else []
    for first, last in (*ways, (1, sys.maxsize)):
        found = [(s, s.of(mutant.file, first, last)) for s in seen]
        if any(tests for _, tests in found):
            rest = [s.of(mutant.file, 1, sys.maxsize) if again else [] for s in seen]
            found = [(s, list(dict.fromkeys([*tests, *more]))) for (s, tests), more in zip(found, rest, strict=True)]
            break
    else:
        files = sorted({file for s in seen for file in s.lines if file.startswith(room.folder)})
        found = [(s, list(dict.fromkeys(t for file in files for t in s.of(file, 1, sys.maxsize)))) for s in seen]
    halves = ([tests for s, tests in found if is_own(room, s.path) is own] for own in (True, False))
    return [
        test
        for half, budget in zip(halves, BUDGETS, strict=True)
        for tests in _affordable(half, budget * (AGAIN if again else 1))
        for test in tests
    ]


def _affordable(files: list[list[Timed]], budget: float) -> list[list[Timed]]:
    """One test of each file in turn, until the time is spent; then file by file, the ones that take least first."""
    kept: list[list[Timed]] = [[] for _ in files]
    for turn in zip_longest(*files):
        for test, some in zip(turn, kept, strict=True):
            if test is not None and test.seconds <= budget:
                budget -= test.seconds
                some.append(test)
    return sorted(kept, key=lambda tests: sum(test.seconds for test in tests))


def mapped(room: Room, folder: Path) -> list[Seen]:
    """What each file of tests runs, by coverage.py: made once, and again where a file of tests is newer than its map."""
    found = []
    for path in asked(room):
        kept = folder / f"{path.stem}.json"
        if not kept.exists() or kept.stat().st_mtime < path.stat().st_mtime:
            print(f"mapping {path.relative_to(ROOT)}", flush=True)
            command = [sys.executable, "-m", "tests.verification.mutants.cover", str(path.relative_to(ROOT)), str(kept)]
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))}
            subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False, env=environment)
        record = json.loads(kept.read_text())
        lines = {file: {int(k): ran for k, ran in by_line.items()} for file, by_line in record["lines"].items()}
        found.append(Seen(path, [Timed(*t) for t in zip(record["tests"], record["seconds"], strict=True)], lines))
    return found
