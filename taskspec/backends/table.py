"""The table of backends: one entry for each says what it needs, what it can do, and how it is made.

Whatever names backends takes the names from here. Nothing is imported, so that the command line may.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

BackendName = Literal["auto", "numpy", "numba", "jax"]
"""The names that stand for a backend: those of the table and "auto", as a type."""


@dataclass(frozen=True, slots=True)
class Backend:
    """A way to step many environments of a task together.

    `engine` is its class (`module:name`), and `suits`, where not all tasks suit it, a function that tells whether a task
    does. `needs` is the package that it needs besides NumPy. `tolerance` is how far its reals may be from those of the reference
    interpreter, relative to 1 + |x|.
    """

    engine: str
    needs: str | None = None
    suits: str | None = None
    tolerance: float = 1e-12  # the C library against NumPy or polynomials


BACKENDS: dict[str, Backend] = {
    "numpy": Backend("taskspec.backends.numpy.engine:NumpyEngine"),
    "numba": Backend("taskspec.backends.numba:NumbaEngine", "numba", suits="taskspec.backends.numba.kernel:suits"),
    # float32, and fused products
    "jax": Backend("taskspec.backends.jax:JaxEngine", "jax", tolerance=2e-4),
}
AUTOMATIC = ("numba", "numpy")
"""What "auto" stands for: the first of these that is installed and suits the task."""
PROGRAMS = ("scalar", *BACKENDS, "jax-scan")
"""What there is to measure: one Gymnasium environment, vector environments, and the JAX program inside `scan`."""
QUICKEST = tuple(f"{name}-scan" if f"{name}-scan" in PROGRAMS else name for name in BACKENDS)
"""Of the programs of each backend the one that is the quickest."""
