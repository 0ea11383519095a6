"""What a process does that works for others: one call at a time, with an eye on the clock and on who waits for it."""

from __future__ import annotations

import faulthandler
import json
import os
import pickle
import platform
import signal
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from typing import Any, BinaryIO

from taskspec.base import __version__
from taskspec.base.diagnostics import TaskspecError
from taskspec.jobs.store import Ending, unpacked

IDLE = 60.0
"""Seconds after which a process that has nothing to do ends."""
GRACE = 1.0
"""Seconds after its limit in which a call may still stop by itself."""


class _Late(BaseException):
    """The time is up. Not an `Exception`, so that a call which catches those stops as well."""


def serve(questions: BinaryIO) -> None:
    """Do the calls that another process sends, and answer on standard output, until there are none for a while.

    What calls print goes to standard error. This process ends when the other is gone, whatever it is at.
    """
    answers = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    calls: Queue[tuple[bytes, float | None, Path]] = Queue()
    threading.Thread(target=_receive, args=(questions, calls), daemon=True).start()
    while True:
        try:
            call, seconds, trace = calls.get(timeout=IDLE)
        except Empty:
            return
        pickle.dump(perform(call, seconds, trace), answers)
        answers.flush()


def _receive(questions: BinaryIO, calls: Queue[tuple[bytes, float | None, Path]]) -> None:
    try:
        while True:
            calls.put(pickle.load(questions))
    except EOFError:
        os._exit(1)


def perform(call: bytes, seconds: float | None, trace: Path) -> Ending:
    """Call a function, and say how that ended.

    Args:
        call: as `Job.packed` gives it.
        seconds: that it may take. After them it is interrupted; if it does not heed that, its process is ended.
        trace: a file that is told, in the second case, what the process was at.
    """
    start = time.perf_counter()
    try:
        with _killed(seconds, trace), _interrupted(seconds), _alone():
            function, arguments = unpacked(call)
            ending = Ending("done", _json(function(*arguments)))
    except _Late as error:
        ending = Ending("timed_out", message=f"{late(seconds)}: {_place(error)}")
    except TaskspecError as error:
        ending = Ending("failed", message=str(error))
    except BaseException as error:
        words = "".join(traceback.format_exception_only(error)).strip()
        ending = Ending("failed", message=f"{words}\n  at {_place(error)}")
    return ending._replace(seconds=time.perf_counter() - start, versions=VERSIONS)


VERSIONS = {"python": platform.python_version(), "taskspec": __version__}


def late(seconds: float | None) -> str:
    """Return the message of a call that took too long."""
    return f"it took longer than {seconds:g} s"


def _json(value: Any) -> str:
    try:
        return json.dumps(value)
    except (TypeError, ValueError) as error:
        raise TypeError(f"the result is not JSON data: {error}") from None


@contextmanager
def _interrupted(seconds: float | None) -> Iterator[None]:
    """A block that is interrupted after some time: by a signal, which only a main thread gets, between two steps of Python."""
    if seconds is None or not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _ring(*_: Any) -> None:
    raise _Late


@contextmanager
def _alone() -> Iterator[None]:
    """A block that one process leaves: a copy of it that was made within (`os.fork`) ends there, and does not answer as well."""
    us = os.getpid()
    try:
        yield
    finally:
        if os.getpid() != us:
            os._exit(0)


@contextmanager
def _killed(seconds: float | None, trace: Path) -> Iterator[None]:
    """A block whose process is ended if it takes too long even so, by a thread that needs no lock of Python's."""
    if seconds is None:
        yield
        return
    handle = os.open(trace, os.O_WRONLY | os.O_TRUNC)  # made by whoever started the process, and thrown away by it
    faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=handle)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        os.close(handle)


def _place(error: BaseException) -> str:
    """Return the innermost line that an error passed, those of the clock and of `import` aside."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.name != _ring.__name__]
    own = [f for f in frames if not f.filename.startswith("<frozen ")]
    return f"{own[-1].filename}:{own[-1].lineno}, in {own[-1].name}"
