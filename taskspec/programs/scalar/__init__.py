"""The scalar program: generated Python that resets and steps one environment, in the lane form."""

from __future__ import annotations

import math
import operator
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language import draws
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.variates import sampler
from taskspec.language.task.spaces import SpaceLayout, pack, singles
from taskspec.language.task.task import Task
from taskspec.programs import run
from taskspec.programs.lowering import Invariants, cold_components
from taskspec.programs.scalar.interface import is_kept, row_names, sees_state
from taskspec.programs.scalar.module import Parts, generate
from taskspec.programs.scalar.phase import Phase, phase_stream


def scalar_namespace() -> dict[str, Any]:
    """Names that generated modules use: numbers, the functions of the operator table, and draws."""
    functions: dict[str, Any] = {}
    for entry in OPERATORS.values():
        functions.update(entry.scalar.names)
    return {
        "nan": math.nan,
        "inf": math.inf,
        **functions,
        "bisect_right": bisect_right,
        "bernoulli": draws.bernoulli,
        "weighted_categorical": draws.weighted_categorical,
    }


# Whatever depends on draws alone, not on the state, is computed by NumPy for blocks of coming steps and episodes;
# what is left for a step is straight-line Python on numbers. `compile_scalar` gives the functions and
# `ScalarProgram.source` the text.


class Clock(NamedTuple):
    """The counters of an environment: steps of this episode, steps of those before it, resets, and whether it is running."""

    time: int = 0
    past: int = 0
    episodes: int = 0
    alive: bool = False


Failure = Callable[..., Exception]


@dataclass(frozen=True)
class ScalarProgram:
    """A compiled task: `start` makes the functions of one environment.

    `source` is the generated module; `observation` and `action` say how values are laid out.
    """

    task: Task
    source: str
    observation: SpaceLayout
    action: SpaceLayout
    reset_phase: Phase
    step_phase: Phase
    _namespace: dict[str, Any] = field(repr=False)

    def start(self, seed: int, clock: Clock, bad_action: Failure, not_running: Failure) -> Lane:
        """Make functions of one environment, whose draws go on from where a clock stands.

        They raise what `bad_action(action)` and `not_running()` give.
        """
        first = phase_stream(self.reset_phase, seed, draws.RESET, clock.episodes)
        later = phase_stream(self.step_phase, seed, draws.STEP, clock.past + clock.time)
        return Lane(*self._namespace["lane"](first, later, bad_action, not_running))

    def replay(self, seed: int, clock: Clock) -> list[Any]:
        """Component values that the last reset gave."""
        layout = self.task.reset_words
        words = draws.words(seed, draws.RESET, clock.episodes - 1, layout.count)
        flats = evaluate(self.task.process.initial, {}, sampler(layout, words))
        return [flat if c.type.shape else flat[0] for c, flat in zip(self.task.state, flats, strict=True)]

    def pack(self, flats: Sequence[tuple[Any, ...]]) -> Any:
        """Join evaluated observation components, flat, to an observation."""
        return pack(self.observation, flats)


@dataclass(frozen=True)
class Lane:
    """One environment: `reset()`, `step(action)`, and its state (component values, clock) to get and put.

    A value that `get` gives as None has not changed since the last reset (`ScalarProgram.replay`); `put` needs all values.
    `mask()` gives the legal actions, int8 (n,); None where all actions are legal.
    """

    reset: Callable[[], tuple[Any, dict[str, Any]]]
    step: Callable[[Any], tuple[Any, float, bool, bool, dict[str, Any]]]
    get: Callable[[], tuple[tuple[Any, ...], tuple[int, int, int, bool]]]
    put: Callable[[Sequence[Any], tuple[int, int, int, bool]], None]
    mask: Callable[[], Array] | None


@lru_cache(maxsize=64)
def compile_scalar(task: Task) -> ScalarProgram:
    """Generate and compile the scalar program of a task."""
    observation = task.observation_layout
    action = task.action_layout
    b = task.new_builder()
    invariants = Invariants.of(b, task, observation.form == "box" and bool(observation.shape))
    roots = invariants.replaced(b, task.process.step_roots)
    seen = () if invariants.observation else invariants.replaced(b, task.next_observation)
    cold: frozenset[str] = frozenset()
    if not task.info or sees_state(task, observation):
        cold = cold_components(task, (*roots, *seen, *task.mask))
    initial = list(task.process.initial)
    for i, c in enumerate(task.state):
        if c.name in cold:
            initial[i] = b.scalar(0)
    rows = 1 + invariants.observation + (invariants.observation and is_kept(task) and sees_state(task, observation))
    first = (*initial, *invariants.at_reset)
    reset = Phase.of(b, first, task.first_observation, observation, task.reset_words, rows)
    step = Phase.of(b, roots, seen, observation, task.step_words)
    source, constants = generate(Parts(task, invariants, cold, reset, step, observation, action))
    namespace = {
        **scalar_namespace(),
        **constants,
        **row_names(task),
        "np": np,
        "array": np.array,
        "index": operator.index,
        "int8": np.int8,
        "singles": singles,
        **_ACTIONS,
    }
    run(source, f"<taskspec {task.id} {task.content_hash[:12]}>", namespace)
    return ScalarProgram(task, source, observation, action, reset, step, namespace)


def _as_floats(action: Any, shape: tuple[int, ...]) -> Any:
    array = np.asarray(action)
    if {shape, array.shape} <= {(), (1,)}:
        array = array.reshape(shape)
    return _as_ints(array, shape, "biuf", np.float64)


def _as_ints(action: Any, shape: tuple[int, ...], kinds: str = "iu", dtype: Any = np.int64) -> Any:
    """Convert an array-like action to ints; reals are refused, as `MultiDiscrete.contains` refuses them."""
    array = np.asarray(action)
    if array.shape != shape or array.dtype.kind not in kinds:
        raise ValueError
    return array.astype(dtype)


_ACTIONS = {
    "as_floats": _as_floats, "as_ints": _as_ints, "int64": np.dtype(np.int64), "float32": np.dtype(np.float32),
    "float64": np.dtype(np.float64),
}  # fmt: skip
