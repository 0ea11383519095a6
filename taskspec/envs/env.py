"""The scalar Gymnasium environment of a task.

The generated program does the work; this class gives it Gymnasium's interface, errors, seeding, and a state that can be
read, set, copied and pickled. It enforces order, horizon and valid actions itself, so it needs no wrappers.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import gymnasium
import numpy as np

from taskspec.base.arrays import Array
from taskspec.envs import window
from taskspec.envs.options import ENDINGS, ActionError, HasSpec, NotRunningError, one_of, reset_option, seed_of
from taskspec.envs.state import all_legal, flat_state, plain_state
from taskspec.language import draws
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.expressions.variates import sampler
from taskspec.language.modifiers import with_options
from taskspec.language.registry import load
from taskspec.language.task.parts import Ending, RenderMode
from taskspec.language.task.spaces import space
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.scalar import Clock, Lane, ScalarProgram, compile_scalar

if TYPE_CHECKING:
    from taskspec.exact.solve.outcomes import GymTable

Reset = Callable[..., tuple[Any, dict[str, Any]]]


class Environment(HasSpec, gymnasium.Env[Any, Any]):
    """One environment of a task.

    Observations and actions follow the rules of the language (`observation_space`, `action_space`). `reset(seed=s)` starts
    the stream of draws of seed s; without a seed the stream goes on. `reset(options={"state": {...}})` overrides
    components of the first state, by name; a choice may be given as its label or its index.

    Args:
        task: the task, its id or its path.
        render_mode: None; "ansi" for text; "rgb_array" for pixels (480, 640, 3) of uint8; "rgb_array_list" for a list of them,
            one for every state of the episode since the last `render`; "human" for a window that follows every reset and
            step. All but "ansi" need the extra `figures`.
        ending: "terminate", or "absorb": terminal states absorb until the horizon and pay the absorbing reward.
        observe_time: whether the number of steps taken is added to the observation.

    Raises:
        SpecError: E705, when a way to render needs packages that are not installed; E713, for another option; E720, where the
            time does not fit into the observation.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(get_args(RenderMode)), "render_fps": 4}  # type: ignore[misc]

    def __init__(
        self, task: TaskLike, *, render_mode: RenderMode | None = None, ending: Ending = "terminate",
        observe_time: bool = False,
    ) -> None:  # fmt: skip
        if render_mode is not None:
            one_of("render_mode", render_mode, self.metadata["render_modes"])
        one_of("ending", ending, ENDINGS)
        if render_mode not in (None, "ansi"):
            window.require()
        self.task: Task = load(task)
        if ending == "absorb" or observe_time:
            self.task = with_options(self.task, ending, observe_time)
        self.render_mode: str | None = render_mode
        self._window: window.Window | None = None
        self._frames: list[window.Frame] = []
        self._drawing = window.Frames()
        self._program: ScalarProgram = compile_scalar(self.task)
        self.observation_space: gymnasium.Space[Any] = space(self._program.observation)
        self.action_space: gymnasium.Space[Any] = space(self._program.action)
        self._seed: int | None = None
        self._start(0, Clock())

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: an integer from 0; the episode and those after it are a function of it alone.
            options: `{"state": {name: value}}` overrides components of the first state.

        Returns:
            observation and info.

        Raises:
            StateError: when an overridden component has no such value.
            SpecError: E713, when the seed is none, or for another option.
        """
        override = reset_option(options, "state")
        if seed is not None:
            seed = seed_of(seed)
            super().reset(seed=seed)
            self._restart(seed)
        elif self._seed is None:
            self._restart(int.from_bytes(os.urandom(8), "little"))
        result = self._lane.reset()
        if override is None:
            return result
        self.state = override
        info: dict[str, Any] = {}
        if self._lane.mask is not None:
            info["action_mask"] = self._lane.mask()
        return self._observe(self._values()), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Args:
            action: an element of the action space.

        Returns:
            observation; reward, float; whether the episode terminated; whether it was truncated; info.

        Raises:
            ActionError: the action is not in the action space.
            NotRunningError: before the first reset, or after the end of the episode.
        """
        return self._lane.step(action)  # replaced on each instance by the generated function itself

    def render(self) -> Any:
        """Draw the present state as the render mode says.

        Returns:
            text for "ansi"; pixels, uint8 (height, width, 3), for "rgb_array"; the frames since the last call for
            "rgb_array_list"; None for "human", which shows a window.

        Raises:
            NotRunningError: before the first reset.
        """
        match self.render_mode:
            case "ansi":
                return window.text(self.task, self.state, self.time)
            case "rgb_array":
                return self._drawn()
            case "rgb_array_list":
                if self._seed is None:
                    raise NotRunningError("E707: there is nothing to see before the first reset()")
                frames = self._frames
                self._frames = []
                return frames
            case "human":
                self._show()

    def close(self) -> None:
        """Close the window, where there is one."""
        if self._window is not None:
            self._window.close()
        self._window = None
        super().close()

    def _drawn(self) -> window.Frame:
        state = self.state
        clock = self._clock
        return self._drawing.draw(self.task, state, clock.time, episode=clock.episodes)

    def _show(self) -> None:
        if self.render_mode == "rgb_array_list":
            if self.time == 0:
                self._frames = []
            self._frames.append(self._drawn())
            return
        if self._window is None:
            self._window = window.Window(self.task.id, self.metadata["render_fps"])
        self._window.show(self._drawn())

    def action_masks(self) -> Array:
        """Mark the legal actions of the present state, as MaskablePPO asks for them.

        Returns:
            bool (n,); all True in a task without `legal`.

        Raises:
            SpecError: E713, where the actions are infinite.
        """
        if self._lane.mask is None:
            return all_legal(self.task)
        return self._lane.mask().astype(np.bool_)

    @property
    def P(self) -> GymTable:
        """The table of Gymnasium's toy_text: `P[s][a]` lists (probability, next state, reward, terminated).

        States are those that episodes visit, in the order of the exact model: the numbers that are observed, where the
        observation is one number and all of them are visited. It has the numbers of `taskspec export --format gym-p`.

        Raises:
            AttributeError: where the task has no exact model, or is too large, so that `hasattr` is False.
        """
        return self._gym_table[0]

    @property
    def initial_state_distrib(self) -> Array:
        """The probabilities, float64 (S,), of the states of `P` at the beginning, as toy_text has them."""
        return self._gym_table[1]

    @functools.cached_property
    def _gym_table(self) -> tuple[GymTable, Array]:
        from taskspec.exact.model.model import NoModel
        from taskspec.exact.solve.outcomes import gym_table

        try:
            return gym_table(self.task)
        except NoModel as error:
            raise AttributeError(str(error)) from error

    def get_keys_to_action(self) -> dict[tuple[int, ...], Any]:
        """Choose keys for actions, as `gymnasium.utils.play` wants them.

        Returns:
            actions by the numbers of the characters that are pressed.

        Raises:
            SpecError: E713, where the actions are infinite, or more than there are keys.
        """
        return window.keys_to_action(self.task)

    def __repr__(self) -> str:
        return f"<Environment of {self.task!r}>"

    @property
    def state(self) -> dict[str, Any]:
        """The present state by component: labels for choices, numbers, arrays for vectors.

        Assigning a mapping sets the components that it names.
        """
        if self._seed is None:
            raise NotRunningError("E707: there is no state before the first reset()")
        return plain_state(self.task, self._values())

    @state.setter
    def state(self, value: Mapping[str, Any]) -> None:
        if self._seed is None:
            raise NotRunningError("E707: there is no state to change before the first reset()")
        self._lane.put(flat_state(self.task, value, self._values()), self._clock)

    def _values(self) -> tuple[Any, ...]:
        values, clock = self._lane.get()
        if self._seed is None or not any(v is None for v in values):
            return values
        first = self._program.replay(self._seed, Clock(*clock))
        return tuple(f if v is None else v for v, f in zip(values, first, strict=True))

    @property
    def time(self) -> int:
        """Steps taken in this episode."""
        return self._clock.time

    @property
    def _clock(self) -> Clock:
        return Clock(*self._lane.get()[1])

    def _observe(self, values: tuple[Any, ...]) -> Any:
        layout = self.task.reset_words
        assert self._seed is not None
        words = draws.words(self._seed, draws.RESET, self._clock.episodes - 1, layout.count)
        reads: dict[tuple[Role, str], tuple[Any, ...]] = {TIME: (0,)}
        for c, value in zip(self.task.state, values, strict=True):
            if c.type.shape:
                reads[c.read] = tuple(value)
            else:
                reads[c.read] = (value,)
        flats = evaluate(self.task.observation.nodes, reads, sampler(layout, words))
        return self._program.pack(flats)

    def _restart(self, seed: int) -> None:
        self._seed = seed
        self._start(seed, Clock())

    def _start(self, seed: int, clock: Clock) -> None:
        self._lane: Lane = self._program.start(seed, clock, self._bad_action, self._not_running)
        reset = functools.partial(Environment.reset, self)
        if self.render_mode in ("human", "rgb_array_list"):
            self.__dict__.update(step=self._shown(self._lane.step), reset=self._shown(reset))
            return
        # Attributes of the instance: calling the generated function directly saves a fifth of a step.
        self.__dict__["step"] = self._lane.step
        if self._seed is not None:
            self.__dict__["reset"] = _plain_reset(self._lane.reset, reset)

    def _shown(self, move: Callable[..., Any]) -> Callable[..., Any]:

        def moved(*args: Any, **options: Any) -> Any:
            result = move(*args, **options)
            self._show()
            return result

        return moved

    def _bad_action(self, action: Any) -> ActionError:
        return ActionError(f"E706: {action!r} is not an action of {self.task.id}; it needs {self.action_space}")

    def _not_running(self) -> NotRunningError:
        if self._clock.episodes == 0:
            return NotRunningError("E707: step() before the first reset(); call reset() first")
        return NotRunningError("E708: step() after the end of the episode; call reset() to start another")

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but the window and the generated functions; the stream of draws goes on where it was."""
        remade = ("step", "reset", "_lane", "_program", "_gym_table")
        kept = {k: v for k, v in self.__dict__.items() if k not in remade}
        return {**kept, "_window": None, "lane_state": (self._values(), self._clock)}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        values, clock = saved.pop("lane_state")
        self.__dict__.update(saved)
        self._program = compile_scalar(self.task)
        self._start(self._seed or 0, Clock(*clock))
        if self._seed is not None:
            self._lane.put(values, clock)


def _plain_reset(first: Reset, full: Reset) -> Reset:
    """`reset` that leaves the common case, no seed and no options, to the generated function."""

    def reset(*, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        if seed is None and options is None:
            return first()
        return full(seed=seed, options=options)

    return reset
