"""Vector environments: the same trajectories as scalar ones, and Gymnasium's vector interface."""

from pathlib import Path
from typing import get_args

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import taskspec
from taskspec import SpecError
from taskspec.envs import ActionError, NotRunningError
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.source import read_file
from taskspec.language.task.merge import complete
from taskspec.language.task.task import Task
from taskspec.programs import backend_table
from taskspec.programs.backend_table import BACKENDS, BackendName
from tests.shared.conformance import Agreement, check_environment
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file, varied_files

MODES = ("NextStep", "SameStep", "Disabled")
LANES = (1, 2, 7, 64)


def every_task() -> list[tuple[str, str | None]]:
    """All tasks of DERAIL by id, and varied ones by path and variant."""
    shipped = [(task_id, None) for task_id in taskspec.task_ids() if task_id.startswith("derail/")]
    return shipped + [(str(p), v) for p in varied_files() for v in complete(read_file(p))]


def name_of(task: tuple[str, str | None]) -> str:
    return Path(task[0]).stem + (f"-{task[1]}" if task[1] else "")


def load(task: tuple[str, str | None]) -> Task:
    return taskspec.load(task[0]) if task[1] is None else taskspec.load(task[0], task[1])


TASKS = every_task()
WALKS = [(task, lanes) for i, task in enumerate(TASKS) for lanes in LANES[i % 2 :: 2]]
"""Few lanes and many, in turns."""


@pytest.mark.parametrize(
    ("task", "lanes", "mode"), sparse([(*walk, mode) for walk in WALKS for mode in MODES], 7),
    ids=lambda x: name_of(x) if isinstance(x, tuple) else x,
)  # fmt: skip
def test_numpy_walks_the_scalar_trajectories(task: tuple[str, str | None], lanes: int, mode: str) -> None:
    Agreement(load(task), "numpy", lanes, mode).run(30 if lanes < 10 else 15)


@pytest.mark.parametrize("task", TASKS[::8], ids=name_of)
def test_numpy_walks_them_in_several_blocks(task: tuple[str, str | None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.programs.numpy.BLOCK", 9)
    for mode in MODES:
        Agreement(load(task), "numpy", 20, mode).run(15)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("backend", ["numba", "jax"])
@pytest.mark.parametrize("task", TASKS, ids=name_of)
def test_compiled_backends_walk_the_scalar_trajectories(task: tuple[str, str | None], backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    for lanes in LANES:
        Agreement(load(task), backend, lanes, mode).run(60 if lanes < 10 else 25)


QUICK = [
    str(spec_file("key_door")),
    "derail/RiskyPath-v0",
    "derail/NoisyObs-v0",
    "derail/Sort-v0",
    "derail/LargestSum-v0",
]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("backend", ["numba", "jax"])
@pytest.mark.parametrize("task", sparse(QUICK, 4))
@pytest.mark.parametrize("lanes", [7, pytest.param(1200, marks=pytest.mark.slow, id="more-than-a-block")])
def test_compiled_backends_on_some_tasks(lanes: int, task: str, backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    Agreement(taskspec.load(task), backend, lanes, mode).run(25)


@pytest.mark.parametrize("options", [{"ending": "absorb"}, {"observe_time": True}])
def test_ending_and_time_are_options_here_too(options: dict[str, object]) -> None:
    task = taskspec.load("derail/EarlyTermPos-v0")
    env = VectorEnvironment(task, 3, backend="numpy", autoreset_mode="SameStep", **options)
    scalar = taskspec.make("derail/EarlyTermPos-v0", **options)
    seen, _ = env.reset(seed=4)
    assert np.array_equal(seen[0], scalar.reset(seed=4)[0])
    for _ in range(5):
        seen, *_ = env.step(np.ones(3, np.int64))
        expected, _, terminated, truncated, _ = scalar.step(1)
        if terminated or truncated:
            expected, _ = scalar.reset()
        assert np.array_equal(seen[0], expected)


def test_blocks_of_lanes_make_no_difference() -> None:
    task = taskspec.load("derail/NoisyObs-v0")
    large = VectorEnvironment(task, 40_000, backend="numpy", autoreset_mode="SameStep")
    small = VectorEnvironment(task, 5, backend="numpy", autoreset_mode="SameStep")
    first, _ = large.reset(seed=1)
    last, _ = small.reset(seed=1 + 39_995)
    assert np.array_equal(first[-5:], last)
    for _ in range(20):
        assert np.array_equal(large.step(np.zeros(40_000, int))[0][-5:], small.step(np.zeros(5, int))[0])


def test_threads_make_no_difference() -> None:
    pytest.importorskip("numba")
    task = taskspec.load("derail/RiskyPath-v0")
    envs = [VectorEnvironment(task, 5000, backend="numba", num_threads=n) for n in (1, 3)]
    actions = np.random.default_rng(0).integers(0, 2, (12, 5000))
    for env in envs:
        env.reset(seed=3)
    for action in actions:
        one, other = (env.step(action) for env in envs)
        assert all(np.array_equal(a, b) for a, b in zip(one[:4], other[:4], strict=True))


# -- Gymnasium's interface ----------------------------------------------------------------------------------------


def test_make_vec_uses_it() -> None:
    env = gym.make_vec("derail/NoisyObs-v0", num_envs=7, L=50, backend="numpy")
    assert isinstance(env.unwrapped, VectorEnvironment)
    seen, infos = env.reset(seed=0)
    assert seen.shape == (7, 52)
    assert infos == {}
    assert seen in env.observation_space
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


@pytest.mark.parametrize("mode", AutoresetMode)
def test_the_way_of_autoreset_is_an_attribute_as_in_gymnasium(mode: AutoresetMode) -> None:
    """TorchRL reads it."""
    fast = gym.make_vec("derail/RiskyPath-v0", num_envs=2, backend="numpy", autoreset_mode=mode.value)
    slow = gym.vector.SyncVectorEnv([lambda: taskspec.make("derail/RiskyPath")] * 2, autoreset_mode=mode)
    for env in (fast, slow):
        assert env.unwrapped.autoreset_mode is mode


def test_a_sync_vector_env_walks_the_same_trajectory() -> None:
    fast = gym.make_vec("derail/ProcGoal-v0", num_envs=4, backend="numpy")
    slow = gym.make_vec("derail/ProcGoal-v0", num_envs=4, vectorization_mode="sync")
    for env in (fast, slow):
        env.action_space.seed(1)
    assert np.array_equal(fast.reset(seed=9)[0], slow.reset(seed=9)[0])
    for _ in range(70):
        action = slow.action_space.sample()
        ours = fast.step(action)
        theirs = slow.step(action)
        assert all(np.array_equal(a, b) for a, b in zip(ours[:4], theirs[:4], strict=True))


def test_observations_are_in_the_space() -> None:
    for task in (t for t in TASKS if "/" in t[0]):
        env = VectorEnvironment(load(task), 3, backend="numpy")
        seen, _ = env.reset(seed=0)
        assert env.observation_space.contains(seen)
        assert env.observation_space.contains(env.step(env.action_space.sample())[0])


def test_seeds_for_each_lane() -> None:
    env = VectorEnvironment(taskspec.load("derail/LargestSum-v0"), 3, backend="numpy")
    a, _ = env.reset(seed=[7, 7, 9])
    assert np.array_equal(a[0], a[1])
    assert not np.array_equal(a[0], a[2])
    b, _ = env.reset(seed=[None, 7, None])
    assert np.array_equal(b[1], a[1])
    assert not np.array_equal(b[0], a[0])
    c, _ = env.reset(seed=2**64 - 1)  # lane 1 has seed 0
    d, _ = env.reset(seed=0)
    assert np.array_equal(c[1], d[0])


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_arrays_are_fresh_unless_reused(backend: str) -> None:
    task = taskspec.load("derail/NoisyObs-v0")
    for reuse in (False, True):
        env = VectorEnvironment(task, 4, backend=backend, reuse=reuse)
        first, _ = env.reset(seed=0)
        second, reward, *_ = env.step(np.zeros(4, np.int64))
        third, again, *_ = env.step(np.zeros(4, np.int64))
        assert (first is second) == reuse
        assert (second is third) == reuse
        assert (reward is again) == reuse


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize(
    ("task", "actions"),
    [
        ("derail/RiskyPath-v0", np.array([0, 2, 0])),
        ("derail/RiskyPath-v0", np.array([0, -1, 0])),
        ("derail/RiskyPath-v0", np.array([0, 0])),
        ("derail/RiskyPath-v0", np.array([0.0, 1.0, 0.0])),
        ("derail/Sort-v0", np.array([[0, 0], [0, 4], [0, 0]])),
        ("derail/Parabola-v0", np.array([[0.0], [1.5], [0.0]], np.float32)),
        ("derail/Parabola-v0", np.array([[0.0], [np.nan], [0.0]], np.float32)),
    ],
)
def test_actions_outside_the_space_change_nothing(backend: str, task: str, actions: np.ndarray) -> None:
    env = VectorEnvironment(taskspec.load(task), 3, backend=backend)
    env.reset(seed=0)
    with pytest.raises(ActionError, match="E706"):
        env.step(actions)
    assert env.time.tolist() == [0, 0, 0]


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_order_is_enforced(backend: str) -> None:
    env = VectorEnvironment(taskspec.load("derail/LargestSum-v0"), 2, backend=backend, autoreset_mode="Disabled")
    with pytest.raises(NotRunningError, match="E707"):
        env.step(np.zeros(2, np.int64))
    env.reset(seed=0)
    env.step(np.zeros(2, np.int64))
    with pytest.raises(NotRunningError, match="E708"):
        env.step(np.zeros(2, np.int64))
    env.reset(options={"reset_mask": np.array([True, True])})
    env.step(np.zeros(2, np.int64))


def test_masks_are_checked() -> None:
    env = VectorEnvironment(taskspec.load("derail/Sort-v0"), 2, backend="numpy")
    with pytest.raises(NotRunningError, match="E707"):
        env.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.array([1, 0])})


def test_a_missing_backend_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    task = taskspec.load("derail/Sort-v0")
    monkeypatch.setattr(backend_table, "is_installed", lambda name: False)
    assert backend_table.choose(task, "auto") == "numpy"
    with pytest.raises(SpecError, match=r"\[numba\]"):
        backend_table.choose(task, "numba")
    with pytest.raises(SpecError, match="there is no backend"):
        backend_table.choose(task, "numby")


def test_the_type_of_names_of_backends_is_that_of_the_table() -> None:
    assert get_args(BackendName) == ("auto", *BACKENDS)


def test_states_can_be_read() -> None:
    env = VectorEnvironment(taskspec.load("derail/RiskyPath-v0"), 2, backend="numpy")
    env.reset(seed=0)
    assert env.state(1) == taskspec_state(0)


def taskspec_state(seed: int) -> dict[str, object]:
    env = taskspec.make("derail/RiskyPath-v0")
    env.reset(seed=seed)
    return dict(env.unwrapped.state)


# -- the kit itself -----------------------------------------------------------------------------------------------


@for_each("task", TASKS)
def test_scalar_environments_conform(task: tuple[str, str | None]) -> None:
    check_environment(lambda: taskspec.make(load(task)))


class Unseeded(gym.Wrapper):
    """Broken: ignores the seed."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[object, dict[str, object]]:
        return super().reset(options=options)


class Integral(gym.Wrapper):
    """Broken: pays in whole numbers."""

    def step(self, action: object) -> tuple[object, int, bool, bool, dict[str, object]]:  # type: ignore[override]
        seen, reward, *flags, info = self.env.step(action)
        return seen, int(reward), *flags, info


class Careless(gym.Wrapper):
    """Broken: steps without a reset."""

    def step(self, action: object) -> tuple[object, float, bool, bool, dict[str, object]]:  # type: ignore[override]
        try:
            return self.env.step(action)
        except NotRunningError:
            return 0, 0.0, False, False, {}


@pytest.mark.parametrize(("broken", "says"), [(Unseeded, "seed"), (Integral, "not a float"), (Careless, "not refused")])
def test_the_kit_notices_what_is_broken(broken: type[gym.Wrapper], says: str) -> None:
    with pytest.raises(AssertionError, match=says):
        check_environment(lambda: broken(taskspec.make("derail/Sort-v0")))
