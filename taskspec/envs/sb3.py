"""Tasks and experts for Stable-Baselines3: a `VecEnv` over a task's vector program, and a policy.

The `VecEnv` needs no vector interface of Gymnasium's.

SB3 resets an environment within the step that ends its episode, and wants in its info the last observation and whether
the episode was cut short without a terminal state: exactly when both flags are set, the terminal state wins.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import map_parts, part_at
from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import need
from taskspec.envs.options import ActionError, NotRunningError, positive, seed_of, uncopied
from taskspec.envs.state import RENDER_MODES, LaneView, lane_render_mode, refuse_to_set
from taskspec.envs.window import Frames
from taskspec.exact.policies.experts import Expert
from taskspec.language import draws
from taskspec.language.registry import load
from taskspec.language.task.parts import RenderMode
from taskspec.language.task.spaces import space
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs import backend_table
from taskspec.programs.backend_table import BackendName
from taskspec.programs.vector_program import BadActionError, LanesNotRunningError, Options

need("stable_baselines3", "sb3")
from stable_baselines3.common.policies import BasePolicy  # noqa: E402  # after the message about its absence
from stable_baselines3.common.vec_env import VecEnv  # noqa: E402

__all__ = ["Sb3Expert", "Sb3VecEnv"]


class Sb3VecEnv(VecEnv):
    """Environments of one task for Stable-Baselines3.

    Args:
        task: the task, its id or its path.
        num_envs: how many.
        seed: lane i draws from seed + i.
        backend, num_threads, render_mode: as for `taskspec.envs.vector.VectorEnvironment`; SB3 tiles the pictures of lanes.
    """

    def __init__(
        self, task: TaskLike, num_envs: int, *, seed: int = 0, backend: BackendName = "auto", num_threads: int = 1,
        render_mode: RenderMode | None = None,
    ) -> None:  # fmt: skip
        self.task: Task = load(task)
        num_envs = positive("num_envs", num_envs)
        num_threads = positive("num_threads", num_threads)
        self._engine = backend_table.engine(self.task, num_envs, backend, Options("same_step", num_threads))
        self.metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 4}
        self.render_mode: str | None = lane_render_mode(render_mode)
        self._started = False
        self._drawings: defaultdict[int, Frames] = defaultdict(Frames)
        super().__init__(num_envs, space(self._engine.observation), space(self._engine.action))
        self._first_seed: int | None = seed_of(seed)
        self._actions: Any = None

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Lane i draws from seed + i from the next reset on; without a seed, streams go on."""
        if seed is None:
            self._first_seed = None
        else:
            self._first_seed = seed_of(seed)
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def reset(self) -> Any:
        if self._first_seed is not None:
            self._engine.seed(draws.lane_seeds(self._first_seed, self.num_envs))
            self._first_seed = None
        self._engine.reset()
        self._started = True
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._seen()

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Return observations, float32 rewards, dones, and an info for every lane."""
        try:
            ended = self._engine.step(self._actions)
        except BadActionError:
            raise ActionError(f"E706: {self._actions!r} are not actions of {self.task.id}") from None
        except LanesNotRunningError:
            raise NotRunningError("E707: step() before the first reset(); call reset() first") from None
        b = self._engine.buffers
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if b.measures:
            for lane, info in enumerate(infos):
                values = (float(value[lane]) for value in b.measures)
                info["measures"] = dict(zip(self.task.process.measures, values, strict=True))
        if ended:
            final = b.final.view(copy=True)
            for lane in np.flatnonzero(b.ended).tolist():
                infos[lane]["terminal_observation"] = map_parts(np.asarray, part_at(final, lane))
                infos[lane]["TimeLimit.truncated"] = bool(b.truncated[lane] and not b.terminated[lane])
        return self._seen(), b.reward.astype(np.float32), b.ended.copy(), infos

    def _seen(self) -> Any:
        return self._engine.buffers.seen.view(copy=True)

    def close(self) -> None:
        """Nothing to close."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        uncopied(self)

    def get_images(self) -> Sequence[Any]:
        """Return the picture of every lane; None without `render_mode="rgb_array"`."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        return self.env_method("render")

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of lanes ("state", "time", "task", ...).

        Raises:
            LaneError: lanes have nothing of that name.
        """
        return self.env_method(attr_name, indices=indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the lanes are one task, and have no attributes of their own."""
        refuse_to_set(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Return what a method of lanes gives ("render", "get_keys_to_action").

        Raises:
            LaneError: lanes have nothing of that name.
        """
        answers = []
        for i in self._get_indices(indices):
            lane = LaneView(self.task, self._engine, i, self.render_mode, self._started, self._drawings[i])
            answers.append(lane.ask(method_name, *args, **kwargs))
        return answers

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * len(list(self._get_indices(indices)))


class Sb3Expert(BasePolicy):
    """An expert as a policy of Stable-Baselines3, which DAgger of imitation wants; `rollout` takes `Expert` itself as well.

    Args:
        task, policy, seed: as for `taskspec.exact.Expert`.

    Raises:
        SpecError: E712, where the spec gives no expert, or it looks at what is not observed; E713 for another policy.
    """

    def __init__(self, task: TaskLike, policy: str | None = None, *, seed: int = 0) -> None:
        expert = Expert(task, policy, seed=seed)
        super().__init__(expert.observation_space, expert.action_space)
        self.expert = expert

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Return actions for one observation or a batch of them, and the steps taken so far, as `Expert.predict` gives
        them.
        """
        return self.expert.predict(observation, state, episode_start, deterministic)

    def _predict(self, observation: Any, deterministic: bool = False) -> Any:
        """Refused (E713): the steps taken so far go through `predict` alone."""
        raise spec_error("E713", "an expert is asked with `predict`, which is told how many steps were taken")
