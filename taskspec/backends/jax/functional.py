"""A task as pure functions of one environment, in the shape that gymnax users know.

Use them under `jit`, `vmap` and `scan`. The key that `reset` gets is the seed: `reset(jax.random.key(s))` walks the
trajectory of the scalar environment with seed s. No other keys are needed, since draws follow from the seed and the
counters that the state carries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp

from taskspec.backends.jax.gymnax import Gymnax
from taskspec.backends.jax.params import OpenParameters
from taskspec.backends.jax.program import JaxProgram, State, StepResult, acted, compile_jax, observed
from taskspec.base.arrays import AnyArray
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.registry import load
from taskspec.task.build import build_varying
from taskspec.task.task import Task, TaskLike


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
        opened = tuple(p for name in names for p in self.task.parameters if p.name == name)
        self._open = OpenParameters.of(built, opened)
        self.default_params: Any = self._open.default(self.task)

    @property
    def name(self) -> str:
        return self.task.id

    # -- one environment ------------------------------------------------------------------------------------------

    def reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        """Return the first observation and state of a key: `jax.random.key(seed)`, or its uint32 words (2,)."""
        observation, state = self.lanes_reset(key_words(key)[:, None], params)
        return _single(observation), _single(state)

    def step(
        self, state: State, action: AnyArray, params: Any = None
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]:
        """Observation, state, reward, done and info of a step; an episode that ends begins anew (autoreset).

        info holds "terminated", "truncated", and "final_observation", that of the step itself.
        """
        observation, state, result = self.lanes_step(_lane(state), jnp.asarray(action)[..., None], params)
        info = {
            "terminated": result.terminated[0],
            "truncated": result.truncated[0],
            "final_observation": _single(observed(self.program.observation, result.observation)),
        }
        done = info["terminated"] | info["truncated"]
        return _single(observation), _single(state), result.reward[0], done, info

    def step_env(
        self, state: State, action: AnyArray, params: Any = None
    ) -> tuple[Any, State, AnyArray, AnyArray, dict[str, AnyArray]]:
        """Return a step without autoreset; info holds "terminated" and "truncated"."""
        program = self.program
        action = acted(program.action, jnp.asarray(action)[..., None])
        after, result = self._stepped(_lane(state), action, self._open.values(params))
        seen = _single(observed(program.observation, result.observation))
        ends = {"terminated": result.terminated[0], "truncated": result.truncated[0]}
        return seen, _single(after), result.reward[0], ends["terminated"] | ends["truncated"], ends

    def gymnax(self, *, one_hot: bool = False, flat_actions: bool = False) -> Gymnax:
        """Return the same functions under gymnax's signatures, with its spaces.

        Args:
            one_hot: finite observations as vectors of 0 and 1, float32.
            flat_actions: several finite action components as one number, the last component fastest.

        Raises:
            SpecError: E713, for observations or actions that are not finite.
        """
        names = [p.name for p in self._open.varying]
        functions = Functional(_one_hot(self.task), names) if one_hot else self
        return Gymnax(functions, flat_actions)

    # -- many environments, lanes last ----------------------------------------------------------------------------

    def lanes_reset(self, key: AnyArray, params: Any = None) -> tuple[Any, State]:
        """First observations (*shape, N) and states of keys: uint32 (2, N), high and low words of the seeds.

        Parameters are numbers, or arrays (N,).
        """
        state, seen = self.program.reset(key, self._open.values(params))
        return observed(self.program.observation, seen), state

    def lanes_step(self, state: State, action: AnyArray, params: Any = None) -> tuple[Any, State, StepResult]:
        """Return a step of every lane with autoreset; actions are (*shape, N). The result holds the observations before
        it.
        """
        given = self._open.values(params)
        after, result = self._stepped(state, acted(self.program.action, action), given)
        following, seen = self.program.again(after, result, given)
        return observed(self.program.observation, seen), following, result

    def _stepped(self, state: State, action: Any, given: tuple[AnyArray, ...]) -> tuple[State, StepResult]:
        after, result = self.program.step(state, action, given)
        return after, result._replace(reward=self._open.paid(result.reward, given))


def _one_hot(task: Task) -> Task:
    """Return the same task with one-hot observations."""
    if not all(c.is_finite for c in task.observation.components):
        raise SpecError(
            [Diagnostic("E713", None, f"the observations of {task.id} are not finite, and cannot be one-hot")]
        )
    return replace(task, observation=replace(task.observation, space="one_hot"))


def key_words(key: AnyArray) -> AnyArray:
    """Return the two uint32 words of a key, high word first; of longer keys than Threefry's, the first two."""
    if jnp.issubdtype(key.dtype, jax.dtypes.prng_key):
        key = jax.random.key_data(key)
    return jnp.asarray(key, jnp.uint32)[:2]


def _lane(tree: Any) -> Any:
    return jax.tree.map(lambda x: x[..., None], tree)


def _single(tree: Any) -> Any:
    return jax.tree.map(lambda x: x[..., 0], tree)
