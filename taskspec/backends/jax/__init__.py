"""The JAX program: pure functions of a task, and an engine for the vector environment made of them."""

from __future__ import annotations

from taskspec.backends.jax.engine import JaxEngine as JaxEngine
from taskspec.backends.jax.functional import Functional as Functional
from taskspec.backends.jax.program import JaxProgram as JaxProgram
from taskspec.backends.jax.program import Result as Result
from taskspec.backends.jax.program import State as State
from taskspec.backends.jax.program import compile_jax as compile_jax
