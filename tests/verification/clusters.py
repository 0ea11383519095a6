"""A sweep and an exam on a Dask cluster that is killed in the middle, and the same on this machine alone.

`python -m tests.verification.clusters [N]` tells what happens, by default to 2,000 instances and to 2,000 trials.
"""

from __future__ import annotations

import csv
import importlib
import json
import re
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

from taskspec.exam import examine
from taskspec.experiments import read, sweep
from taskspec.learn.experiments.sweeping import WRITERS
from taskspec.learn.jobs.running import Running
from tests.learn.learners import counting

EXPERIMENT = """
experiment: 1
name: many
tasks:
  - task: derail/Branching
    parameters: {{L: {{range: [2, {end}]}}, B: {{range: [2, 12]}}}}
measures: []
"""
PATIENCE = 1200
"""Seconds in which everything has to come to its end."""
RUNS = ("sweep", "exam")
SECONDS = re.compile(r'"seconds": [^,}]+')
OF_A_RUN = ("seconds", "cost", "machine", "command")
"""Names of entries of results that tell of the run."""


class Cluster:
    """A scheduler and two workers on the loopback interface, each of them a process."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.folder = folder
        self.start()

    def start(self) -> None:
        self.scheduler = self._process("scheduler", "--port", self.port)
        self.workers = [self._process("worker", self.address, "--nthreads", 1, "--no-nanny") for _ in range(2)]

    def _process(self, kind: str, *arguments: object) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", kind, *map(str, arguments), "--host", "127.0.0.1", "--no-dashboard"]
        with (self.folder / "dask.txt").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)

    def kill(self) -> None:
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()


def measured(folder: Path, out: Path, running: Running) -> None:
    """Sweep the experiment of a folder, and write its tables."""
    swept = sweep(read(folder / "many.yaml"), out / "many.sqlite", running=running)
    for kind in ("csv", "json"):
        WRITERS[kind](swept.rows, out / f"many.{kind}")


def examined(out: Path, trials: int, running: Running) -> None:
    """Examine a learner in so many trials."""
    examine(
        f"{counting.__file__}:clone", tasks=["RiskyPath", "Branching"], seeds=trials // 2, steps=100, transitions=100, twins=0,
        peeks=False, out=out, running=running,
    )  # fmt: skip


def begin(folder: Path, out: Path, count: int, running: Running) -> list[Future[None]]:
    """Begin a sweep of so many instances, and an exam of so many trials."""
    (out / "sweep").mkdir(parents=True, exist_ok=True)
    threads = ThreadPoolExecutor(2)
    begun = [
        threads.submit(measured, folder, out / "sweep", running),
        threads.submit(examined, out / "exam", count, running),
    ]
    threads.shutdown(wait=False)
    return begun


def results(folder: Path) -> list[list[tuple[str, ...]]]:
    """Return key, name, status and result of all that the sweep and the exam of a folder have kept so far; but for the seconds
    that a trial took, byte for byte.
    """
    found = []
    for path in (folder / "sweep" / "many.sqlite", folder / "exam" / "exam.sqlite"):
        rows = []
        if path.exists():
            with closing(sqlite3.connect(path, timeout=PATIENCE)) as database:
                if database.execute("select count(*) from sqlite_master").fetchone()[0]:
                    kept = database.execute("select key, name, status, result from results order by key")
                    rows = [(*about, SECONDS.sub("", result)) for *about, result in kept]
        found.append(rows)
    return found


def written(folder: Path) -> list[Any]:
    """Return the contents of the files, but for those entries."""
    with (folder / "sweep" / "many.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    tables = [rows, json.loads((folder / "sweep" / "many.json").read_text(encoding="utf-8"))]
    exam = json.loads((folder / "exam" / "exam.json").read_text(encoding="utf-8"))
    for entry in (*tables[0], *tables[1], *exam["scores"], exam):
        for name in OF_A_RUN:
            entry.pop(name, None)
    return [*tables, exam]


def killed(folder: Path, count: int, say: Callable[[str], object]) -> None:
    """Run both on a cluster, of which a worker and then the scheduler are killed, and go on on a new one.

    AssertionError: what comes of it is not the same as on this machine.
    """
    importlib.import_module("distributed")  # which two threads must not begin to do at a time
    (folder / "many.yaml").write_text(EXPERIMENT.format(end=2 + count // 10), encoding="utf-8")
    there = folder / "cluster"
    here = folder / "here"
    start = time.monotonic()

    def tell(what: str) -> list[int]:
        kept = [len(rows) for rows in results(there)]
        counts = ", ".join(f"{number:,} of the {name}" for name, number in zip(RUNS, kept, strict=True))
        say(f"{time.monotonic() - start:4.0f} s  {what}; results kept: {counts}")
        return kept

    def wait(share: float) -> None:
        while any(not run.done() and len(rows) < share * count for run, rows in zip(runs, results(there), strict=True)):
            assert time.monotonic() < start + PATIENCE
            time.sleep(0.02)
        assert not all(run.done() for run in runs), [run.exception() for run in runs if run.done()]

    cluster = Cluster(folder)
    try:
        runs = begin(folder, there, count, Running(cluster=cluster.address))
        wait(0.1)
        tell("a worker of two is killed")
        cluster.workers[0].kill()
        wait(0.3)
        tell("the scheduler is killed")
        cluster.scheduler.kill()
        errors = [run.exception(PATIENCE) for run in runs]
        ended = [str(error) for error in errors if error is not None]  # a run may be complete before the kill
        assert ended and all("error[E723 no-cluster]" in error for error in ended)
        kept = tell("the runs have ended, with E723")
        assert min(kept) < count
        before = results(there)
        cluster.kill()
        cluster.start()
        tell("another cluster is started, and both go on")
        for run in begin(folder, there, count, Running(cluster=cluster.address)):
            run.result(PATIENCE)
        tell("both are complete")
    finally:
        cluster.kill()
    after = results(there)
    for rows, earlier in zip(after, before, strict=True):
        assert set(earlier) <= set(rows)
    for run in begin(folder, here, count, Running(1)):
        run.result(PATIENCE)
    assert after == results(here)
    assert written(there) == written(here)
    say(f"{time.monotonic() - start:4.0f} s  run on this machine alone: all results are equal, byte for byte")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        killed(Path(scratch), int(([*sys.argv[1:], "2000"])[0]), print)
