"""A run: every job that has no result yet is done, in processes of this machine or on a Dask cluster."""

from __future__ import annotations

import itertools
import sys
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from taskspec.base.diagnostics import spec_error
from taskspec.base.files import append_text
from taskspec.base.limits import tell
from taskspec.learn.jobs.engines import AHEAD, HEARTBEAT, Cluster, Workers, cluster
from taskspec.learn.jobs.store import Job, JobResult, Status, Store
from taskspec.learn.jobs.work import Ending, pack

DEATHS = 2
"""Processes that a job may kill before it is left alone."""
WAITING = 2000
"""Jobs that are at hand at a time, to choose from."""


@dataclass(frozen=True, slots=True)
class Running:
    """Settings of a run of jobs.

    Args:
        workers: processes on this machine; by default one for each processor.
        cluster: the address of a Dask scheduler, as in `"tcp://10.0.0.1:8786"`, whose workers do the jobs instead.
        seconds: that a job may take.
        retry: whether jobs that ended without a result in earlier runs are begun again.

    Raises:
        SpecError: E713, workers or seconds that cannot be.
    """

    workers: int | None = None
    cluster: str | None = None
    seconds: float | None = None
    retry: bool = False

    def __post_init__(self) -> None:
        if self.workers is not None and self.cluster is not None:
            raise spec_error("E713", "a cluster has as many workers as it has", "leave the number of workers out")
        if self.workers is not None and self.workers < 1:
            raise spec_error("E713", f"{self.workers} workers can do nothing", "give 1 or more")
        if self.seconds is not None and not self.seconds > 0:
            raise spec_error("E713", f"no job ends within {self.seconds:g} s", "give more than 0")


def _engine(running: Running, workers: Workers | None) -> AbstractContextManager[Workers | Cluster]:
    if workers is not None:
        return nullcontext(workers)
    if running.cluster is not None:
        return cluster(running.cluster)
    return Workers(running.workers)


class Interrupted(KeyboardInterrupt):
    """Somebody pressed Ctrl-C. What was done is kept; the message says how much that is."""


DEFAULT = Running()


def run(
    jobs: Iterable[Job], store: Store, running: Running = DEFAULT, name: str = "jobs", workers: Workers | None = None,
    printed: Path | None = None,
) -> dict[str, JobResult]:  # fmt: skip
    """Do the jobs that have no result yet, in any order, and report how many are over (see `base.limits.tell`).

    A job that raises, takes too long or ends its process is recorded with a message, while the rest goes on. One whose process
    dies is begun once more, alone, after all others. Jobs with the same key are done once.

    Args:
        name: what the progress is of.
        workers: processes that go on after this run; those that `running` says unless given.
        printed: a file to which the last of what each job printed is appended; standard error unless given.

    Returns:
        Results by key, in the order of the jobs, earlier ones included.

    Raises:
        SpecError: E705, distributed is not installed; E716, E722, E723.
        Interrupted: Ctrl-C.
    """
    wanted = {job.key: job for job in jobs}
    run_many(wanted.values(), len(wanted), store, running, name, workers, printed)
    return store.results(wanted)


def run_many(
    jobs: Iterable[Job], total: int, store: Store, running: Running = DEFAULT, name: str = "jobs",
    workers: Workers | None = None, printed: Path | None = None,
) -> None:  # fmt: skip
    """Do as `run` does with more jobs than the memory holds: they are taken when they are needed, and results stay in the store.

    Args:
        total: the number of jobs.
    """
    with store.writing():
        this = _Run(store, running, name, total, printed)
        todo = this.without_result(jobs)
        first = next(todo, None)
        this.report()
        if first is not None:
            with _engine(running, workers) as engine:
                this.do(itertools.chain([first], todo), engine)
                while this.suspects:
                    this.do(iter([this.suspects.pop(0)]), engine)


@dataclass
class _Run:
    store: Store
    running: Running
    name: str
    total: int
    printed: Path | None
    statuses: Counter[Status] = field(default_factory=Counter)
    attempts: dict[str, int] = field(default_factory=dict)
    deaths: Counter[str] = field(default_factory=Counter)
    suspects: list[Job] = field(default_factory=list)

    def without_result(self, jobs: Iterable[Job]) -> Iterator[Job]:
        """Yield the jobs that are to be done, and count the others."""
        jobs = iter(jobs)
        while some := list(itertools.islice(jobs, WAITING)):
            known = self.store.results(job.key for job in some)
            for job in some:
                row = known.get(job.key)
                if job.key in self.attempts:
                    self.total -= 1
                elif row is None:
                    self.attempts[job.key] = 0
                    yield job
                elif row.status != "done" and self.running.retry:
                    self.attempts[job.key] = row.attempts
                    yield job
                else:
                    self.statuses[row.status] += 1

    def do(self, jobs: Iterator[Job], engine: Workers | Cluster) -> None:
        """Do jobs, many at a time."""
        waiting: dict[str, deque[Job]] = {}
        pending: dict[Future[Ending], Job] = {}
        try:
            while True:
                for job in itertools.islice(jobs, WAITING - sum(map(len, waiting.values()))):
                    waiting.setdefault(job.group, deque()).append(job)
                if not waiting and not pending:
                    break
                while waiting and len(pending) < engine.capacity():
                    job = _taken(waiting, Counter(each.group for each in pending.values()))
                    self.attempts[job.key] += 1
                    call = pack(job.function, job.arguments)
                    pending[engine.submit(call, self.running.seconds, job.limits_itself, job.group)] = job
                wait(pending, HEARTBEAT, FIRST_COMPLETED)
                self._harvest(pending, engine)
        except KeyboardInterrupt:
            self._harvest(pending, engine)
            kept = f"{self.statuses.total()} of {self.total} jobs are over and kept in {str(self.store.path)!r}"
            raise Interrupted(f"interrupted: {kept}; the same run goes on from there") from None

    def _harvest(self, pending: dict[Future[Ending], Job], engine: Workers | Cluster) -> None:
        """Record what has ended, in one transaction, and only then forget about it."""
        over = [future for future in pending if future.done()]
        rows = []
        for future in over:
            job = pending[future]
            ending = engine.ending(future)
            self._keep(job, ending.printed)
            if ending.status == "died":
                self.deaths[job.key] += 1
                if self.deaths[job.key] < DEATHS:
                    self.suspects.append(job)
                    continue
                message = f"{ending.message} ({self.deaths[job.key]} times)"
                ending = ending._replace(status="quarantined", message=message)
            assert ending.status != "died"
            tried = self.attempts.pop(job.key)
            rows.append(
                JobResult(job.key, job.name, ending.status, ending.result, ending.message, ending.seconds, tried)
            )
        self.store.record(rows)
        self.statuses.update(row.status for row in rows)
        for future in over:
            del pending[future]
        self.report()

    def _keep(self, job: Job, text: str) -> None:
        if not text.strip():
            return
        block = f"-- {job.name}\n{text.rstrip()}\n"
        if self.printed is None:
            sys.stderr.write(block)
            return
        append_text(self.printed, block)

    def report(self) -> None:
        """Report how many jobs are over."""
        over = self.statuses.total()
        words = f"{self.name} {over}/{self.total}"
        if over > self.statuses["done"]:
            words += f", {over - self.statuses['done']} failed"
        tell(words, over / max(self.total, 1))


def _taken(waiting: dict[str, deque[Job]], handed_out: Counter[str]) -> Job:
    """Take the next job, from the first group with too few jobs at hand if there is one."""
    few = (group for group in waiting if handed_out[group] < AHEAD)
    group = next(few, next(iter(waiting)))
    job = waiting[group].popleft()
    if not waiting[group]:
        del waiting[group]
    return job
