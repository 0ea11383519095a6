"""A task as Gymnasium's `FuncEnv`: pure functions over JAX arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.experimental.functional import FuncEnv

from taskspec.language.task.spaces import space
from taskspec.language.task.task import TaskLike
from taskspec.programs.jax import Functional, State

if TYPE_CHECKING:
    _FuncEnv = FuncEnv["FuncState", Any, Any, Any, Any, Any, Any]
else:
    _FuncEnv = FuncEnv  # Gymnasium 0.29 has one type fewer, without parameters

__all__ = ["FuncState", "TaskFuncEnv"]


class FuncState(NamedTuple):
    """The state of an environment together with what its last step gave."""

    state: State
    seen: Any
    paid: Any
    terminated: Any
    measures: Any
    mask: Any


class TaskFuncEnv(_FuncEnv):
    """A task's pure functions; the key of `initial` is the seed, later keys are ignored (see `Functional`).

    There is no autoreset, and the horizon is the caller's, as for every FuncEnv.
    """

    def __init__(self, task: TaskLike, options: dict[str, Any] | None = None, varying: Sequence[str] = ()) -> None:
        self._functional = Functional(task, varying)
        super().__init__(options)
        self.observation_space: gymnasium.Space[Any] = space(self._functional.program.observation)
        self.action_space: gymnasium.Space[Any] = space(self._functional.program.action)

    def initial(self, rng: Any, params: Any = None) -> FuncState:
        seen, state = self._functional.reset(rng, params)
        if self._functional.task.mask:
            mask = self._functional.action_mask(state, params)
        else:
            mask = ()
        return FuncState(state, seen, np.float32(0), np.False_, {}, mask)

    def transition(self, state: FuncState, action: Any, rng: Any, params: Any = None) -> FuncState:
        seen, following, reward, _, info = self._functional.step_env(state.state, action, params)
        mask = info.get("action_mask", ())
        return FuncState(following, seen, reward, info["terminated"], info.get("measures", {}), mask)

    def get_default_params(self, **changes: Any) -> Any:
        """Return the parameters in `varying`, as the task was loaded with them or with other values (see `Functional`)."""
        return self._functional.default_params.replace(**changes)

    def observation(self, state: FuncState, rng: Any, params: Any = None) -> Any:
        return state.seen

    def reward(self, state: FuncState, action: Any, next_state: FuncState, rng: Any, params: Any = None) -> Any:
        return next_state.paid

    def transition_info(
        self, state: FuncState, action: Any, next_state: FuncState, params: Any = None
    ) -> dict[str, Any]:
        """Return the measures of a step, and the legal actions after it, where the task has some."""
        info = self.state_info(next_state, params)
        if next_state.measures:
            info["measures"] = next_state.measures
        return info

    def state_info(self, state: FuncState, params: Any = None) -> dict[str, Any]:
        """Return the legal actions of a state, where the task has `legal`."""
        if not self._functional.task.mask:
            return {}
        return {"action_mask": state.mask}

    def terminal(self, state: FuncState, rng: Any, params: Any = None) -> Any:
        return state.terminated
