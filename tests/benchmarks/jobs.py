"""The cost of a sweep beside its instances: seconds of a job that does nothing, and seconds and memory to plan many."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from taskspec.base.limits import also
from taskspec.cli.console import say
from taskspec.experiments import read
from taskspec.learn.experiments.instances import expand
from taskspec.learn.experiments.sweeping import jobs_of, wanted_of
from taskspec.learn.jobs.running import Running, run
from taskspec.learn.jobs.store import Job, Store
from tests.benchmarks.exact import memory

JOBS = 2000
INSTANCES = (2000, 20_000, 200_000)
EXPERIMENT = """
experiment: 1
name: many
tasks:
  - task: derail/Parabola
    parameters: {{h: {{range: [1, {end}]}}, A: {{range: [1, 21]}}}}
"""
MOST = 0.005
"""Seconds that a job which does nothing may take."""
WIDER = 1.25
"""How many times as much memory the most instances may take as the fewest."""


def overhead(jobs: int, workers: int = 2) -> float:
    """Return seconds of one of many jobs that do nothing, once the processes are there."""
    with tempfile.TemporaryDirectory() as folder, Store(Path(folder) / "store") as store:
        seconds = []
        for count in (workers, jobs + workers):
            wanted = [Job(f"{count} {i}", "nothing", "math:sqrt", (i,)) for i in range(count)]
            start = time.perf_counter()
            run(wanted, store, Running(workers))
            seconds.append(time.perf_counter() - start)
    return (seconds[1] - seconds[0]) / jobs


def planned(instances: int) -> tuple[int, float, int | None]:
    """Plan a sweep of a multiple of 20 instances; return how many jobs it has, the seconds, and the bytes of this process."""
    with tempfile.TemporaryDirectory() as folder, also(f"instances={instances}"):
        path = Path(folder) / "many.yaml"
        path.write_text(EXPERIMENT.format(end=instances // 20 + 1), encoding="utf-8")
        start = time.perf_counter()
        written = read(path)
        count = sum(1 for _ in jobs_of(expand(written).instances, wanted_of(written.experiment)))
        return count, time.perf_counter() - start, memory()


def bench(instances: tuple[int, ...] = INSTANCES, jobs: int = JOBS) -> bool:
    """Measure and print; return whether the targets are met."""
    each = overhead(jobs)
    say(f"a job that does nothing: {1000 * each:.1f} ms, of {jobs:,} in two processes")
    say("instances  planned s   MB")
    sizes = []
    for count in instances:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            number, seconds, size = pool.submit(planned, count).result()
        sizes.append(size or 0)
        say(f"{number:9,}{seconds:11.1f}{sizes[-1] / 1e6:5,.0f}")
    return each < MOST and sizes[-1] <= WIDER * sizes[0]
