"""The work of a process that does calls for another one, one at a time, each within its time limit."""

from __future__ import annotations

import faulthandler
import importlib
import json
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from typing import Any, BinaryIO, Literal, NamedTuple

from taskspec.base.diagnostics import TaskspecError

IDLE = 60.0
"""Seconds after which a process that has nothing to do ends."""
GRACE = 1.0
"""Seconds after its limit in which a call may still stop by itself."""


class Ending(NamedTuple):
    """The end of a call, as its process reports it; the process that waited for it reports those that `died`."""

    status: Literal["done", "failed", "timed_out", "quarantined", "died"]
    result: str | None = None
    message: str | None = None
    seconds: float = 0.0


class Late(BaseException):
    """The time is up. Not an `Exception`, so that a call which catches those stops as well."""


def pack(function: Callable[..., Any] | str, arguments: tuple[Any, ...]) -> bytes:
    """Return a call as bytes; for one that cannot be pickled, a call that fails for that reason."""
    try:
        return pickle.dumps((function, arguments))
    except Exception as error:
        return pickle.dumps((_unpicklable, (str(error),)))


def _unpicklable(reason: str) -> None:
    raise TypeError(f"the call cannot be pickled: {reason}")


def serve(questions: BinaryIO) -> None:
    """Do the calls that another process sends, and answer on standard output, until there are none for a while.

    What calls print goes to standard error. This process ends when the other is gone, even in the middle of a call.
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
    """Call a function, and return how that ended.

    Args:
        call: see `pack`.
        seconds: that it may take. After them it is interrupted; if that does not help, its process is ended.
        trace: a file that gets the traceback in the second case.
    """
    start = time.perf_counter()
    try:
        with _killed(seconds, trace), interrupted(seconds), _alone():
            function, arguments = pickle.loads(call)
            if isinstance(function, str):
                module, _, name = function.partition(":")
                function = getattr(importlib.import_module(module), name)
            ending = Ending("done", _json(function(*arguments)))
    except Late as error:
        ending = Ending("timed_out", message=f"{late(seconds)}: {_place(error)}")
    except TaskspecError as error:
        ending = Ending("failed", message=str(error))
    except BaseException as error:
        words = "".join(traceback.format_exception_only(error)).strip()
        ending = Ending("failed", message=f"{words}\n  at {_place(error)}")
    return ending._replace(seconds=time.perf_counter() - start)


def late(seconds: float | None) -> str:
    """Return the message of a call that took too long."""
    return f"it took longer than {seconds:g} s"


def _json(value: Any) -> str:
    try:
        return json.dumps(value)
    except (TypeError, ValueError) as error:
        raise TypeError(f"the result is not JSON data: {error}") from None


@contextmanager
def interrupted(seconds: float | None) -> Iterator[None]:
    """Interrupt a block after some time: by a signal, between two steps of Python."""
    is_main = threading.current_thread() is threading.main_thread()
    if seconds is None or not is_main or not hasattr(signal, "setitimer"):
        yield
        return
    signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _ring(*_: Any) -> None:
    raise Late


@contextmanager
def _alone() -> Iterator[None]:
    """End copies of this process that a call made by `os.fork`, so that one process answers."""
    us = os.getpid()
    try:
        yield
    finally:
        if os.getpid() != us:
            os._exit(0)


@contextmanager
def _killed(seconds: float | None, trace: Path) -> Iterator[None]:
    """End the process if a block takes too long even so, by a thread that needs no lock of Python's."""
    if seconds is None:
        yield
        return
    with trace.open("wb") as file:
        faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def _place(error: BaseException) -> str:
    """Return the innermost line that an error passed, without those of the clock and of `import`."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.name != _ring.__name__ and not f.filename.startswith("<frozen ")]
    return f"{own[-1].filename}:{own[-1].lineno}, in {own[-1].name}"
