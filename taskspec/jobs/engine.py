"""A run: every job that has no result yet is done, and what comes of it is kept as it comes."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from datetime import UTC, datetime

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.jobs.store import Ending, Job, JobResult, Status, Store
from taskspec.jobs.workers import Site, site

DEATHS = 2
"""Processes that a job may kill before it is left alone."""
PARCEL_SECONDS = 1.0
"""What the jobs of a parcel may take together, as far as is known."""
HEARTBEAT = 0.5
"""Seconds after which progress is told even if there is none."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How far a run is.

    Args:
        total: jobs in all.
        before: of them, those that had their result when the run began.
        done: those with a result, earlier ones included.
        failed: those that ended without one.
        seconds: since the run began.
    """

    total: int
    before: int
    done: int
    failed: int
    seconds: float

    @property
    def over(self) -> int:
        """Jobs that ended, one way or the other."""
        return self.done + self.failed

    @property
    def rate(self) -> float:
        """Jobs a second, in this run."""
        return (self.over - self.before) / self.seconds if self.seconds > 0 else 0.0

    @property
    def left(self) -> float | None:
        """Seconds that the rest takes at this rate; None while there is none."""
        return (self.total - self.over) / self.rate if self.rate else None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What is known after a run.

    Args:
        rows: by key, in the order of the jobs, earlier ones included.
        ran: how many of them are of this run.
        seconds: that the run took.
    """

    rows: dict[str, JobResult]
    ran: int
    seconds: float

    @property
    def not_done(self) -> tuple[JobResult, ...]:
        """The jobs that have no result, each with its message."""
        return tuple(row for row in self.rows.values() if row.status != "done")


class Interrupted(KeyboardInterrupt):
    """Somebody pressed Ctrl-C. What was done is kept; the message says how much that is."""


Listener = Callable[[Standing], None]


def run(
    jobs: Iterable[Job],
    store: Store,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    seconds: float | None = None,
    progress: Listener | None = None,
    retry_failed: bool = False,
) -> Outcome:
    """Do the jobs that have no result yet, in any order.

    A job that raises, takes too long or ends its process is recorded with a message, while the rest goes on. One whose process
    dies is begun once more, alone, after all others. Of jobs with the same key, one is done.

    Args:
        workers: processes on this machine; by default one for each processor.
        cluster: the address of a Dask scheduler, as in `"tcp://10.0.0.1:8786"`, whose workers do the jobs instead.
        seconds: that a job may take.
        progress: is told how far the run is, in the thread of the caller.
        retry_failed: whether jobs that ended without a result in earlier runs are begun anew.

    Raises:
        SpecError: E705, distributed is not installed; E713, workers or seconds that cannot be; E716, E722, E723.
        Interrupted: Ctrl-C.
    """
    start = time.monotonic()
    wanted = {job.key: job for job in jobs}
    with store.writing():
        known = store.results(wanted)
        again = {key: row for key, row in known.items() if retry_failed and row.status != "done"}
        todo = [job for key, job in wanted.items() if key not in known or key in again]
        statuses = Counter(row.status for key, row in known.items() if key not in again)
        this = _Run(store, seconds, progress or (lambda _: None), len(wanted), statuses)
        this.attempts.update({key: row.attempts for key, row in again.items()})
        if todo:
            with site(workers, cluster) as where:
                this.do(todo, where)
        this.tell()
    return Outcome(store.results(wanted), len(todo), time.monotonic() - start)


_Pending = dict[Future[list[Ending]], list[Job]]


@dataclass
class _Run:
    store: Store
    seconds: float | None
    progress: Listener
    total: int
    statuses: Counter[Status]
    attempts: Counter[str] = field(default_factory=Counter)
    deaths: Counter[str] = field(default_factory=Counter)
    suspects: list[Job] = field(default_factory=list)

    tried: int = 0
    spent: float = 0.0

    def __post_init__(self) -> None:
        if self.seconds is not None and not self.seconds > 0:
            raise SpecError([Diagnostic("E713", None, f"no job ends within {self.seconds:g} s", "give more than 0")])
        self.before = self.statuses.total()
        self.start = time.monotonic()

    def do(self, jobs: list[Job], where: Site) -> None:
        """All jobs, many at a time, and then those whose process died, one at a time."""
        self._many(jobs, where, where.capacity)
        while self.suspects:
            self._many([self.suspects.pop(0)], where, lambda: 1)

    def _many(self, jobs: list[Job], where: Site, capacity: Callable[[], int]) -> None:
        waiting = deque(jobs)
        pending = _Pending()
        try:
            self._fill(pending, waiting, where, capacity())
            while pending:
                self.tell()
                wait(pending, HEARTBEAT, FIRST_COMPLETED)
                self._harvest(pending, where)
                self._fill(pending, waiting, where, capacity())
        except KeyboardInterrupt:
            self._harvest(pending, where)
            raise Interrupted(self._kept()) from None

    def _fill(self, pending: _Pending, waiting: deque[Job], where: Site, capacity: int) -> None:
        while waiting and len(pending) < capacity:
            size = min(where.parcel, self._quick(), -(-len(waiting) // capacity))
            parcel = [waiting.popleft() for _ in range(size)]
            self.attempts.update(job.key for job in parcel)
            pending[where.submit([job.packed() for job in parcel], self.seconds)] = parcel

    def _quick(self) -> int:
        """Jobs that take no more than `PARCEL_SECONDS` together, as far as is known."""
        return max(1, int(PARCEL_SECONDS * self.tried / self.spent)) if self.spent else 1

    def _harvest(self, pending: _Pending, where: Site) -> None:
        """Record what has ended, in one transaction, and only then forget about it."""
        over = [future for future in pending if future.done()]
        rows = []
        died = []
        for future in over:
            parcel = pending[future]
            for job, ending in zip(parcel, where.endings(future, len(parcel)), strict=True):
                self.deaths[job.key] += ending.status == "died"
                if ending.status == "died" and self.deaths[job.key] < DEATHS:
                    died.append(job)
                else:
                    rows.append(self._row(job, ending))
        self.store.record(rows)
        self.statuses.update(row.status for row in rows)
        self.tried, self.spent = self.tried + len(rows), self.spent + sum(row.seconds for row in rows)
        self.suspects += died
        for future in over:
            del pending[future]

    def _row(self, job: Job, ending: Ending) -> JobResult:
        status: Status = "quarantined" if ending.status == "died" else ending.status
        message = f"{ending.message} ({self.deaths[job.key]} times)" if ending.status == "died" else ending.message
        when = datetime.now(UTC).isoformat(timespec="seconds")
        tried = self.attempts[job.key]
        return JobResult(
            job.key, job.name, status, ending.result, message, ending.seconds, tried, when, ending.versions
        )

    def tell(self) -> None:
        done = self.statuses["done"]
        failed = self.statuses.total() - done
        seconds = time.monotonic() - self.start
        self.progress(Standing(self.total, self.before, done, failed, seconds))

    def _kept(self) -> str:
        over = self.statuses.total()
        kept = f"{over} of {self.total} jobs are over and kept in {str(self.store.path)!r}"
        return f"interrupted: {kept}; the same run goes on from there"
