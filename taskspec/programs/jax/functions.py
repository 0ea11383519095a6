"""A task as pure functions of one environment, for `jit`, `vmap` and `scan`, with parameters that may vary; and for gymnax."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap

from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error, suggest
from taskspec.base.extras import need
from taskspec.base.named import all_names, entries_by_name
from taskspec.language.expressions.types import INT_MAX
from taskspec.language.registry import load
from taskspec.language.task.build import build_varying
from taskspec.language.task.parts import Parameter, are_finite
from taskspec.language.task.spaces import FLOAT_MAX, SpaceLayout, single
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.jax.program import JaxProgram, State, StepResult, acted, compile_jax, compile_required, observed


class Gymnax:
    """`reset(key, params)` and `step(key, state, action, params)`; the key of `reset` is the seed, others are ignored.

    Finite observations and actions count from 0, since spaces of gymnax do. With `flat_actions`, one number says which of all
    combinations of several finite components is meant, the last component fastest.

    Raises:
        SpecError: E713, for flat actions that are not finite.
    """

    def __init__(self, functional: Functional, flat_actions: bool = False) -> None:
        task = functional.task
        program = functional.program
        self._functional = functional
        self._seen = program.observation
        self._acted = program.action
        if flat_actions and self._acted.form not in ("discrete", "multi_discrete"):
            raise spec_error("E713", f"the actions of {task.id} are not finite, and cannot be one number")
        self._flat = flat_actions and self._acted.form == "multi_discrete"
        self.name = functional.name
        self.default_params: Any = functional.default_params

    def reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        seen, state = self._functional.reset(key, params)
        return _from_zero(self._seen, seen), state

    reset_env = reset

    def step(self, key: AnyArray, state: State, action: AnyArray, params: Any = None) -> Any:
        """Observation, state, reward, terminated, truncated, info; with autoreset.

        info holds "terminated", "truncated", and "final_observation", the observation of the step itself.
        """
        seen, following, reward, _, info = self._functional.step(state, self._action(action), params)
        info["final_observation"] = _from_zero(self._seen, info["final_observation"])
        return _from_zero(self._seen, seen), following, reward, info["terminated"], info["truncated"], info

    def step_env(self, key: AnyArray, state: State, action: AnyArray, params: Any = None) -> Any:
        """Observation, state, reward, terminated, info; without autoreset and horizon."""
        seen, following, reward, _, info = self._functional.step_env(state, self._action(action), params)
        return _from_zero(self._seen, seen), following, reward, info["terminated"], info

    def is_truncated(self, state: State, params: Any = None) -> AnyArray:
        return state.time >= self.default_params.max_steps_in_episode

    def _action(self, action: AnyArray) -> AnyArray:
        if self._flat:
            return jnp.stack(jnp.unravel_index(action, self._acted.counts), -1)
        if self._acted.form == "discrete":
            return action + self._acted.starts[0]
        return action

    @property
    def num_actions(self) -> int:
        """The number of actions; the size of an action that is an array."""
        if self._flat:
            return math.prod(self._acted.counts)
        if self._acted.form == "discrete":
            return self._acted.counts[0]
        return self._acted.size

    def action_space(self, params: Any = None) -> Any:
        """Return a space of gymnax; several finite components are a box of integers.

        Raises:
            SpecError: E705 where gymnax is not installed.
        """
        if self._flat:
            return _spaces().Discrete(self.num_actions)
        return _space(self._acted)

    def observation_space(self, params: Any = None) -> Any:
        """Return a space of gymnax.

        Raises:
            SpecError: E705 where gymnax is not installed.
        """
        return _space(self._seen)


def _from_zero(layout: SpaceLayout, seen: Any) -> Any:
    match layout.form:
        case "discrete":
            return seen - layout.starts[0]
        case "dict":
            starts = {}
            for c in layout.components:
                if c.is_finite and c.type.is_scalar:
                    starts[c.name] = int(c.low[0])
            counted = {}
            for name, value in seen.items():
                counted[name] = value - starts.get(name, 0)
            return counted
        case _:
            return seen


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
            made = {}
            for c in layout.components:
                if c.is_finite and c.type.is_scalar:
                    made[c.name] = spaces.Discrete(c.counts[0])
                else:
                    lows = tuple(map(single, c.low))
                    made[c.name] = _box(spaces, lows, tuple(map(single, c.high)), c.type.shape)
            return spaces.Dict(made)
        case "box":
            return _box(spaces, layout.low, layout.high, layout.shape)


def _box(spaces: Any, low: tuple[float, ...], high: tuple[float, ...], shape: tuple[int, ...]) -> Any:
    """Without bounds where there are none: gymnax's own environments have the largest float32 there."""
    lows, highs = (np.clip(np.reshape(b, shape), -FLOAT_MAX, FLOAT_MAX).astype(np.float32) for b in (low, high))
    return spaces.Box(jnp.array(lows), jnp.array(highs), shape)


def _spaces() -> Any:
    return need("gymnax.environments.spaces", what="a space of gymnax")


_DTYPES = {"int": jnp.int32, "real": jnp.float32}


@dataclass(frozen=True)
class OpenParameters:
    """The open parameters of a task, and the conditions that the spec has for it, each with its message."""

    varying: tuple[Parameter, ...]
    bound: tuple[str, ...] = ()
    key: str = ""
    messages: tuple[str, ...] = ()
    conditions: Callable[..., tuple[AnyArray, ...]] = field(default=lambda *given: (), compare=False, repr=False)

    @classmethod
    def of(cls, task: Task, varying: tuple[Parameter, ...]) -> OpenParameters:
        """Open parameters of a task that is built with them open."""
        messages = tuple(message for _, message in task.process.required)
        fixed = tuple(p.name for p in task.parameters if p.name not in all_names(varying))
        return cls(varying, fixed, repr(task.process.required), messages, compile_required(task))

    def default(self, task: Task) -> Any:
        """Return a named tuple of the horizon, `max_steps_in_episode`, and of the values: a pytree for `vmap` and `jit`.

        Its `replace(slip=0.3)` is the same with other values of these parameters. Values that are known are checked: SpecError
        E703 for one that the spec does not allow, E704 for some that it does not allow together, E713 for another horizon, or
        for a parameter that is not open, E702 for a name that is none. Within `vmap` they are known, within `jit` they are not.
        """
        return _params(self)(INT_MAX if task.horizon is None else task.horizon, *(p.value for p in self.varying))

    def values(self, params: Any) -> tuple[AnyArray, ...]:
        """Arrays (N,) or (1,) of the parameters, lanes last; values with which the task was loaded unless given."""
        arrays = []
        for p in self.varying:
            value = getattr(params, p.name, p.value)
            arrays.append(jnp.atleast_1d(jnp.asarray(value, _DTYPES[p.kind])))
        return tuple(arrays)

    def paid(self, reward: AnyArray, given: Sequence[AnyArray]) -> AnyArray:
        """Pay the reward (N,), nan where the spec does not allow the parameters: compiled programs cannot do more."""
        allowed = list(self.conditions(*given))
        for p, value in zip(self.varying, given, strict=True):
            if p.low is not None:
                allowed.append(value >= jnp.asarray(p.low, value.dtype))
            if p.high is not None:
                allowed.append(value <= jnp.asarray(p.high, value.dtype))
        for each in allowed:
            reward = jnp.where(each, reward, jnp.nan)
        return reward

    def check(self, params: Any) -> None:
        """Refuse (E704) known values that the spec does not allow together."""
        for message, holds in zip(self.messages, self.conditions(*self.values(params)), strict=True):
            known = _known(holds)
            if known is not None and not known.all():
                first = np.argmin(known)
                told = []
                for p in self.varying:
                    value = np.asarray(_known(getattr(params, p.name))).reshape(-1)
                    told.append(f"{p.name}={value[first % value.size]}")
                raise spec_error("E704", f"{message} ({', '.join(told)})")


@lru_cache(maxsize=256)
def _params(opened: OpenParameters) -> Any:
    """Make the class once for the same parameters, as JAX compares the classes of pytrees."""
    known = entries_by_name(opened.varying)
    base = namedtuple("Params", ("max_steps_in_episode", *known))  # type: ignore[misc]

    class Params(base):
        """The horizon, and the parameters that may differ between lanes."""

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
    if name == "max_steps_in_episode":
        return Diagnostic("E713", None, f"{name} is the horizon of the task", "for another horizon, load another task")
    if name not in opened.bound:
        known = [*all_names(opened.varying), *opened.bound]
        hint = suggest(name, known) or (f"it has {', '.join(known)}" if known else None)
        return Diagnostic("E702", None, f"the task has no parameter '{name}'", hint)
    hint = (
        f"`Functional(load(task, {name}=...))` is another task; `Functional(task, varying=['{name}'])` leaves it open"
    )
    return Diagnostic("E713", None, f"{name} is bound when the task is loaded", hint)


def _known(value: Any) -> AnyArray | None:
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
    if not seen or isinstance(seen[-1], jax.core.Tracer):
        return None
    return np.asarray(seen[-1])


def _check(parameter: Parameter, value: Any) -> None:
    """Refuse (E703) known values that the spec does not allow."""
    known = _known(value)
    if known is None:
        return
    given = known.astype(np.float64)
    low = -math.inf
    if parameter.low is not None:
        low = parameter.low
    high = math.inf
    if parameter.high is not None:
        high = parameter.high
    is_whole = parameter.kind != "int" or (given == np.rint(given)).all()
    if not (is_whole and ((given >= low) & (given <= high)).all()):
        kind = {"int": "an int"}.get(parameter.kind, "a number")
        raise spec_error("E703", f"parameter {parameter.name} must be {kind} between {low} and {high}, not {known}")


class Functional:
    """`reset(key) -> (observation, state)`, and `step(state, action)` with autoreset or `step_env` without it.

    Arrays of one environment have no axis for lanes. For many environments, `lanes_reset` and `lanes_step` take and
    give arrays with the lanes last, which XLA compiles to better code than `vmap` over the first axis.

    `varying` names numeric parameters of the task that are given where it runs, as `params`: `default_params` with other
    values. They may be traced and differ between lanes, unless they decide shapes, counts, bounds or the horizon. Computed where
    the task runs, they are float32, and probabilities are as those that depend on the state.

    Raises:
        SpecError: E702 and E713 for parameters that cannot vary.
    """

    def __init__(self, task: TaskLike, varying: Sequence[str] = ()) -> None:
        self.task: Task = load(task)
        names = tuple(sorted(set(varying)))
        built = build_varying(self.task, names) if names else self.task
        self.program: JaxProgram = compile_jax(built)
        parameters = entries_by_name(self.task.parameters)
        self._open = OpenParameters.of(built, tuple(parameters[name] for name in names))
        self.default_params: Any = self._open.default(self.task)

    @property
    def name(self) -> str:
        return self.task.id

    # -- one environment ------------------------------------------------------------------------------------------

    def reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        """Begin an episode.

        Args:
            key: `jax.random.key(seed)`, or its uint32 words (2,).
            params: values of the parameters in `varying`; `default_params` if None.

        Returns:
            the first observation, of the shape and dtype of its space, and the state.
        """
        observation, state = self.lanes_reset(key_words(key)[:, None], params)
        return _single(observation), _single(state)

    def step(
        self, state: State, action: AnyArray, params: Any = None
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]:
        """Take a step; after the end of an episode the next one begins (autoreset).

        Args:
            state: as the last step or `reset` gave it.
            action: of the shape of the action space.
            params: as for `reset`.

        Returns:
            observation, state, reward float32 (), done bool () and info: "terminated", "truncated", "final_observation" of
            the step itself, "measures" where the task has some, and "action_mask" of the state returned where it has `legal`.
        """
        observation, state, result = self.lanes_step(_lane(state), jnp.asarray(action)[..., None], params)
        info = self._info(state, result, params)
        info["final_observation"] = _single(observed(self.program.observation, result.observation))
        done = info["terminated"] | info["truncated"]
        return _single(observation), _single(state), result.reward[0], done, info

    def step_env(
        self, state: State, action: AnyArray, params: Any = None
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]:
        """Take a step without autoreset.

        Args:
            state, action, params: as for `step`.

        Returns:
            as `step` does, for the state in which the step ends; info lacks "final_observation".
        """
        program = self.program
        action = acted(program.action, jnp.asarray(action)[..., None])
        after, result = self._stepped(_lane(state), action, self._open.values(params))
        seen = _single(observed(program.observation, result.observation))
        done = result.terminated[0] | result.truncated[0]
        return seen, _single(after), result.reward[0], done, self._info(after, result, params)

    def _info(self, state: State, result: StepResult, params: Any) -> dict[str, Any]:
        info: dict[str, Any] = {"terminated": result.terminated[0], "truncated": result.truncated[0]}
        if result.measures:
            names = self.task.process.measures
            info["measures"] = {name: value[0] for name, value in zip(names, result.measures, strict=True)}
        if self.task.mask:
            info["action_mask"] = self.program.mask(state, self._open.values(params))[:, 0]
        return info

    def action_mask(self, state: State, params: Any = None) -> AnyArray:
        """Test which actions are legal in a state of a task with `legal`.

        Args:
            state, params: as for `step`.

        Returns:
            bool (n,), by the number of the action.
        """
        return self.program.mask(_lane(state), self._open.values(params))[:, 0]

    def gymnax(self, *, one_hot: bool = False, flat_actions: bool = False) -> Gymnax:
        """Return the same functions under gymnax's signatures, with its spaces.

        Args:
            one_hot: finite observations as vectors of 0 and 1, float32.
            flat_actions: several finite action components as one number, the last component fastest.

        Returns:
            an environment with gymnax's `reset`, `step`, `observation_space` and `action_space`.

        Raises:
            SpecError: E713, for observations or actions that are not finite.
        """
        if not one_hot:
            return Gymnax(self, flat_actions)
        task = self.task
        if not are_finite(task.observation.components):
            raise spec_error("E713", f"the observations of {task.id} are not finite, and cannot be one-hot")
        task = replace(task, observation=replace(task.observation, space="one_hot"))
        return Gymnax(Functional(task, all_names(self._open.varying)), flat_actions)

    # -- many environments, lanes last ----------------------------------------------------------------------------

    def lanes_reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        """Begin an episode in each of N lanes.

        Args:
            key: uint32 (2, N), the high and the low words of the seeds.
            params: as for `reset`, each a number or an array (N,).

        Returns:
            the first observations (*shape, N), and the states.
        """
        state, seen = self.program.reset(key, self._open.values(params))
        return observed(self.program.observation, seen), state

    def lanes_step(self, state: State, action: AnyArray, params: Any = None) -> tuple[Any, State, StepResult]:
        """Take a step in every lane; after the end of an episode the next one begins there (autoreset).

        Args:
            state: of the lanes, as the last step or `lanes_reset` gave it.
            action: (*shape, N).
            params: as for `lanes_reset`.

        Returns:
            observations (*shape, N), states, and the result of the step before autoreset: its observations, rewards
            float32 (N,), terminated and truncated bool (N,), measures.
        """
        given = self._open.values(params)
        after, result = self._stepped(state, acted(self.program.action, action), given)
        following, seen = self.program.again(after, result, given)
        return observed(self.program.observation, seen), following, result

    def _stepped(self, state: State, action: Any, given: tuple[AnyArray, ...]) -> tuple[State, StepResult]:
        after, result = self.program.step(state, action, given)
        return after, result._replace(reward=self._open.paid(result.reward, given))


def key_words(key: AnyArray) -> AnyArray:
    """Two uint32 words of a key, high word first; of longer keys than Threefry's, the first two."""
    if jnp.issubdtype(key.dtype, jax.dtypes.prng_key):
        key = jax.random.key_data(key)
    return jnp.asarray(key, jnp.uint32)[:2]


def _lane(tree: Any) -> Any:
    return jax.tree.map(lambda x: x[..., None], tree)


def _single(tree: Any) -> Any:
    return jax.tree.map(lambda x: x[..., 0], tree)
