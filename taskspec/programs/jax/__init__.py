"""The JAX program: pure functions of a task, and an engine for the vector environment made of them."""

from __future__ import annotations

from taskspec.base.extras import need

need("jax", "jax")

from taskspec.programs.jax.functions import Functional as Functional  # noqa: E402
from taskspec.programs.jax.program import JaxEngine as JaxEngine  # noqa: E402
from taskspec.programs.jax.program import JaxProgram as JaxProgram  # noqa: E402
from taskspec.programs.jax.program import State as State  # noqa: E402
from taskspec.programs.jax.program import StepResult as StepResult  # noqa: E402
from taskspec.programs.jax.program import compile_jax as compile_jax  # noqa: E402

__all__ = ["Functional", "State", "StepResult"]
