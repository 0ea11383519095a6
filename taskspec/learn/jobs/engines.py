"""Engines that do calls: processes of this machine, by loky, and Dask clusters."""

from __future__ import annotations

import logging
import multiprocessing
import os
import re
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from queue import LifoQueue
from typing import Any, NamedTuple

from loky import ProcessPoolExecutor, cpu_count

from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.extras import need
from taskspec.learn.jobs.work import GRACE, Ending, begin, late, pack, perform

AHEAD = 8
"""Calls handed out for each that can be done at a time, so that nobody waits for the next one."""
HEARTBEAT = 0.5
"""Seconds after which somebody who waits for calls hears Ctrl-C."""
IDLE = 60.0
"""Seconds after which a process that has nothing to do ends."""
SHARED = {
    "PJRT_NPROC": "1", "OMP_NUM_THREADS": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false", "LOKY_MAX_MEMORY_LEAK_SIZE": "1e15",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0", "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}  # fmt: skip
"""The environment of a process, unless it says otherwise: one thread for JAX and for what uses OpenMP, such as PyTorch, and only
as much of an accelerator as it needs. loky starts no new process because a call took much memory. JAX keeps all that it compiles,
in a folder that processes share, so that a module that is run again is not compiled again.

There may be a process for each processor: with two threads JAX was seen to wait for ever, and PyTorch trained twenty times more
slowly; JAX takes three quarters of the memory by default.
"""
_EXIT_CODES = re.compile(r"exit codes of the workers are \{(.*)\}")


_LAST = 50_000
"""Bytes of what a call printed that are kept."""


@dataclass(eq=False)
class _Call:
    """A packed call that waits for a process, the time that it may take, and the group of its job."""

    packed: bytes
    seconds: float | None
    limits_itself: bool
    group: str
    ending: Future[Ending] = field(default_factory=Future)


class _Worker:
    """A process that does calls, one at a time; one that dies, or hangs, is replaced by another."""

    def __init__(self, folder: Path, number: int) -> None:
        self.folder = folder
        self.output = folder / f"printed-{number}"
        self.groups: list[str] = []
        self._executor = self._new_executor()

    def attempt(self, call: _Call) -> Ending:
        """Do a call (see `perform`); if its process dies, the status is `died`."""
        start = time.perf_counter()
        try:
            done: Ending = self._executor.submit(perform, call.packed, call.seconds, call.limits_itself).result()
            return done._replace(printed=self._printed())
        except BrokenExecutor as error:
            codes = _EXIT_CODES.search(str(error))
            reason = codes[1] if codes else "UNKNOWN"
        took = time.perf_counter() - start
        if call.seconds is not None and took >= call.seconds + GRACE and reason == "EXIT(1)":
            ending = Ending("timed_out", message=f"{late(call.seconds)} and could not be interrupted")
        else:
            ending = Ending("died", message=f"its process died: {reason}")
        self.end()
        self._executor = self._new_executor()
        return ending._replace(seconds=took, printed=self._printed())

    def wait(self) -> None:
        """Wait until its process is there."""
        with suppress(BrokenExecutor):  # which the next call reports
            self._executor.submit(os.getpid).result()

    def _printed(self) -> str:
        if not self.output.exists():
            return ""
        with self.output.open("r+b") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - _LAST))
            content = file.read()
            file.truncate(0)
        return content.decode(errors="replace")

    def _new_executor(self) -> ProcessPoolExecutor:
        compiled = {"JAX_COMPILATION_CACHE_DIR": str(self.folder / "compiled")}
        environment = {**SHARED, **compiled, **os.environ}
        arguments = (os.getpid(), self.output)
        return ProcessPoolExecutor(1, timeout=IDLE, env=environment, initializer=begin, initargs=arguments)

    def end(self) -> None:
        """End the process, in the middle of a call if need be."""
        self._executor.shutdown(kill_workers=True)


class Workers:
    """Processes of this machine that do many rounds of calls, as a context; a call that hangs or crashes costs itself alone.

    A process goes on with calls of the group that it did last, as long as there are some: it remembers what they share.
    """

    def __init__(self, count: int | None = None) -> None:
        self.count = count or cpu_count()
        self._scratch = tempfile.TemporaryDirectory(prefix="taskspec-", ignore_cleanup_errors=True)
        self._threads = ThreadPoolExecutor(self.count)
        self._workers: list[_Worker] = []
        self._free: LifoQueue[_Worker] = LifoQueue()
        self._waiting: list[_Call] = []
        self._unfinished = 0
        self._choosing = threading.Lock()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.end()
        self._threads.shutdown()
        self._scratch.cleanup()

    def submit(
        self, call: bytes, seconds: float | None, limits_itself: bool = False, group: str = ""
    ) -> Future[Ending]:
        """Do a packed call as soon as a process is free; arguments are those of a `Job`."""
        waiting = _Call(call, seconds, limits_itself, group)
        with self._choosing:
            self._waiting.append(waiting)
            self._unfinished += 1
            if len(self._workers) < min(self.count, self._unfinished):
                worker = _Worker(Path(self._scratch.name), len(self._workers))
                self._workers.append(worker)
                self._free.put(worker)
        self._threads.submit(self._attempt_one)
        return waiting.ending

    def _attempt_one(self) -> None:
        worker = self._free.get()
        worker.wait()  # its time limit begins with the call, and more calls to choose from have come
        call = self._choose(worker)
        try:
            call.ending.set_result(self._attempted(worker, call))
        except BaseException as error:
            call.ending.set_exception(error)

    def _attempted(self, worker: _Worker, call: _Call) -> Ending:
        try:
            return worker.attempt(call)
        finally:
            with self._choosing:
                self._unfinished -= 1
            self._free.put(worker)

    def _choose(self, worker: _Worker) -> _Call:
        """Take the next call for a process: of its last group, of one that it did earlier, of one that no process did."""
        with self._choosing:
            done = set().union(*(each.groups for each in self._workers))

            def rank(call: _Call) -> int:
                if call.group in worker.groups[-1:]:
                    return 0
                if call.group in worker.groups:
                    return 1
                return 2 + (call.group in done)

            call = min(self._waiting, key=rank)
            self._waiting.remove(call)
            if call.group in worker.groups:
                worker.groups.remove(call.group)
            worker.groups.append(call.group)
            return call

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

    def submit(
        self, call: bytes, seconds: float | None, limits_itself: bool = False, group: str = ""
    ) -> Future[Ending]:
        """Do a packed call as soon as a worker is free."""
        return self.executor.submit(attempt, call, seconds, limits_itself, group)

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
    return spec_error("E723", message, hint)


@cache
def _workers_here() -> Workers:
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # as a daemon, it may start none
    return Workers()


def attempt(call: bytes, seconds: float | None, limits_itself: bool, group: str) -> Ending:
    """Do a call on a worker of a cluster, in a process of its own."""
    return _workers_here().submit(call, seconds, limits_itself, group).result()
