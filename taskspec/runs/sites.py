"""Where calls are done: on this machine, or by a Dask cluster. Either is an executor of `concurrent.futures`.

distributed is imported here.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, lru_cache
from typing import NamedTuple

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.extras import need
from taskspec.runs.crew import Crew, processors
from taskspec.runs.job import Ending

AHEAD = 2
"""Parcels handed out for each that can be done at a time, so that nobody waits for the next one."""
PARCEL = 20
"""Calls that go to a cluster together, at most: the way there takes longer than many a call."""
LOOK = 10
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
        """How the calls of a parcel ended that is over."""
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
            yield Site(executor, attempt, PARCEL, lambda: AHEAD * threads(int(time.monotonic() / LOOK)), explain)
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
