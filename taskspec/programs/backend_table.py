"""The table of backends: what each needs and can do, and which one steps a vector environment."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.extras import install, is_installed, missing
from taskspec.language.task.task import Task
from taskspec.programs.vector_program import Engine, Options

# Whatever names backends takes the names from here. Nothing is imported, so that the command line may.

BackendName = Literal["auto", "numpy", "numba", "jax"]
"""The names of backends: the names of the table, and "auto", as a type."""


@dataclass(frozen=True, slots=True)
class Backend:
    """A way to step many environments of a task together.

    `engine` is its class (`module:name`), and `suits` a function from a task to whether it suits the backend; None if all do.
    `needs` is the package that it needs in addition to NumPy. `tolerance` is the largest difference of its reals from the
    reference interpreter's, relative to 1 + |x|.
    """

    engine: str
    needs: str | None = None
    suits: str | None = None
    tolerance: float = 1e-12  # the C library against NumPy or polynomials


BACKENDS: dict[str, Backend] = {
    "numpy": Backend("taskspec.programs.numpy:NumpyEngine"),
    "numba": Backend("taskspec.programs.numba:NumbaEngine", "numba", suits="taskspec.programs.numba.kernel:suits"),
    # float32, and fused products
    "jax": Backend("taskspec.programs.jax:JaxEngine", "jax", tolerance=2e-4),
}
AUTOMATIC = ("numba", "numpy")
""""auto" is the first of these that is installed and suits the task."""
PROGRAMS = ("scalar", *BACKENDS, "jax-scan")
"""Programs to measure: one Gymnasium environment, vector environments, and the JAX program inside `scan`."""
QUICKEST = tuple(f"{name}-scan" if f"{name}-scan" in PROGRAMS else name for name in BACKENDS)
"""The fastest program of each backend."""


def engine(task: Task, lanes: int, backend: str, options: Options) -> Engine:
    """Make the environments of a task on a backend; "auto" is Numba where it is installed and suits the task, else NumPy.

    Raises:
        SpecError: E713 for a backend that does not exist, E705 for one whose packages are not installed.
    """
    return _named(BACKENDS[choose(task, backend)].engine)(task, lanes, options)


def choose(task: Task, backend: str) -> str:
    """Look up a backend by its name, which may be "auto"."""
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
    needs = BACKENDS[backend].needs
    return needs is None or is_installed(needs)


def suits(backend: str, task: Task) -> bool:
    asked = BACKENDS[backend].suits
    return asked is None or _named(asked)(task)


def _named(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
