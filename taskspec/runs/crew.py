"""Processes that do calls for us, one at a time each: one that dies takes nothing with it but the call that killed it.

loky is imported here.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from pathlib import Path
from threading import Lock

from taskspec.extras import need
from taskspec.runs.job import Ending
from taskspec.runs.work import begin, late, perform

IDLE = 60.0
"""Seconds after which a process that has nothing to do ends."""
ONE_THREAD = {"PJRT_NPROC": "1"}
"""What a process finds in its environment unless that says otherwise: one thread for JAX.

There may be a process for each processor; and of JAX's threads, where there are two, all were seen to wait for each other.
"""
_EXIT_CODE = re.compile(r"exit codes of the workers are \{(.*?)\}")
_FRAME = re.compile(r'File "(.*)", line (\d+) in (.*)')


class Crew:
    """Processes, made as they are needed: as many as there are threads that ask for something to be done.

    Raises:
        SpecError: E705, when loky is not installed.
    """

    def __init__(self) -> None:
        need("loky", "sweep", "a run in parallel")
        self._lock, self._has_ended = Lock(), False
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()

    def attempt(self, calls: Sequence[bytes], seconds: float | None) -> list[Ending]:
        """Do calls in a process, and wait for them (see `perform`). One whose process died has the status `died`."""
        return [self._one(call, seconds) for call in calls]

    def _one(self, call: bytes, seconds: float | None) -> Ending:
        with self._lock:
            if self._has_ended:
                raise RuntimeError("the run has ended")
            process = self._idle.pop() if self._idle else _Process()
            self._busy.add(process)
        ending, is_alive = process.attempt(call, seconds)
        with self._lock:
            self._busy.discard(process)
            if is_alive:
                self._idle.append(process)
        return ending

    def end(self) -> None:
        """End all processes, whatever they are at."""
        with self._lock:
            self._has_ended = True
            everyone = [*self._idle, *self._busy]
        for process in everyone:
            process.end()


class _Process:
    def __init__(self) -> None:
        us = multiprocessing.current_process()
        if (
            us.daemon
        ):  # as a Dask worker is behind its nanny: such a process may have no children; ours end by themselves
            us.daemon = False
        loky = need("loky")
        environment = {name: os.environ.get(name, value) for name, value in ONE_THREAD.items()}
        self._executor = loky.ProcessPoolExecutor(
            1, timeout=IDLE, initializer=begin, initargs=(os.getpid(),), env=environment
        )
        handle, name = tempfile.mkstemp(prefix="taskspec-")
        os.close(handle)
        self._trace = Path(name)

    def attempt(self, call: bytes, seconds: float | None) -> tuple[Ending, bool]:
        """How a call ended, and whether the process is still there."""
        start = time.perf_counter()
        try:
            return self._executor.submit(perform, call, seconds, self._trace).result(), True
        except BrokenExecutor as error:
            ending = self._death(error, seconds)
            self.end()
            return ending._replace(seconds=time.perf_counter() - start), False

    def _death(self, error: BrokenExecutor, seconds: float | None) -> Ending:
        trace = self._trace.read_text(encoding="utf-8", errors="replace")
        if trace:
            place = _FRAME.search(trace, trace.rindex("Thread 0x"))  # the main thread comes last
            words = f": {place[1]}:{place[2]}, in {place[3]}" if place else ""
            return Ending("timed_out", message=f"{late(seconds)} and could not be interrupted{words}")
        code = _EXIT_CODE.search(str(error))
        return Ending("died", message="its process died" + (f": {code[1]}" if code else ""))

    def end(self) -> None:
        self._executor.shutdown(wait=True, kill_workers=True)
        with suppress(OSError):
            self._trace.unlink(missing_ok=True)
