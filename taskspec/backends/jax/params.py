"""Parameters of a task that are given where it runs, so that they may differ between lanes."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap

from taskspec.backends.jax.program import compile_required
from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.lang.types import INT_MAX
from taskspec.task.task import Parameter, Task

_DTYPES = {"int": jnp.int32, "real": jnp.float32}


@dataclass(frozen=True)
class OpenParameters:
    """What a task leaves open, and the conditions that the spec has for it, each with what to say where it does not hold."""

    varying: tuple[Parameter, ...]
    bound: tuple[str, ...] = ()
    key: str = ""
    messages: tuple[str, ...] = ()
    conditions: Callable[..., tuple[AnyArray, ...]] = field(default=lambda *given: (), compare=False, repr=False)

    @classmethod
    def of(cls, task: Task, varying: tuple[Parameter, ...]) -> OpenParameters:
        """Return those of a task that is built with them open."""
        messages = tuple(message for _, message in task.required)
        bound = tuple(p.name for p in task.parameters if p.name not in {open_one.name for open_one in varying})
        if not messages:
            return cls(varying, bound)
        return cls(varying, bound, repr(task.required), messages, compile_required(task))

    def default(self, task: Task) -> Any:
        """Return a named tuple of the horizon, `max_steps_in_episode`, and of the values: a pytree for `vmap` and `jit`.

        Its `replace(slip=0.3)` is the same with other values of these parameters. Values that are known are checked: SpecError
        E703 for one that the spec does not allow, E704 for some that it does not allow together, E713 for another horizon, or
        for a parameter that is not open, E702 for a name that is none. Within `vmap` they are known, within `jit` they are not.
        """
        return _params(self)(INT_MAX if task.horizon is None else task.horizon, *(p.value for p in self.varying))

    def values(self, params: Any) -> tuple[AnyArray, ...]:
        """Return the parameters as arrays (N,) or (1,), lanes last; those that the task was loaded with where none are
        given.
        """
        given: Mapping[str, Any] = {p.name: p.value for p in self.varying} if params is None else params._asdict()
        return tuple(jnp.atleast_1d(jnp.asarray(given[p.name], _DTYPES[p.kind])) for p in self.varying)

    def paid(self, reward: AnyArray, given: Sequence[AnyArray]) -> AnyArray:
        """Return the reward (N,), nan where the spec does not allow the parameters: all that can be done once a program is
        compiled.
        """
        for allowed in (*self._ranges(given), *self.conditions(*given)):
            reward = jnp.where(allowed, reward, jnp.nan)
        return reward

    def _ranges(self, given: Sequence[AnyArray]) -> Iterator[AnyArray]:
        for p, value in zip(self.varying, given, strict=True):
            if p.low is not None:
                yield value >= jnp.asarray(p.low, value.dtype)
            if p.high is not None:
                yield value <= jnp.asarray(p.high, value.dtype)

    def check(self, params: Any) -> None:
        """Refuse (E704) values that the spec does not allow together, as far as they are known."""
        for message, holds in zip(self.messages, self.conditions(*self.values(params)), strict=True):
            known = _known(holds)
            if known is not None and not known.all():
                raise SpecError([Diagnostic("E704", None, f"{message} ({self._told(params, known)})")])

    def _told(self, params: Any, holds: AnyArray) -> str:
        """Return the first values of which something does not hold, where there is one for each of its own; else all of
        them.
        """
        found = []
        for p in self.varying:
            value = _known(getattr(params, p.name))
            if value is not None:
                here = value.reshape(-1)[np.argmin(holds)] if value.size == holds.size else value
                found.append(f"{p.name}={here}")
        return ", ".join(found)


@lru_cache(maxsize=256)
def _params(opened: OpenParameters) -> Any:
    """Return the class: the same for the same parameters, as JAX compares the classes of pytrees."""
    known = {p.name: p for p in opened.varying}
    base = namedtuple("Params", ("max_steps_in_episode", *known))  # type: ignore[misc]

    class Params(base):
        """What a caller may want to know, and the parameters that may differ between lanes."""

        __slots__ = ()

        def replace(self, **changes: Any) -> Any:
            for name, value in changes.items():
                if name in known:
                    _check(known[name], value)
                elif name not in self._fields or changes[name] != getattr(self, name):
                    raise SpecError([_refused(name, opened)])
            replaced = self._replace(**changes)
            opened.check(replaced)
            return replaced

    return Params


def _refused(name: str, opened: OpenParameters) -> Diagnostic:
    """Return why something cannot be replaced."""
    if name == "max_steps_in_episode":
        return Diagnostic(
            "E713", None, "max_steps_in_episode is the horizon of the task", "for another horizon, load another task"
        )
    if name not in opened.bound:
        known = [*(p.name for p in opened.varying), *opened.bound]
        hint = suggest(name, known) or (f"it has {', '.join(known)}" if known else None)
        return Diagnostic("E702", None, f"the task has no parameter '{name}'", hint)
    hint = (
        f"`Functional(load(task, {name}=...))` is another task; `Functional(task, varying=['{name}'])` leaves it open"
    )
    return Diagnostic("E713", None, f"{name} is bound when the task is loaded", hint)


def _known(value: Any) -> AnyArray | None:
    """Return a value as an array, with all lanes of what is mapped over by `vmap`; None where it is not known before a
    program runs.
    """
    if not isinstance(value, jax.core.Tracer):
        return np.asarray(value)
    seen: list[Any] = []

    @custom_vmap
    def look(one: AnyArray) -> AnyArray:
        return one

    @look.def_vmap
    def lanes(size: int, mapped: list[bool], every: AnyArray) -> tuple[AnyArray, bool]:
        seen.append(every)
        return (look(every) if isinstance(every, jax.core.Tracer) else every), mapped[0]  # of `vmap` within `vmap`

    look(value)
    return None if not seen or isinstance(seen[-1], jax.core.Tracer) else np.asarray(seen[-1])


def _check(parameter: Parameter, value: Any) -> None:
    """Refuse (E703) values that the spec does not allow, as far as they are known."""
    known = _known(value)
    if known is None:
        return
    given = known.astype(np.float64)
    low = parameter.low
    high = parameter.high
    problem = ""
    if np.isnan(given).any() or (low is not None and (given < low).any()):
        problem = f"must be at least {low}" if low is not None else "must be a number"
    elif high is not None and (given > high).any():
        problem = f"must be at most {high}"
    elif parameter.kind == "int" and (given != np.rint(given)).any():
        problem = "must be an int"
    if problem:
        raise SpecError([Diagnostic("E703", None, f"parameter {parameter.name} {problem}, not {known}")])
