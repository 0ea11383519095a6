"""Which backend steps a vector environment, and how to get one that is not installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from taskspec.backends.table import AUTOMATIC, BACKENDS
from taskspec.backends.vector import Engine, Options
from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.extras import install, is_installed, missing
from taskspec.task.task import Task


def engine(task: Task, lanes: int, backend: str, options: Options) -> Engine:
    """The environments of a task on a backend; "auto" is Numba where it is installed and suits the task, else NumPy.

    Raises:
        SpecError: E713 for a backend that does not exist, E705 for one whose packages are not installed.
    """
    made: Engine = _named(BACKENDS[choose(task, backend)].engine)(task, lanes, options)
    return made


def choose(task: Task, backend: str) -> str:
    """The backend that a name stands for."""
    if backend == "auto":
        return next(name for name in AUTOMATIC if installed(name) and suits(name, task))
    if backend not in BACKENDS:
        names = ("auto", *BACKENDS)
        message = f"there is no backend {backend!r}; there are {', '.join(names)}"
        raise SpecError([Diagnostic("E713", None, message, suggest(str(backend), names))])
    needs = BACKENDS[backend].needs
    if needs is not None and not installed(backend):
        raise missing(needs, install(backend), f"the backend {backend!r}")
    return backend


def installed(backend: str) -> bool:
    """Whether the package that a backend needs can be imported."""
    needs = BACKENDS[backend].needs
    return needs is None or is_installed(needs)


def suits(backend: str, task: Task) -> bool:
    """Whether a backend that is installed is quick with a task."""
    asked = BACKENDS[backend].suits
    return asked is None or _named(asked)(task)


def _named(place: str) -> Any:
    """What a place, `module:name`, is of."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
