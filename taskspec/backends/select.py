"""Which backend steps a vector environment, and how to get one that is not installed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from taskspec.backends.vector import Engine, Options
from taskspec.diagnostics import Diagnostic, SpecError, suggest
from taskspec.extras import install, missing
from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class Backend:
    """Where the engine of a backend is, and the package that it needs besides NumPy."""

    module: str
    engine: str
    needs: str | None = None


BACKENDS: dict[str, Backend] = {
    "numpy": Backend("taskspec.backends.numpy.engine", "NumpyEngine"),
    "numba": Backend("taskspec.backends.numba", "NumbaEngine", needs="numba"),
    "jax": Backend("taskspec.backends.jax", "JaxEngine", needs="jax"),
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
    needs = BACKENDS[backend].needs
    if needs is not None and find_spec(needs) is None:
        raise missing(needs, install(backend), f"the backend {backend!r}")
    return backend


def _suits_numba(task: Task) -> bool:
    suits: bool = import_module("taskspec.backends.numba.kernel").suits(task)
    return suits


def _make(backend: str) -> Any:
    entry = BACKENDS[backend]
    return getattr(import_module(entry.module), entry.engine)
