"""Processes that do calls for us, one at a time each: one that dies takes nothing with it but the call that killed it."""

from __future__ import annotations

import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from threading import Lock, Thread
from typing import Any

from taskspec.runs.job import Ending
from taskspec.runs.work import GRACE, IDLE, late

LOOK = 0.5
"""Seconds between looks at whether a process is still there that does not answer."""
START = """
import os, pickle, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
questions = os.fdopen(os.dup(0), "rb")
sys.path[:] = pickle.load(questions)
from taskspec.runs.work import serve
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
        self._process = subprocess.Popen([sys.executable, "-c", START], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
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
