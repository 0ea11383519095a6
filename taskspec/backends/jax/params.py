"""Parameters of a task that are given where it runs, so that they may differ between lanes."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.lang.types import INT_MAX
from taskspec.task.task import Parameter, Task

Array = Any


def default_params(task: Task, varying: tuple[Parameter, ...]) -> Any:
    """A named tuple of the horizon, `max_steps_in_episode`, and of the values of some parameters: a pytree for `vmap` and `jit`.

    Its `replace(slip=0.3)` is the same with other values of these parameters. Values that are known are checked:
    SpecError E703 for one that the spec does not allow, E713 for another horizon or parameter.
    """
    horizon = INT_MAX if task.horizon is None else task.horizon
    return _params(varying)(horizon, *(p.value for p in varying))


@lru_cache(maxsize=256)
def _params(varying: tuple[Parameter, ...]) -> Any:
    """The class: the same for the same parameters, as JAX compares the classes of pytrees."""
    known = {p.name: p for p in varying}
    base = namedtuple("Params", ("max_steps_in_episode", *known))  # type: ignore[misc]

    class Params(base):
        """What a caller may want to know, and the parameters that may differ between lanes."""

        __slots__ = ()

        def replace(self, **changes: Any) -> Any:
            for name, value in changes.items():
                if name in known:
                    _check(known[name], value)
                elif name not in self._fields or changes[name] != getattr(self, name):
                    hint = f"`Functional(load(task, L=5))` is another task; `Functional(task, varying=['{name}'])` leaves it open"
                    message = f"{name} is bound when the task is loaded"
                    raise SpecError([Diagnostic("E713", None, message, hint)])
            return self._replace(**changes)

    return Params


def _check(parameter: Parameter, value: Any) -> None:
    """Refuse (E703) values that the spec does not allow, as far as they are known."""
    if isinstance(value, jax.core.Tracer):
        return
    given = np.asarray(value, np.float64)
    low, high = parameter.low, parameter.high
    problem = ""
    if np.isnan(given).any() or (low is not None and (given < low).any()):
        problem = f"must be at least {low}" if low is not None else "must be a number"
    elif high is not None and (given > high).any():
        problem = f"must be at most {high}"
    elif parameter.kind == "int" and (given != np.rint(given)).any():
        problem = "must be an int"
    if problem:
        raise SpecError([Diagnostic("E703", None, f"parameter {parameter.name} {problem}, not {value!r}")])


def values(varying: tuple[Parameter, ...], params: Any) -> tuple[Array, ...]:
    """The parameters as arrays (N,) or (1,), lanes last; those that the task was loaded with where none are given."""
    given: Mapping[str, Any] = {p.name: p.value for p in varying} if params is None else params._asdict()
    dtypes = {"int": jnp.int32, "real": jnp.float32}
    return tuple(jnp.atleast_1d(jnp.asarray(given[p.name], dtypes[p.kind])) for p in varying)
