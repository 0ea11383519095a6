"""Processes that work through a range of numbers each and say lines of JSON; and on what machine they did."""

from __future__ import annotations

import json
import os
import platform
import selectors
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from taskspec import __version__

STUCK = 600
"""Seconds without a word after which a process is ended: something that no alarm inside it can interrupt."""
ALONE = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""A process computes in one thread: others that wait would be counted as its time."""


def records(worker: str, first: int, last: int, *more: str, **environment: str) -> Iterator[dict[str, Any]]:
    """What a process says of numbers first, ..., last - 1; where one ends it, another goes on with the next.

    `worker` is the module that it runs, with both numbers and `more`. It says `{"begun": number}` before each, and
    `{"peak": bytes}` at its end; for one that did not come so far, the last record is `{"begun": number, "died": status}`.
    """
    while first < last:
        command = [sys.executable, "-m", worker, str(first), str(last), *more]
        begun = first
        done = False
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=os.environ | ALONE | environment) as process:
            for record in _heard(process):
                begun = record.get("begun", begun)
                done |= "peak" in record
                yield record
        if done:
            return
        yield {"begun": begun, "died": process.returncode}
        first = begun + 1


def _heard(process: subprocess.Popen[bytes]) -> Iterator[dict[str, Any]]:
    """The lines of a process, which is ended when it falls silent."""
    assert process.stdout is not None
    ready = selectors.DefaultSelector()
    rest = b""
    ready.register(process.stdout, selectors.EVENT_READ)
    while ready.select(STUCK):
        chunk = os.read(process.stdout.fileno(), 1 << 16)
        if not chunk:
            return
        *lines, rest = (rest + chunk).split(b"\n")
        yield from map(json.loads, lines)
    process.kill()


def machine(seconds: float, jobs: int, *libraries: str) -> str:
    """When a run was made, how long it took, and on what."""
    system = f"{platform.system()} {platform.machine()}, {jobs} processes, Python {platform.python_version()}"
    versions = ", ".join((f"taskspec {__version__}", *(f"{name} {version(name)}" for name in libraries)))
    return f"{datetime.now(UTC).date()}, {seconds:.0f} s on {system}, {versions}"
