"""Processes that examine a range of numbers each and say a line of JSON on each number; what all of them came to."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from taskspec import __version__

CHUNK = 1000

ALONE = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""A worker computes in one thread: others that wait would be counted as its time."""


@dataclass
class Tally:
    """What a run came to."""

    specs: int = 0
    made: Counter[str] = field(default_factory=Counter)
    """Specs by stage."""
    compared: Counter[str] = field(default_factory=Counter)
    """Steps, rows, numbers by stage."""
    found: list[dict[str, Any]] = field(default_factory=list)
    peak: int = 0
    heaviest: int | None = None
    """The spec after which memory was at its peak."""
    slowest: float = 0.0

    def add(self, record: dict[str, Any]) -> None:
        if record.get("peak", 0) > self.peak:
            self.peak, self.heaviest = record["peak"], record.get("spec")
        if "spec" not in record:
            return
        self.specs += 1
        self.slowest = max(self.slowest, record["seconds"])
        self.made.update(record["made"].keys())
        self.compared.update(record["made"])
        self.found += [{"spec": record["spec"], **f} for f in record["found"]]


def records(worker: str, first: int, last: int, more: str) -> Iterator[dict[str, Any]]:
    """What a process says of its specs; where one kills it, another goes on with the next.

    `worker` is the module that it runs, with the numbers of the first spec and of the last, and `more`.
    """
    while first < last:
        command = [sys.executable, "-m", worker, str(first), str(last), more]
        begun = last
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | ALONE) as process:
            assert process.stdout is not None
            for line in process.stdout:
                record = json.loads(line)
                begun = record.get("begun", begun)
                yield record
        if process.returncode == 0:
            return
        detail = f"the process ended with {process.returncode}"
        yield {"spec": begun, "made": {}, "seconds": 0, "found": [{"stage": "any", "what": "died", "detail": detail}]}
        first = begun + 1


def run(worker: str, specs: int, seed: int, jobs: int, more: str, chunk: int = CHUNK) -> Tally:
    tally = Tally()
    starts = range(seed, seed + specs, chunk)
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lambda a: list(records(worker, a, min(a + chunk, seed + specs), more)), starts):
            for record in found:
                tally.add(record)
    return tally


def faults(tally: Tally) -> str:
    """A line for each kind of fault: how often it was found, and where first."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for finding in tally.found:
        kinds.setdefault(f"{finding['stage']}: {finding['what']}", []).append(finding)
    return "".join(
        f"{len(many)} × {kind}: spec {many[0]['spec']}: {worded(many[0])[:200]}\n" for kind, many in kinds.items()
    )


def worded(finding: dict[str, Any]) -> str:
    """A finding in a line: the last of a traceback, the first of anything else."""
    lines = finding["detail"].strip().splitlines()
    return lines[-1] if finding["what"].startswith(("crash", "raised")) else lines[0]


def endings(tally: Tally) -> str:
    """How many differences, crashes and hangs there were, and what the run took."""
    kinds = Counter(f["what"].split()[0] for f in tally.found)
    crashes, hangs = kinds["crash"] + kinds["died"], kinds["hang"]
    where = "" if tally.heaviest is None else f" (spec {tally.heaviest})"
    return (
        f"{len(tally.found) - crashes - hangs} differences, {crashes} crashes, {hangs} hangs, "
        f"slowest {tally.slowest:.1f} s, peak memory {tally.peak / 2**20:.0f} MB{where}"
    )


def machine(seconds: float, jobs: int, *libraries: str) -> str:
    """When a run was made, how long it took, and on what."""
    system = f"{platform.system()} {platform.machine()}, {jobs} processes, Python {platform.python_version()}"
    versions = ", ".join((f"taskspec {__version__}", *(f"{name} {version(name)}" for name in libraries)))
    return f"{datetime.now(UTC).date()}, {seconds:.0f} s on {system}, {versions}"
