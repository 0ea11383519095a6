"""Where jobs are done: processes of this machine that may die, or a Dask cluster."""

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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from queue import Empty, Queue
from threading import Lock, Thread
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.jobs.store import Ending
from taskspec.jobs.work import GRACE, IDLE, late

# Processes that do calls for us, one at a time each: one that dies takes nothing with it but the call that killed it.

LOOK = 0.5
"""Seconds between looks at whether a process is still there that does not answer."""
ONE_THREAD = {"PJRT_NPROC": "1"}
"""The environment of a process, unless it says otherwise: one thread for JAX.

There may be a process for each processor, and with two threads JAX was seen to wait for ever.
"""
START = """
import os, pickle, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
questions = os.fdopen(os.dup(0), "rb")
sys.path[:] = pickle.load(questions)
from taskspec.jobs.work import serve
serve(questions)
"""
"""What a process runs: Ctrl-C is not its business, and it finds modules where this process does."""
_FRAME = re.compile(r'File "(.*)", line (\d+) in (.*)')


def processors() -> int:
    """Return how many processors this process may use: those of its affinity, or fewer where a container has fewer."""
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        granted = -(-int(quota) // int(period))
    except (OSError, ValueError):  # there is no container, or no limit ("max")
        return affinity
    return max(1, min(affinity, granted))


class Crew:
    """Processes, made as they are needed: as many as there are threads that ask for something to be done."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._has_ended = False
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()

    def attempt(self, calls: Sequence[bytes], seconds: float | None) -> list[Ending]:
        """Do calls in a process, and wait for them (see `perform`). One whose process died has the status `died`."""
        return [self._one(call, seconds) for call in calls]

    def _one(self, call: bytes, seconds: float | None) -> Ending:
        with self._lock:
            if self._has_ended:
                raise RuntimeError("the run has ended")
            process = self._ready()
            self._busy.add(process)
        ending, is_alive = process.attempt(call, seconds)
        with self._lock:
            self._busy.discard(process)
            if is_alive:
                self._idle.append(process)
        return ending

    def _ready(self) -> _Process:
        """Return a process that waits for a call. Those that may soon end for want of one are not relied on."""
        while self._idle:
            process = self._idle.pop()
            if time.monotonic() < process.rested + IDLE / 2:
                return process
            process.end()
        return _Process()

    def end(self) -> None:
        """End all processes, whatever they are at."""
        with self._lock:
            self._has_ended = True
            everyone = [*self._idle, *self._busy]
        for process in everyone:
            process.end()


class _Process:
    """A process that does calls; `rested` is when the last one ended."""

    def __init__(self) -> None:
        handle, name = tempfile.mkstemp(prefix="taskspec-")
        os.close(handle)
        self._trace = Path(name)
        self._answers: Queue[Ending | None] = Queue()
        self._process = subprocess.Popen(
            [sys.executable, "-c", START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**ONE_THREAD, **os.environ},
        )
        self._send(sys.path)
        self.rested = time.monotonic()
        Thread(target=self._listen, daemon=True).start()

    def attempt(self, call: bytes, seconds: float | None) -> tuple[Ending, bool]:
        """Return how a call ended, and whether the process is still there."""
        start = time.perf_counter()
        self._send((call, seconds, self._trace))
        ending = self._answer()
        self.rested = time.monotonic()
        if ending is not None:
            return ending, True
        ending = self._death(seconds)
        self.end()
        return ending._replace(seconds=time.perf_counter() - start), False

    def _send(self, content: Any) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # a process that is gone gives no answer
            pickle.dump(content, self._process.stdin)
            self._process.stdin.flush()

    def _listen(self) -> None:
        """Put answers where they are waited for, and None when there will be no more."""
        assert self._process.stdout is not None
        with self._process.stdout as answers, suppress(Exception):
            while True:
                self._answers.put(pickle.load(answers))
        self._answers.put(None)

    def _answer(self) -> Ending | None:
        """Return how the call ended, or None: the process died. Its own children may hold its end of the pipe open."""
        while True:
            has_died = self._process.poll() is not None
            with suppress(Empty):
                return self._answers.get(timeout=LOOK)
            if has_died:
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
        name = signals.get(-code, "EXIT")
        return Ending("died", message=f"its process died: {name}({code})")

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._process.kill()
        self._process.wait()
        with suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        with suppress(OSError):
            self._trace.unlink(missing_ok=True)


# Where calls are done: on this machine, or by a Dask cluster. Either is an executor of `concurrent.futures`.
#
# distributed is imported here.

AHEAD = 2
"""Parcels handed out for each that can be done at a time, so that nobody waits for the next one."""
PARCEL = 20
"""Calls that go to a cluster together, at most: the way there takes longer than many a call."""
CLUSTER_LOOK = 10
"""Seconds between looks at how many workers a cluster has."""
PATIENCE = 20
"""Seconds in which a cluster has to answer."""


class Site(NamedTuple):
    """Somewhere that calls are done.

    Args:
        attempt: does a parcel of calls, there (see `Crew.attempt`).
        parcel: calls that it may hold.
        capacity: how many parcels to hand out at a time.
        explain: what an error that no call raised means for each of them; some mean the end of the run.
    """

    executor: Executor
    attempt: Callable[[Sequence[bytes], float | None], list[Ending]]
    parcel: int
    capacity: Callable[[], int]
    explain: Callable[[Exception], Ending]

    def submit(self, calls: Sequence[bytes], seconds: float | None) -> Future[list[Ending]]:
        """Hand out a parcel of calls."""
        return self.executor.submit(self.attempt, calls, seconds)

    def endings(self, future: Future[list[Ending]], count: int) -> list[Ending]:
        """Return how the calls of a parcel ended that is over."""
        try:
            return future.result()
        except Exception as error:
            return [self.explain(error)] * count


@contextmanager
def site(workers: int | None, cluster: str | None) -> Iterator[Site]:
    """The cluster with an address, or this machine. What is not done when the block ends is given up.

    Raises:
        SpecError: E705, distributed is not installed; E713, workers that cannot be; E723, the cluster does not answer.
    """
    if workers is not None and cluster is not None:
        raise _refuse("a cluster has as many workers as it has", "leave the number of workers out")
    if workers is not None and workers < 1:
        raise _refuse(f"{workers} workers can do nothing", "give 1 or more")
    with _here(workers) if cluster is None else _cluster(cluster) as found:
        yield found


def _refuse(message: str, hint: str) -> SpecError:
    return SpecError([Diagnostic("E713", None, message, hint)])


@contextmanager
def _here(workers: int | None) -> Iterator[Site]:
    crew = Crew()
    count = workers or processors()
    executor = ThreadPoolExecutor(count)
    try:
        yield Site(executor, crew.attempt, 1, lambda: count * AHEAD, _raised)
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        crew.end()
        executor.shutdown()


def _raised(error: Exception) -> Ending:
    raise error


@contextmanager
def _cluster(address: str) -> Iterator[Site]:
    """Each worker of the cluster has processes of its own that do the calls, so that it outlives them."""
    distributed = need("distributed", "cluster", "a Dask cluster")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _no_cluster(f"the cluster at {address!r} does not answer: {error}") from error

    def explain(error: Exception) -> Ending:
        if isinstance(error, distributed.KilledWorker):
            return Ending("died", message=f"{error.allowed_failures + 1} workers of the cluster died with it")
        raise _no_cluster(f"the cluster at {address!r} gave a job up: {type(error).__name__}: {error}") from error

    @lru_cache(maxsize=1)
    def threads(_: int) -> int:
        return max(1, sum(map(int, client.nthreads().values())))

    with _quiet(), client, client.get_executor(pure=False) as executor:
        try:
            yield Site(
                executor, attempt, PARCEL, lambda: AHEAD * threads(int(time.monotonic() / CLUSTER_LOOK)), explain
            )
        finally:
            executor.shutdown(wait=False)


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask prints a traceback for each call under way when a run is interrupted or its cluster lost; we say that ourselves."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
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


def attempt(calls: Sequence[bytes], seconds: float | None) -> list[Ending]:
    """Do calls on a worker of a cluster, in a process of its crew."""
    return _crew().attempt(calls, seconds)


@cache
def _crew() -> Crew:
    return Crew()
