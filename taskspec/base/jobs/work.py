"""The work of a process that does calls for another one, one at a time, each within its time limit."""

from __future__ import annotations

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
from typing import Any, Literal, NamedTuple

from taskspec.base.diagnostics import TaskspecError

LOOK = 0.5
"""Seconds between looks at whether the other process is still there."""


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


def begin(parent: int) -> None:
    """Prepare a process for calls: it ignores Ctrl-C, reads nothing, and prints to standard error.

    Args:
        parent: the process that it works for, with which it ends, even in the middle of a call.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)


def perform(call: bytes, seconds: float | None) -> Ending:
    """Call a function, and return how that ended.

    Args:
        call: see `pack`.
        seconds: that it may take; after them it is interrupted.
    """
    start = time.perf_counter()
    try:
        with interrupted(seconds), _alone():
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
