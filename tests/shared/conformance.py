"""A test kit for environments: what every one of ours must do, to be run on any backend and on any task.

`check_environment` tries a scalar environment against the contract of Gymnasium and ours; `Agreement` walks a vector
environment next to scalar ones, or next to `ReferenceEnv`, which is the reference interpreter behind the same interface. They
raise AssertionError with what is wrong.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import gymnasium
import numpy as np

import taskspec
from taskspec.envs.env import Environment
from taskspec.envs.options import Autoreset, NotRunningError
from taskspec.envs.state import plain_state
from taskspec.language.expressions.ir import plain
from taskspec.language.task.parts import are_finite
from taskspec.language.task.spaces import pack, singles, unpack
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.backend_table import BACKENDS, BackendName
from taskspec.programs.reference import ReferenceProgram


def check_environment(make: Callable[[], gymnasium.Env[Any, Any]], steps: int = 100, seed: int = 0) -> None:
    """Try a scalar environment: order, spaces, plain results, and trajectories that follow from the seed alone.

    Raises:
        AssertionError: says what the environment does wrong.
    """
    one = make()
    other = make()
    _refuses_to_step(one, "before the first reset")
    assert _trajectory(one, steps, seed) == _trajectory(other, steps, seed), "a seed does not fix the trajectory"
    assert _trajectory(one, steps, seed) == _trajectory(other, steps, seed), "a second reset(seed) starts elsewhere"


def _refuses_to_step(env: gymnasium.Env[Any, Any], when: str) -> None:
    try:
        env.step(env.action_space.sample())
    except (NotRunningError, gymnasium.error.ResetNeeded):
        return
    raise AssertionError(f"step() {when} is not refused")


def _trajectory(env: gymnasium.Env[Any, Any], steps: int, seed: int) -> list[Any]:
    """Return what is seen and paid, as comparable data."""
    env.action_space.seed(seed)
    seen, _ = env.reset(seed=seed)
    found = [_plain(seen)]
    for _ in range(steps):
        assert env.observation_space.contains(seen), f"the observation {seen!r} is not in {env.observation_space}"
        seen, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        assert isinstance(reward, float), f"the reward {reward!r} is a {type(reward).__name__}, not a float"
        flags = [type(terminated), type(truncated)]
        assert flags == [bool, bool], f"the flags are {flags}, not bool"
        found.append((_plain(seen), reward, terminated, truncated))
        if terminated or truncated:
            _refuses_to_step(env, "after the end of the episode")
            seen, _ = env.reset()
            found.append(_plain(seen))
    return found


def _plain(seen: Any) -> Any:
    if isinstance(seen, dict):
        return {name: _plain(value) for name, value in seen.items()}
    return np.asarray(seen).tolist()


class ReferenceEnv:
    """One environment of a task, stepped by the reference interpreter: slow, and what all others are compared with."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._observation = task.observation_layout
        self._action = task.action_layout
        self._run = ReferenceProgram(task, 0)

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; with a seed, the stream of draws as well."""
        if seed is not None:
            self._run = ReferenceProgram(self.task, seed)
        return pack(self._observation, self._run.reset()), self._masked({})

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Observation, reward, terminated, truncated, info."""
        states = {"old_state": self._told()}
        seen, reward, terminated, truncated = self._run.step(unpack(self._action, action))
        states["new_state"] = self._told()
        info: dict[str, Any] = {name: states[name] for name in self.task.info}
        if self._run.measures:
            info["measures"] = dict(self._run.measures)
        return pack(self._observation, seen), reward, terminated, truncated, self._masked(info)

    def _masked(self, info: dict[str, Any]) -> dict[str, Any]:
        if self.task.mask:
            info["action_mask"] = np.array(self._run.mask(), np.int8)
        return info

    def _told(self) -> Any:
        """The present state as infos tell it: an int where it is one finite number, else an array."""
        components = self.task.state
        numbers = list(map(plain, chain(*self._run.state)))
        shape = (len(numbers),)
        if len(components) == 1:
            shape = components[0].type.shape
        if not are_finite(components):
            return singles(numbers, shape)
        if not shape:
            return int(numbers[0])
        return np.array(numbers, np.int64).reshape(shape)

    @property
    def state(self) -> Mapping[str, Any]:
        """The present state by component, as `Environment.state` has it."""
        pairs = zip(self.task.state, self._run.state, strict=True)
        return plain_state(self.task, tuple(flat if c.type.shape else flat[0] for c, flat in pairs))


@dataclass
class Agreement:
    """A vector environment next to as many scalar ones: `Agreement(task, "numba", 64, "SameStep").run(100)`.

    `one` makes what it is compared with. With `states`, states are compared as well, in the precision they are kept in.
    """

    task: TaskLike
    backend: BackendName
    lanes: int
    mode: Autoreset
    seed: int = 123
    one: Callable[[Task], Any] = Environment
    states: bool = False

    def __post_init__(self) -> None:
        self.vector = taskspec.make_vec(self.task, num_envs=self.lanes, backend=self.backend, autoreset_mode=self.mode)
        self.scalars = [self.one(taskspec.load(self.task)) for _ in range(self.lanes)]
        self.pending = [False] * self.lanes
        self.tolerance = BACKENDS[self.backend].tolerance

    def run(self, steps: int) -> None:
        """Compare a reset and that many steps with random actions."""
        seen, infos = self.vector.reset(seed=self.seed)
        for i, env in enumerate(self.scalars):
            expected, told = env.reset(seed=self.seed + i)
            self.same(seen, i, expected)
            self.same_infos(infos, i, told)
        self.vector.action_space.seed(5)
        for _ in range(steps):
            self.step(self.vector.action_space.sample())

    def step(self, actions: Any) -> None:
        seen, reward, terminated, truncated, infos = self.vector.step(actions)
        for i, env in enumerate(self.scalars):
            if self.pending[i]:
                expected, told = env.reset()
                self.same(seen, i, expected)
                self.same_infos(infos, i, told)
                assert (reward[i], terminated[i], truncated[i]) == (0, False, False)
                self.pending[i] = False
                continue
            expected, r, *flags, told = env.step(actions[i])
            assert flags == [terminated[i], truncated[i]]
            if self.mode != "SameStep":
                self.same_infos(infos, i, told)
            self.close(reward[i], r)
            if any(flags):
                self.ended(i, seen, expected, infos)
            else:
                self.same(seen, i, expected)
        if self.mode == "Disabled" and (terminated | truncated).any():
            self.reset_some(terminated | truncated)
        for i, env in enumerate(self.scalars if self.states else ()):
            self.same_state(self.vector.state(i), env.state)

    def ended(self, i: int, seen: Any, expected: Any, infos: dict[str, Any]) -> None:
        """What follows the end of an episode depends on the mode."""
        if self.mode != "SameStep":
            self.same(seen, i, expected)
            self.pending[i] = self.mode == "NextStep"
            return
        assert infos["_final_obs"][i]
        assert infos["_final_info"][i]
        final = infos["final_obs"]
        if isinstance(expected, dict):
            for name, value in expected.items():
                self.close(final[i][name], value)
        else:
            self.close(final[i], expected)
        expected, told = self.scalars[i].reset()
        self.same(seen, i, expected)
        self.same_infos(infos, i, told)

    def reset_some(self, mask: Any) -> None:
        seen, _ = self.vector.reset(options={"reset_mask": mask})
        for i in np.flatnonzero(mask).tolist():
            self.same(seen, i, self.scalars[i].reset()[0])

    def same(self, seen: Any, lane: int, expected: Any) -> None:
        if isinstance(expected, dict):
            for name, value in expected.items():
                self.close(seen[name][lane], value)
        else:
            self.close(seen[lane], expected)

    def same_infos(self, infos: Mapping[str, Any], lane: int, expected: Mapping[str, Any]) -> None:
        """Masks, measures and states of a lane are those of one environment."""
        for name, value in expected.items():
            assert infos[f"_{name}"][lane]
            if name == "measures":
                self.same_infos(infos[name], lane, value)
            else:
                self.close(infos[name][lane], value)

    def same_state(self, actual: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
        for name, value in expected.items():
            self.close(actual[name], value)

    def close(self, actual: Any, expected: Any) -> None:
        """Whole numbers are equal; reals are equal up to the tolerance of the backend, and zeros have the same sign."""
        a = np.asarray(actual)
        e = np.asarray(expected)
        assert a.shape == e.shape
        if a.dtype.kind != "f":
            assert np.array_equal(a, e)
            return
        tolerance = max(self.tolerance, 1e-6 if a.dtype == np.float32 else 0)
        np.testing.assert_allclose(a, e, rtol=tolerance, atol=tolerance)
        zeros = (a == 0) & (e == 0)
        assert np.array_equal(np.signbit(a[zeros]), np.signbit(e[zeros]))
