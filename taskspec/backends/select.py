"""Which backend steps a vector environment, and how to get one that is not installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from taskspec.backends.vector import BACKENDS, Engine, Options
from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.extras import install, missing
from taskspec.task.task import Task

_ENGINES = {
    "numpy": ("taskspec.backends.numpy.engine", "NumpyEngine"),
    "numba": ("taskspec.backends.numba", "NumbaEngine"),
    "jax": ("taskspec.backends.jax", "JaxEngine"),
}


def engine(task: Task, lanes: int, backend: str, options: Options) -> Engine:
    """The environments of a task on a backend; "auto" is Numba where it is installed and suits the task, else NumPy.

    Raises:
        SpecError: E713 for a backend that does not exist, E705 for one whose packages are not installed.
    """
    return _make(choose(task, backend))(task, lanes, options)  # type: ignore[no-any-return]


def choose(task: Task, backend: str) -> str:
    """The backend that a name stands for."""
    if backend == "auto":
        return "numba" if find_spec("numba") is not None and _suits_numba(task) else "numpy"
    if backend not in BACKENDS:
        names = ("auto", *BACKENDS)
        message = f"there is no backend {backend!r}; there are {', '.join(names)}"
        raise SpecError([Diagnostic("E713", None, message, suggest(str(backend), names))])
    if backend != "numpy" and find_spec(backend) is None:
        raise missing(backend, install(backend), f"the backend {backend!r}")
    return backend


def _suits_numba(task: Task) -> bool:
    suits: bool = import_module("taskspec.backends.numba.kernel").suits(task)
    return suits


def _make(backend: str) -> Any:
    module, name = _ENGINES[backend]
    return getattr(import_module(module), name)
