"""Engines that do calls: processes of this machine, by loky, and Dask clusters."""

from __future__ import annotations

import logging
import multiprocessing
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from queue import LifoQueue
from typing import Any, NamedTuple

from loky import ProcessPoolExecutor, cpu_count

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.base.jobs.work import Ending, begin, late, pack, perform

AHEAD = 2
"""Calls handed out for each that can be done at a time, so that nobody waits for the next one."""
GRACE = 1.0
"""Seconds after its limit in which a call may still stop by itself."""
HEARTBEAT = 0.5
"""Seconds after which somebody who waits for calls hears Ctrl-C."""
IDLE = 60.0
"""Seconds after which a process that has nothing to do ends."""
SHARED = {
    "PJRT_NPROC": "1", "OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false", "LOKY_MAX_MEMORY_LEAK_SIZE": "1e15",
}  # fmt: skip
"""The environment of a process, unless it says otherwise: one thread for JAX and for what uses OpenMP, such as PyTorch, and only
as much of an accelerator as it needs. loky starts no new process because a call took much memory.

There may be a process for each processor: with two threads JAX was seen to wait for ever, and PyTorch trained twenty times more
slowly; JAX takes three quarters of the memory by default.
"""
_EXIT_CODES = re.compile(r"exit codes of the workers are \{(.*)\}")


class _Worker:
    """A process that does calls, one at a time; one that dies, or hangs, is replaced by another."""

    def __init__(self) -> None:
        self._executor = _executor()

    def attempt(self, call: bytes, seconds: float | None) -> Ending:
        """Do a call (see `perform`); if its process dies, the status is `died`."""
        if seconds is None:
            limit = None
        else:
            limit = seconds + GRACE
        start = time.perf_counter()
        try:
            self._executor.submit(os.getpid).result()  # its process is there, and the time limit begins
            start = time.perf_counter()
            future: Future[Ending] = self._executor.submit(perform, call, seconds)
            return future.result(limit)
        except TimeoutError:
            ending = Ending("timed_out", message=f"{late(seconds)} and could not be interrupted")
        except BrokenExecutor as error:
            codes = _EXIT_CODES.search(str(error))
            reason = codes[1] if codes else "UNKNOWN"
            ending = Ending("died", message=f"its process died: {reason}")
        self.end()
        self._executor = _executor()
        return ending._replace(seconds=time.perf_counter() - start)

    def end(self) -> None:
        """End the process, in the middle of a call if need be."""
        self._executor.shutdown(kill_workers=True)


def _executor() -> ProcessPoolExecutor:
    environment = {**SHARED, **os.environ}
    return ProcessPoolExecutor(1, timeout=IDLE, env=environment, initializer=begin, initargs=(os.getpid(),))


class Workers:
    """Processes of this machine that do many rounds of calls, as a context; a call that hangs or crashes costs itself alone."""

    def __init__(self, count: int | None = None) -> None:
        self.count = count or cpu_count()
        self._threads = ThreadPoolExecutor(self.count)
        self._workers: list[_Worker] = []
        self._free: LifoQueue[_Worker] = LifoQueue()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.end()
        self._threads.shutdown()

    def submit(self, call: bytes, seconds: float | None) -> Future[Ending]:
        """Do a packed call as soon as a process is free."""
        if len(self._workers) < self.count:
            worker = _Worker()
            self._workers.append(worker)
            self._free.put(worker)
        return self._threads.submit(self._attempt, call, seconds)

    def _attempt(self, call: bytes, seconds: float | None) -> Ending:
        worker = self._free.get()
        try:
            return worker.attempt(call, seconds)
        finally:
            self._free.put(worker)

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


class Cluster(NamedTuple):
    """A cluster as a place where calls are done, as `Workers` are; some errors end the run."""

    address: str
    client: Any
    executor: Executor
    killed: Any

    def submit(self, call: bytes, seconds: float | None) -> Future[Ending]:
        """Do a packed call as soon as a worker is free."""
        return self.executor.submit(attempt, call, seconds)

    def capacity(self) -> int:
        """Return how many calls to hand out at a time."""
        try:
            threads = self.client.nthreads()
        except OSError as error:
            raise _no_cluster(f"the cluster at {self.address!r} does not answer any more: {error}") from error
        return AHEAD * max(1, sum(map(int, threads.values())))

    def ending(self, future: Future[Ending]) -> Ending:
        """Return how a call ended that is over."""
        try:
            return future.result()
        except self.killed as error:
            return Ending("died", message=f"{error.allowed_failures + 1} workers of the cluster died with it")
        except Exception as error:
            words = f"the cluster at {self.address!r} gave a job up: {type(error).__name__}: {error}"
            raise _no_cluster(words) from error


@contextmanager
def cluster(address: str) -> Iterator[Cluster]:
    """Yield the cluster of a Dask scheduler.

    Raises:
        SpecError: E705, distributed is not installed; E723, the cluster does not answer.
    """
    distributed = need("distributed", "cluster", "a Dask cluster")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise _no_cluster(f"the cluster at {address!r} does not answer: {error}") from error
    with _quiet(), client, client.get_executor(pure=False) as executor:
        try:
            yield Cluster(address, client, executor, distributed.KilledWorker)
        finally:
            executor.shutdown(wait=False)


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
def _workers_here() -> Workers:
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # as a daemon, it may start none
    return Workers()


def attempt(call: bytes, seconds: float | None) -> Ending:
    """Do a call on a worker of a cluster, in a process of its own."""
    return _workers_here().submit(call, seconds).result()
