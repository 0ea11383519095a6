"""A task in the shape of an environment of gymnax 1.0, for its wrappers and for learners written for it."""

from __future__ import annotations

import math
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np

from taskspec.backends.jax.program import JaxProgram, State
from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import need
from taskspec.task.spaces import FLOAT_MAX, SpaceLayout, single
from taskspec.task.task import Component, Task


class Functions(Protocol):
    """What is adapted: `taskspec.backends.jax.functional.Functional`."""

    task: Task
    program: JaxProgram
    default_params: Any

    @property
    def name(self) -> str: ...
    def reset(self, key: AnyArray, params: Any) -> tuple[Any, State]: ...
    def step(
        self, state: State, action: AnyArray, params: Any
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]: ...
    def step_env(
        self, state: State, action: AnyArray, params: Any
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]: ...


class Gymnax:
    """`reset(key, params)` and `step(key, state, action, params)`; the key of `reset` is the seed, others are ignored.

    Finite observations and actions count from 0, since spaces of gymnax do. With `flat_actions`, one number says which of all
    combinations of several finite components is meant, the last component fastest.

    Raises:
        SpecError: E713, for flat actions that are not finite.
    """

    def __init__(self, functional: Functions, flat_actions: bool = False) -> None:
        task = functional.task
        program = functional.program
        self._functional = functional
        self._seen = program.observation
        self._acted = program.action
        if flat_actions and self._acted.form not in ("discrete", "multi_discrete"):
            raise SpecError(
                [Diagnostic("E713", None, f"the actions of {task.id} are not finite, and cannot be one number")]
            )
        self._flat = flat_actions and self._acted.form == "multi_discrete"
        self.name = functional.name
        self.default_params: Any = functional.default_params

    def reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        seen, state = self._functional.reset(key, params)
        return _from_zero(self._seen, seen), state

    reset_env = reset

    def step(self, key: AnyArray, state: State, action: AnyArray, params: Any = None) -> Any:
        """Observation, state, reward, terminated, truncated, info; with autoreset.

        info holds "terminated", "truncated", and "final_observation", that of the step itself.
        """
        seen, following, reward, _, info = self._functional.step(state, self._action(action), params)
        info["final_observation"] = _from_zero(self._seen, info["final_observation"])
        return _from_zero(self._seen, seen), following, reward, info["terminated"], info["truncated"], info

    def step_env(self, key: AnyArray, state: State, action: AnyArray, params: Any = None) -> Any:
        """Observation, state, reward, terminated, info; without autoreset and horizon."""
        seen, following, reward, _, info = self._functional.step_env(state, self._action(action), params)
        return _from_zero(self._seen, seen), following, reward, info["terminated"], info

    def is_truncated(self, state: State, params: Any = None) -> AnyArray:
        """Return whether the horizon is reached."""
        return state.time >= self.default_params.max_steps_in_episode

    def _action(self, action: AnyArray) -> AnyArray:
        if self._flat:
            return jnp.stack(jnp.unravel_index(action, self._acted.counts), -1)
        return action + self._acted.starts[0] if self._acted.form == "discrete" else action

    @property
    def num_actions(self) -> int:
        """How many actions there are; the size of an action that is an array."""
        if self._flat:
            return math.prod(self._acted.counts)
        return self._acted.counts[0] if self._acted.form == "discrete" else self._acted.size

    def action_space(self, params: Any = None) -> Any:
        """Return a space of gymnax; several finite components are a box of integers.

        Raises:
            SpecError: E705 where gymnax is not installed.
        """
        return _spaces().Discrete(self.num_actions) if self._flat else _space(self._acted)

    def observation_space(self, params: Any = None) -> Any:
        """Return a space of gymnax.

        Raises:
            SpecError: E705 where gymnax is not installed.
        """
        return _space(self._seen)


def _from_zero(layout: SpaceLayout, seen: Any) -> Any:
    """Return an observation whose finite scalars count from 0."""
    match layout.form:
        case "discrete":
            return seen - layout.starts[0]
        case "dict":
            starts = {c.name: int(c.low[0]) for c in layout.components if _is_discrete(c)}
            return {name: value - starts.get(name, 0) for name, value in seen.items()}
        case _:
            return seen


def _is_discrete(c: Component) -> bool:
    return c.is_finite and c.type.is_scalar


# -- spaces -------------------------------------------------------------------------------------------------------


def _space(layout: SpaceLayout) -> Any:
    spaces = _spaces()
    match layout.form:
        case "discrete":
            return spaces.Discrete(layout.counts[0])
        case "multi_discrete":
            high = jnp.array(layout.counts, jnp.int32) - 1
            return spaces.Box(jnp.zeros_like(high), high, layout.shape, jnp.int32)
        case "one_hot":
            return spaces.Box(0.0, 1.0, layout.shape)
        case "dict":
            return spaces.Dict({c.name: _component(spaces, c) for c in layout.components})
        case "box":
            return _box(spaces, layout.low, layout.high, layout.shape)


def _component(spaces: Any, c: Component) -> Any:
    if _is_discrete(c):
        return spaces.Discrete(c.counts[0])
    low, high = (tuple(single(v) for v in bound) for bound in (c.low, c.high))
    return _box(spaces, low, high, c.type.shape)


def _box(spaces: Any, low: tuple[float, ...], high: tuple[float, ...], shape: tuple[int, ...]) -> Any:
    """Without bounds where there are none: gymnax's own environments have the largest float32 there."""
    lows, highs = (np.clip(np.reshape(b, shape), -FLOAT_MAX, FLOAT_MAX).astype(np.float32) for b in (low, high))
    return spaces.Box(jnp.array(lows), jnp.array(highs), shape)


def _spaces() -> Any:
    return need("gymnax.environments.spaces", what="a space of gymnax")
