"""Many environments of a task behind Gymnasium's vector interface."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium
import gymnasium.vector
import numpy as np
from gymnasium.vector.utils import batch_space

from taskspec.base.arrays import Array, part_at
from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import install_package
from taskspec.envs.env import Environment
from taskspec.envs.options import (
    ENDINGS,
    ActionError,
    Autoreset,
    HasSpec,
    NotRunningError,
    invalid,
    lanes_of,
    one_of,
    positive,
    reset_option,
    seed_of,
    uncopied,
)
from taskspec.envs.state import (
    RENDER_MODES,
    LaneView,
    lane_render_mode,
    masked,
    refuse_to_set,
    state_rows,
    states,
)
from taskspec.envs.window import Frames
from taskspec.language import draws
from taskspec.language.modifiers import with_options
from taskspec.language.registry import load
from taskspec.language.task.parts import Ending, RenderMode
from taskspec.language.task.spaces import space
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs import backend_table
from taskspec.programs.backend_table import BackendName
from taskspec.programs.vector_program import BadActionError, LanesNotRunningError, Masks, Mode, Options

__all__ = ["VectorEnvironment"]


if not hasattr(gymnasium.vector, "AutoresetMode"):
    raise spec_error(
        "E705",
        f"vector environments need Gymnasium 1.1 or later; this is {gymnasium.__version__}",
        f"{install_package('gymnasium>=1.1')}, or use taskspec.envs.sb3, or SyncVectorEnv over taskspec.make",
    )
AutoresetMode = gymnasium.vector.AutoresetMode
_MODES: dict[str, Mode] = {"NextStep": "next_step", "SameStep": "same_step", "Disabled": "disabled"}


class VectorEnvironment(HasSpec, gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Environments of one task, stepped together.

    Args:
        task: the task, its id or its path.
        num_envs: how many.
        backend: "numpy", "numba", "jax", or "auto": Numba where it is installed, else NumPy.
        autoreset_mode: Gymnasium's `AutoresetMode` or its value. A lane whose episode has ended is reset with the next
            step, which is spent on it ("NextStep", Gymnasium's default); within the step that ended it, with
            `infos["final_obs"]` and `infos["final_info"]` as Gymnasium's own vector environments have them ("SameStep");
            or when
            `reset(options={"reset_mask": ...})` says so ("Disabled").
        reuse: whether the arrays that `reset` and `step` return are the same ones every time, written over by the
            next call. Faster, and for callers who copy what they keep. `infos["final_obs"]` is a batch of observations
            then, and its rows of other lanes mean nothing.
        num_threads: threads of the Numba backend.
        ending, observe_time: as for `taskspec.envs.Environment`.
        render_mode: None; "ansi" or "rgb_array" for `render`, which gives one text or picture for each lane.

    Raises:
        SpecError: E705, when the backend's package is not installed; E713, for an option with another value.
    """

    def __init__(
        self, task: TaskLike, num_envs: int = 1, *, backend: BackendName = "auto",
        autoreset_mode: AutoresetMode | Autoreset = AutoresetMode.NEXT_STEP, reuse: bool = False,
        num_threads: int = 1, ending: Ending = "terminate", observe_time: bool = False,
        render_mode: RenderMode | None = None,
    ) -> None:  # fmt: skip
        num_envs = positive("num_envs", num_envs)
        num_threads = positive("num_threads", num_threads)
        one_of("ending", ending, ENDINGS)
        if not isinstance(autoreset_mode, AutoresetMode):
            one_of("autoreset_mode", autoreset_mode, _MODES)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.task: Task = with_options(load(task), ending, observe_time)
        self.num_envs: int = lanes_of(self.task, num_envs)
        self.backend: str = backend_table.choose(self.task, backend)
        self.metadata: dict[str, Any] = {
            "render_modes": list(RENDER_MODES),
            "render_fps": 4,
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode: str | None = lane_render_mode(render_mode)
        options = Options(_MODES[self.autoreset_mode.value], num_threads)
        self._engine = backend_table.engine(self.task, self.num_envs, self.backend, options)
        self._same_step = self.autoreset_mode == AutoresetMode.SAME_STEP
        self._has_infos = bool(self.task.info) and not self._same_step
        self._has_measures = bool(self.task.process.measures)
        self._reuse = reuse
        self._seeded = False
        self._drawings: defaultdict[int, Frames] = defaultdict(Frames)
        self.single_observation_space: gymnasium.Space[Any] = space(self._engine.observation)
        self.single_action_space: gymnasium.Space[Any] = space(self._engine.action)
        self.observation_space: gymnasium.Space[Any] = batch_space(self.single_observation_space, self.num_envs)
        self.action_space: gymnasium.Space[Any] = batch_space(self.single_action_space, self.num_envs)
        b = self._engine.buffers
        self._seen = b.seen.view()
        self._masks: Masks | None = None
        if self.task.mask:
            self._masks = Masks(self.task, b.state)
        self._results = (b.reward, b.terminated, b.truncated)
        if isinstance(self._seen, dict):
            self._last = None
        else:
            self._last = b.final.view()

    @property
    def source(self) -> str:
        """The generated code that steps the environments."""
        return self._engine.source

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays that hold state, counters and results."""
        return sum(array.nbytes for array in self._engine.buffers.arrays())

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every lane, or in those of `options["reset_mask"]` (bool, one for each lane).

        Args:
            seed: lane i gets seed + i; or one seed for each lane, None for a lane whose stream is to go on. Without a
                seed all streams go on; the first time, they start from a random one.
            options: `{"reset_mask": array}`.

        Returns:
            observations, one for each lane along the first axis, and infos, with "action_mask" where the task has `legal`.
        """
        mask = reset_option(options, "reset_mask")
        lanes = None
        if mask is not None:
            if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
                raise invalid(f"reset_mask must be a bool array of shape ({self.num_envs},), not {mask!r}")
            if not self._seeded and not mask.all():
                raise NotRunningError("E707: the first reset() is one of all lanes, without a mask")
            lanes = np.flatnonzero(mask)
        self._seed_streams(seed, lanes)
        self._engine.reset(lanes)
        return self._observation(), self._legal()

    def step(self, actions: Any) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        """Take a step in every lane.

        Args:
            actions: one for each lane along the first axis, as in `action_space`.

        Returns:
            observations, rewards float64 (num_envs,), terminated and truncated bool (num_envs,), and infos.

        Raises:
            ActionError: the actions are not in the batched action space.
            NotRunningError: before the first reset; without autoreset, where an episode is over.
        """
        before = None
        if self._has_infos:  # the states that a step leaves, and in which lanes one will be taken, instead of a reset
            before = (state_rows(self.task, self._engine.buffers.state), ~self._engine.buffers.ended)
        stepped = None
        if self._has_measures:
            stepped = ~self._engine.buffers.ended | self._same_step
        try:
            ended = self._engine.step(actions)
        except BadActionError:
            message = f"E706: {actions!r} are not actions of {self.task.id}; it needs {self.action_space}"
            raise ActionError(message) from None
        except LanesNotRunningError:
            raise self._not_running() from None
        infos = {}
        if ended and self._same_step:
            infos = self._final()
        if before is not None:
            infos = states(self.task, *before, state_rows(self.task, self._engine.buffers.state))
        if stepped is not None:
            infos |= self._measured(stepped)
        if self._masks is not None:
            infos |= self._legal()
        if self._reuse:
            return (self._seen, *self._results, infos)
        reward, terminated, truncated = self._results
        return self._observation(), reward.copy(), terminated.copy(), truncated.copy(), infos

    def render(self) -> tuple[Any, ...] | None:
        """Show the present state of every lane.

        Returns:
            a text or pixels, uint8 (480, 640, 3), of each lane; None without a render mode.
        """
        if self.render_mode is None:
            return None
        return self.call("render")

    def call(self, name: str, *args: Any, **options: Any) -> tuple[Any, ...]:
        """Read an attribute of every lane, or call a method of it.

        Args:
            name: of the attribute ("state", "time", "task", ...) or the method ("render", ...).
            args, options: of the method.

        Returns:
            the value or the result of each lane.

        Raises:
            LaneError: lanes have nothing of that name.
        """
        return tuple(self._lane(i).ask(name, *args, **options) for i in range(self.num_envs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of every lane; see `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Refused: the lanes are one task, and have no attributes of their own.

        Raises:
            LaneError: always.
        """
        refuse_to_set(name)

    def _lane(self, number: int) -> LaneView:
        return LaneView(self.task, self._engine, number, self.render_mode, self._seeded, self._drawings[number])

    def __reduce_ex__(self, protocol: Any) -> Any:
        uncopied(self)

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing to close."""

    def _observation(self) -> Any:
        if self._reuse:
            return self._seen
        return self._engine.buffers.seen.view(copy=True)

    def _final(self) -> dict[str, Any]:
        b = self._engine.buffers
        if self._reuse and self._last is not None:
            return {"final_obs": self._last, "_final_obs": b.ended, "final_info": {}, "_final_info": b.ended}
        final = b.final.view(copy=True)
        rows = np.full(self.num_envs, None, dtype=object)  # as Gymnasium's own environments give them
        for lane in np.flatnonzero(b.ended).tolist():
            rows[lane] = part_at(final, lane)
        return {"final_obs": rows, "_final_obs": b.ended.copy(), "final_info": {}, "_final_info": b.ended.copy()}

    def _legal(self) -> dict[str, Any]:
        if self._masks is None:
            return {}
        return {"action_mask": self._masks(), "_action_mask": np.ones(self.num_envs, np.bool_)}

    def _measured(self, stepped: Array) -> dict[str, Any]:
        b = self._engine.buffers
        values = dict(zip(self.task.process.measures, b.measures, strict=True))
        if not self._same_step:
            return masked(values, stepped)
        infos = masked(values, ~b.ended)
        if b.ended.any():
            infos["final_info"] = masked(values, b.ended)
        return infos

    def _seed_streams(self, seed: int | Sequence[int | None] | None, lanes: Array | None) -> None:
        if not self._seeded:
            self._engine.seed(draws.lane_seeds(int.from_bytes(os.urandom(8), "little"), self.num_envs))
        if seed is None:
            pass
        elif not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str | bytes):
            seeds = draws.lane_seeds(seed_of(seed), self.num_envs)
            if lanes is not None:
                seeds = seeds[lanes]
            self._engine.seed(seeds, lanes)
        else:
            self._seed_each(list(seed), lanes)
        self._seeded = True

    def _seed_each(self, seeds: list[int | None], lanes: Array | None) -> None:
        if len(seeds) != self.num_envs:
            raise invalid(f"{len(seeds)} seeds for {self.num_envs} lanes")
        if lanes is None:
            lanes = np.arange(self.num_envs)
        given = {}
        for lane in sorted(lanes.tolist()):
            seed = seeds[lane]
            if seed is not None:
                given[lane] = seed_of(seed)
        if len(given) == self.num_envs:
            self._engine.seed(np.array(list(given.values()), np.uint64))
        elif given:
            self._engine.seed(np.array(list(given.values()), np.uint64), np.array(list(given)))

    @property
    def time(self) -> Array:
        """Steps taken in the present episode of every lane: int64 (num_envs,)."""
        return self._engine.buffers.time.copy()

    def state(self, lane: int) -> Mapping[str, Any]:
        """Read the present state of a lane.

        Args:
            lane: its number, from 0.

        Returns:
            values by component: labels for choices, numbers, arrays for vectors.
        """
        return self._lane(lane).state

    def _not_running(self) -> NotRunningError:
        if not self._seeded:
            return NotRunningError("E707: step() before the first reset(); call reset() first")
        lanes = np.flatnonzero(self._engine.buffers.ended)[:8].tolist()
        return NotRunningError(
            f"E708: the episodes of lanes {lanes} are over; call reset(options={{'reset_mask': ...}}) first"
        )


class InstanceLanes(gymnasium.vector.SyncVectorEnv):
    """Scalar environments of several instances of one task, one after the other; `task` belongs to the first.

    Args:
        tasks: the instances, lane by lane.
        autoreset_mode: as for `VectorEnvironment`.
        options: of `taskspec.envs.Environment`.

    Raises:
        SpecError: E713, where the instances have different spaces.
    """

    def __init__(self, tasks: Sequence[Task], autoreset_mode: AutoresetMode | Autoreset, **options: Any) -> None:
        self.task: Task = tasks[0]
        if not isinstance(autoreset_mode, AutoresetMode):
            one_of("autoreset_mode", autoreset_mode, _MODES)
        for task in tasks:
            for layout in ("observation_layout", "action_layout"):
                ours = space(getattr(self.task, layout))
                theirs = space(getattr(task, layout))
                if ours != theirs:
                    message = f"the instances have different spaces: {ours} and {theirs}"
                    raise invalid(f"{message}; declare bounds that hold for all")
        makers = [partial(Environment, task, **options) for task in tasks]
        super().__init__(makers, autoreset_mode=AutoresetMode(autoreset_mode))
