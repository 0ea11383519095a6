"""Options of environments, and the errors of environments that are misused."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NoReturn, TypeAlias, get_args

import gymnasium.error

from taskspec.base.diagnostics import SpecError, TaskspecError, spec_error, suggest
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.language.task.parts import Ending
from taskspec.language.task.task import Task

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec


class ActionError(TaskspecError, gymnasium.error.InvalidAction, ValueError):
    """An action outside the action space (E706)."""


class NotRunningError(TaskspecError, gymnasium.error.ResetNeeded):
    """A step before the first reset (E707) or after the end of the episode (E708)."""


class LaneError(TaskspecError, AttributeError):
    """An attribute that the lanes of a vector environment do not have, or do not let go of (E713)."""


class StateError(TaskspecError, ValueError):
    """A state that the task does not have (E709)."""


ENDINGS = get_args(Ending)
Autoreset: TypeAlias = Literal["NextStep", "SameStep", "Disabled"]
"""Values of Gymnasium's `AutoresetMode`: when an episode that has ended begins anew."""


def invalid(message: str, hint: str | None = None) -> SpecError:
    """Return the error (E713) about an option that means nothing."""
    return spec_error("E713", message, hint)


def one_of(name: str, value: Any, options: Iterable[str]) -> None:
    """Refuse a value that is not one of the options.

    Raises:
        SpecError: E713, with the options and the nearest of them.
    """
    known = tuple(options)
    if value not in known:
        listed = ", ".join(map(repr, known))
        raise invalid(f"{name} must be one of {listed}, not {value!r}", suggest(str(value), known))


class HasSpec:
    """An environment that says how it was made, with the horizon, which Gymnasium leaves out where no wrapper enforces it.

    Whoever makes another from it also gets Gymnasium's limit of as many steps. So the horizon is among the keywords as well:
    with other parameters it may not hold, and is refused then.
    """

    task: Task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of it; `max_episode_steps` is the horizon. None where Gymnasium did not."""
        return self._spec

    @spec.setter
    def spec(self, value: EnvSpec | None) -> None:
        steps = self.task.horizon
        if value is not None and value.max_episode_steps is None and steps is not None:
            kwargs = {**value.kwargs, "max_episode_steps": steps}
            value = dataclasses.replace(value, max_episode_steps=steps, kwargs=kwargs)
        self._spec = value


def uncopied(env: object) -> NoReturn:
    """Refuse to copy or pickle lanes: generated code is bound to their arrays, so a copy would step the original."""
    raise TypeError(f"{type(env).__name__} is not copied or pickled; make another, and reset it with the same seed")


def reset_option(options: Any, name: str) -> Any:
    """Return the value of the only option that a reset takes; None where it is left out.

    Raises:
        SpecError: E713 for other options.
    """
    if options is None:
        return None
    if not isinstance(options, Mapping) or set(options) - {name}:
        raise invalid(f"the options of reset are {{'{name}': ...}}, not {options!r}")
    return options.get(name)


def positive(name: str, value: Any) -> int:
    """Return a positive int of any kind.

    Raises:
        SpecError: E713 for anything else.
    """
    number = _whole(value)
    if number is None or number < 1:
        raise invalid(f"{name} must be a positive int, not {value!r}")
    return number


def lanes_of(task: Task, number: int) -> int:
    """Return a number of environments to step together.

    Raises:
        SpecError: E713 for more than there is room for, in number or in the bytes of their states.
    """
    most = limits()
    widest = max(c.type.size for c in (*task.state, *task.action, *task.observation.components))
    if number > most.lanes:
        message = f"num_envs may be {most.lanes:,} at most, not {count(number)}"
        raise invalid(message, how_to_raise("lanes", number))
    if (needed := number * widest * 8 / 1e6) > most.megabytes:
        message = f"a component of {count(number)} environments takes {needed:,.0f} megabytes; the limit is {most.megabytes:,}"
        raise invalid(message, how_to_raise("megabytes", needed))
    return number


def seed_of(value: Any) -> int:
    """Return a seed: an int of any kind from 0 to 2**64 - 1.

    Raises:
        SpecError: E713 for anything else.
    """
    seed = _whole(value)
    if seed is None or not 0 <= seed < 2**64:
        raise invalid(f"a seed is an int between 0 and 2**64 - 1, not {value!r}")
    return seed


def _whole(value: Any) -> int | None:
    try:
        if isinstance(value, bool):
            return None
        return operator.index(value)
    except TypeError:
        return None
