"""The work of a process that does calls for another one, one at a time, each within its time limit."""

from __future__ import annotations

import faulthandler
import importlib
import json
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Literal, NamedTuple

from taskspec.base.diagnostics import TaskspecError

LOOK = 0.5
"""Seconds between looks at whether the other process is still there."""
GRACE = 1.0
"""Seconds after its limit in which a call may still stop by itself; then its process ends, with the code 1."""
_limit: ContextVar[float | None] = ContextVar("limit", default=None)
"""Seconds that the call may take, or a part of it that limits itself."""


class Ending(NamedTuple):
    """The end of a call, as its process reports it; the process that waited for it reports those that `died`.

    `printed` is the last part of what the call printed.
    """

    status: Literal["done", "failed", "timed_out", "quarantined", "died"]
    result: str | None = None
    message: str | None = None
    seconds: float = 0.0
    printed: str = ""


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


def begin(parent: int, output: Path) -> None:
    """Prepare a process for calls: it ignores Ctrl-C, reads nothing, and prints to a file.

    Args:
        parent: the process that it works for, with which it ends, even in the middle of a call.
        output: the file, which is appended to.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    printed = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(printed, 1)
    os.dup2(printed, 2)
    os.close(printed)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)


def perform(call: bytes, seconds: float | None, limits_itself: bool = False) -> Ending:
    """Call a function, and return how that ended.

    Args:
        call: see `pack`.
        seconds: that it may take; after them it is interrupted.
        limits_itself: whether the function applies the limit to a part of its work, by `within_limit`.
    """
    start = time.perf_counter()
    token = _limit.set(seconds)
    whole = None if limits_itself else seconds
    try:
        with _limited(whole), _alone():
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
    finally:
        _limit.reset(token)
        sys.stdout.flush()
        sys.stderr.flush()
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
def within_limit() -> Iterator[None]:
    """Apply the time limit of a call to a block alone, for a function that limits itself; without a call there is none."""
    with _limited(_limit.get()):
        yield


@contextmanager
def _limited(seconds: float | None) -> Iterator[None]:
    """Interrupt a block after some time; if it does not stop, end the process, after printing where it is."""
    if seconds is None:
        yield
        return
    us = os.getpid()
    faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=2)
    try:
        with interrupted(seconds):
            yield
    finally:
        if os.getpid() == us:  # a copy by `os.fork` has no thread that could be told
            faulthandler.cancel_dump_traceback_later()


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


@contextmanager
def _alone() -> Iterator[None]:
    """End copies of this process that a call made by `os.fork`, so that one process answers."""
    us = os.getpid()
    try:
        yield
    finally:
        if os.getpid() != us:
            os._exit(0)


def _ring(*_: Any) -> None:
    raise Late


def _place(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.name != _ring.__name__ and not f.filename.startswith("<frozen ")]
    return f"{own[-1].filename}:{own[-1].lineno}, in {own[-1].name}"
