"""A run: every job that has no result yet is done, in processes of this machine or on a Dask cluster."""

from __future__ import annotations

import logging
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from queue import Empty, Queue
from threading import Lock, Thread, local
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.base.jobs.store import Job, JobResult, Status, Store
from taskspec.base.jobs.work import GRACE, Ending, late, pack
from taskspec.base.limits import tell

DEATHS = 2
"""Processes that a job may kill before it is left alone."""
HEARTBEAT = 0.5
"""Seconds after which progress is reported even if no job has ended."""


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
            raise _invalid("a cluster has as many workers as it has", "leave the number of workers out")
        if self.workers is not None and self.workers < 1:
            raise _invalid(f"{self.workers} workers can do nothing", "give 1 or more")
        if self.seconds is not None and not self.seconds > 0:
            raise _invalid(f"no job ends within {self.seconds:g} s", "give more than 0")


class Interrupted(KeyboardInterrupt):
    """Somebody pressed Ctrl-C. What was done is kept; the message says how much that is."""


DEFAULT = Running()


def run(
    jobs: Iterable[Job], store: Store, running: Running = DEFAULT, name: str = "jobs", workers: Workers | None = None
) -> dict[str, JobResult]:
    """Do the jobs that have no result yet, in any order, and report how many are over (see `base.limits.tell`).

    A job that raises, takes too long or ends its process is recorded with a message, while the rest goes on. One whose process
    dies is begun once more, alone, after all others. Jobs with the same key are done once.

    Args:
        name: what the progress is of.
        workers: processes that go on after this run; those that `running` says unless given.

    Returns:
        Results by key, in the order of the jobs, earlier ones included.

    Raises:
        SpecError: E705, distributed is not installed; E716, E722, E723.
        Interrupted: Ctrl-C.
    """
    wanted = {job.key: job for job in jobs}
    with store.writing():
        known = store.results(wanted)
        again = {key: row.attempts for key, row in known.items() if running.retry and row.status != "done"}
        todo = [job for key, job in wanted.items() if key not in known or key in again]
        statuses = Counter(row.status for key, row in known.items() if key not in again)
        this = _Run(store, running.seconds, name, len(wanted), statuses, Counter(again))
        this.report()
        if todo:
            with _site(running, workers) as site:
                this.do(todo, site)
                while this.suspects:
                    this.do([this.suspects.pop(0)], site)
    return store.results(wanted)


def _invalid(message: str, hint: str) -> SpecError:
    return SpecError([Diagnostic("E713", None, message, hint)])


@dataclass
class _Run:
    store: Store
    seconds: float | None
    name: str
    total: int
    statuses: Counter[Status]
    attempts: Counter[str]
    deaths: Counter[str] = field(default_factory=Counter)
    suspects: list[Job] = field(default_factory=list)

    def do(self, jobs: list[Job], site: Workers | _Cluster) -> None:
        """Do jobs, many at a time."""
        waiting = deque(jobs)
        pending: dict[Future[Ending], Job] = {}
        try:
            while waiting or pending:
                for _ in range(min(site.capacity() - len(pending), len(waiting))):
                    job = waiting.popleft()
                    self.attempts[job.key] += 1
                    call = pack(job.function, job.arguments)
                    pending[site.submit(call, self.seconds)] = job
                wait(pending, HEARTBEAT, FIRST_COMPLETED)
                self._harvest(pending, site)
        except KeyboardInterrupt:
            self._harvest(pending, site)
            kept = f"{self.statuses.total()} of {self.total} jobs are over and kept in {str(self.store.path)!r}"
            raise Interrupted(f"interrupted: {kept}; the same run goes on from there") from None

    def _harvest(self, pending: dict[Future[Ending], Job], site: Workers | _Cluster) -> None:
        """Record what has ended, in one transaction, and only then forget about it."""
        over = [future for future in pending if future.done()]
        rows = []
        for future in over:
            job = pending[future]
            ending = site.ending(future)
            if ending.status == "died":
                self.deaths[job.key] += 1
                if self.deaths[job.key] < DEATHS:
                    self.suspects.append(job)
                    continue
                message = f"{ending.message} ({self.deaths[job.key]} times)"
                ending = ending._replace(status="quarantined", message=message)
            assert ending.status != "died"
            tried = self.attempts[job.key]
            rows.append(
                JobResult(job.key, job.name, ending.status, ending.result, ending.message, ending.seconds, tried)
            )
        self.store.record(rows)
        self.statuses.update(row.status for row in rows)
        for future in over:
            del pending[future]
        self.report()

    def report(self) -> None:
        """Report how many jobs are over."""
        over = self.statuses.total()
        words = f"{self.name} {over}/{self.total}"
        if over > self.statuses["done"]:
            words += f", {over - self.statuses['done']} failed"
        tell(words, over / max(self.total, 1))


# Processes that do calls for us, one at a time each: one that dies takes nothing with it but the call that killed it.

LOOK = 0.5
"""Seconds between looks at whether a process is still there that does not answer."""
SHARED = {"PJRT_NPROC": "1", "OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
"""The environment of a process, unless it says otherwise: one thread for JAX and for what uses OpenMP, such as PyTorch, and only
as much of an accelerator as it needs.

There may be a process for each processor: with two threads JAX was seen to wait for ever, and PyTorch trained twenty times more
slowly; JAX takes three quarters of the memory by default.
"""
START = """
import os, pickle, signal, sys
del sys.argv[0]  # what is left is the name of the program that this process works for
signal.signal(signal.SIGINT, signal.SIG_IGN)
questions = os.fdopen(os.dup(0), "rb")
sys.path[:] = pickle.load(questions)
from taskspec.base.jobs.work import serve
serve(questions)
"""
"""The program of a process: it ignores Ctrl-C, and finds modules where this process does."""
_FRAME = re.compile(r'File "(.*)", line (\d+) in (.*)')


class Crew:
    """Processes, made as they are needed: one for each thread that asks for something to be done."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._has_ended = False
        self._own = local()
        self._all: set[_Process] = set()

    def attempt(self, call: bytes, seconds: float | None) -> Ending:
        """Do a call in a process, and wait for it (see `perform`); if its process dies, the status is `died`."""
        process: _Process | None = getattr(self._own, "process", None)
        if process is None or not process.is_alive:
            process = self._renewed(process)
            self._own.process = process
        return process.attempt(call, seconds)

    def _renewed(self, dead: _Process | None) -> _Process:
        with self._lock:
            if self._has_ended:
                raise RuntimeError("the run has ended")
            if dead is not None:
                dead.end()
                self._all.remove(dead)
            process = _Process()
            self._all.add(process)
        return process

    def end(self) -> None:
        """End all processes, busy ones included."""
        with self._lock:
            self._has_ended = True
        for process in self._all:
            process.end()


class _Process:
    """A process that does calls."""

    def __init__(self) -> None:
        handle, name = tempfile.mkstemp(prefix="taskspec-")
        os.close(handle)
        self._trace = Path(name)
        self._answers: Queue[Ending | None] = Queue()
        environment = {**SHARED, **os.environ}
        pipe = subprocess.PIPE
        command = [sys.executable, "-c", START, *sys.argv[:1]]
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment)
        self._send(sys.path)
        Thread(target=self._listen, daemon=True).start()

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def attempt(self, call: bytes, seconds: float | None) -> Ending:
        """Do a call, and return how it ended."""
        start = time.perf_counter()
        self._send((call, seconds, self._trace))
        ending = self._answer()
        if ending is None:
            ending = self._death(seconds)._replace(seconds=time.perf_counter() - start)
            self.end()
        return ending

    def _send(self, content: Any) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # a process that is gone gives no answer
            pickle.dump(content, self._process.stdin)
            self._process.stdin.flush()

    def _listen(self) -> None:
        """Queue answers, and None when there will be no more."""
        assert self._process.stdout is not None
        with self._process.stdout as answers, suppress(Exception):
            while True:
                self._answers.put(pickle.load(answers))
        self._answers.put(None)

    def _answer(self) -> Ending | None:
        """Return how the call ended; None if the process died. Its own children may hold its end of the pipe open."""
        while True:
            was_alive = self.is_alive
            with suppress(Empty):
                return self._answers.get(timeout=LOOK)
            if not was_alive:
                return None

    def _death(self, seconds: float | None) -> Ending:
        trace = self._trace.read_text(encoding="utf-8", errors="replace")
        if trace:
            place = _FRAME.search(trace, trace.rindex("Thread 0x"))  # the main thread comes last
            words = f": {place[1]}:{place[2]}, in {place[3]}" if place else ""
            return Ending("timed_out", message=f"{late(seconds)} and could not be interrupted{words}")
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        code = self._process.returncode
        if code is None:
            return Ending("died", message="its process gave no answer")
        signals = {each.value: each.name for each in signal.Signals}
        return Ending("died", message=f"its process died: {signals.get(-code, 'EXIT')}({code})")

    def end(self) -> None:
        """End the process, in the middle of a call if need be."""
        self._process.kill()
        self._process.wait()
        with suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        with suppress(OSError):
            self._trace.unlink(missing_ok=True)


AHEAD = 2
"""Calls handed out for each that can be done at a time, so that nobody waits for the next one."""


def processors() -> int:
    """Return how many processors this process may use: those of its affinity, or fewer where a container has fewer."""
    if hasattr(os, "sched_getaffinity"):
        affinity = len(os.sched_getaffinity(0))
    else:
        affinity = os.cpu_count() or 1
    try:
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        granted = -(-int(quota) // int(period))
    except (OSError, ValueError):  # there is no container, or no limit ("max")
        return affinity
    return max(1, min(affinity, granted))


class Workers:
    """Processes of this machine that do many rounds of calls, as a context; a call that hangs or crashes costs itself alone."""

    def __init__(self, count: int | None = None) -> None:
        self.count = count or processors()
        self._crew = Crew()
        self._executor = ThreadPoolExecutor(self.count)

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._crew.end()
        self._executor.shutdown()

    def submit(self, call: bytes, seconds: float | None) -> Future[Ending]:
        """Do a packed call as soon as a process is free."""
        return self._executor.submit(self._crew.attempt, call, seconds)

    def capacity(self) -> int:
        """Return how many calls to hand out at a time."""
        return self.count * AHEAD

    def ending(self, future: Future[Ending]) -> Ending:
        """Return how a call ended that is over."""
        return future.result()

    def map(
        self, function: Callable[..., Any], calls: Iterable[tuple[Any, ...]], seconds: float | None
    ) -> list[Ending]:
        """Call a function with each of several tuples of arguments, and return how each call ended, in order.

        Args:
            seconds: that a call may take.
        """
        futures = [self.submit(pack(function, arguments), seconds) for arguments in calls]
        while wait(futures, HEARTBEAT).not_done:  # Ctrl-C is heard in between
            pass
        return [future.result() for future in futures]


# A Dask cluster: each of its workers has processes of its own that do the calls, so that it outlives them.

PATIENCE = 20
"""Seconds in which a cluster has to answer."""


@contextmanager
def _site(running: Running, workers: Workers | None) -> Iterator[Workers | _Cluster]:
    if workers is not None:
        yield workers
    elif running.cluster is not None:
        with _cluster(running.cluster) as cluster:
            yield cluster
    else:
        with Workers(running.workers) as own:
            yield own


@contextmanager
def _cluster(address: str) -> Iterator[_Cluster]:
    distributed = need("distributed", "cluster", "a Dask cluster")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _no_cluster(f"the cluster at {address!r} does not answer: {error}") from error
    with _quiet(), client, client.get_executor(pure=False) as executor:
        try:
            yield _Cluster(address, client, executor, distributed.KilledWorker)
        finally:
            executor.shutdown(wait=False)


class _Cluster(NamedTuple):
    """A cluster as a place where calls are done, as `Workers` are; some errors end the run."""

    address: str
    client: Any
    executor: Executor
    killed: Any

    def submit(self, call: bytes, seconds: float | None) -> Future[Ending]:
        return self.executor.submit(attempt, call, seconds)

    def capacity(self) -> int:
        try:
            threads = self.client.nthreads()
        except OSError as error:
            raise _no_cluster(f"the cluster at {self.address!r} does not answer any more: {error}") from error
        return AHEAD * max(1, sum(map(int, threads.values())))

    def ending(self, future: Future[Ending]) -> Ending:
        try:
            return future.result()
        except self.killed as error:
            return Ending("died", message=f"{error.allowed_failures + 1} workers of the cluster died with it")
        except Exception as error:
            words = f"the cluster at {self.address!r} gave a job up: {type(error).__name__}: {error}"
            raise _no_cluster(words) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Dask, which prints a traceback for each call under way when a run is interrupted or its cluster lost."""
    loggers = list(map(logging.getLogger, ("distributed", "distributed.client", "tornado.application")))
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _no_cluster(message: str) -> SpecError:
    hint = "check that its scheduler and workers run, with taskspec installed; finished results are kept"
    return SpecError([Diagnostic("E723", None, message, hint)])


@cache
def _crew() -> Crew:
    return Crew()


def attempt(call: bytes, seconds: float | None) -> Ending:
    """Do a call on a worker of a cluster, in a process of its crew."""
    return _crew().attempt(call, seconds)
