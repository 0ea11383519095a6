"""Vector environments: the same trajectories as scalar ones, and Gymnasium's vector interface."""

from itertools import product
from typing import Any, get_args

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import taskspec
from taskspec import SpecError
from taskspec.envs import ActionError, NotRunningError
from taskspec.envs.vector import VectorEnvironment
from taskspec.programs import backend_table
from taskspec.programs.backend_table import BACKENDS, BackendName
from tests.programs.test_trajectories import EVERY, load, name
from tests.shared.conformance import Agreement, check_environment
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file

MODES = ("NextStep", "SameStep", "Disabled")
LANES = (1, 2, 7, 64)


WALKS: list[Any] = []
"""Few lanes and many, in turns."""
for i, task in enumerate(EVERY):
    WALKS += product([task], LANES[i % 2 :: 2], MODES)


@pytest.mark.parametrize(
    ("task", "lanes", "mode"), sparse(WALKS, 7),
    ids=lambda x: name(x) if isinstance(x, tuple) else x,
)  # fmt: skip
def test_numpy_walks_the_scalar_trajectories(task: tuple[str, str | None], lanes: int, mode: str) -> None:
    Agreement(load(task), "numpy", lanes, mode).run(30 if lanes < 10 else 15)


@pytest.mark.parametrize("task", EVERY[::8], ids=name)
def test_numpy_walks_them_in_several_blocks(task: tuple[str, str | None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.programs.numpy.BLOCK", 9)
    for mode in MODES:
        Agreement(load(task), "numpy", 20, mode).run(15)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("backend", ["numba", "jax"])
@pytest.mark.parametrize("task", EVERY, ids=name)
def test_compiled_backends_walk_the_scalar_trajectories(task: tuple[str, str | None], backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    for lanes in LANES:
        Agreement(load(task), backend, lanes, mode).run(60 if lanes < 10 else 25)


QUICK = [
    str(spec_file("key_door")),
    "derail/RiskyPath-v0",
    "derail/NoisyObs-v0",
    "derail/Sort-v0",
    "derail/LargestSum-v0?L=9",  # 18 numbers are more than what is written out
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
    one = VectorEnvironment(task, 5000, backend="numba", num_threads=1)
    other = VectorEnvironment(task, 5000, backend="numba", num_threads=3)
    actions = np.random.default_rng(0).integers(0, 2, (12, 5000))
    one.reset(seed=3)
    other.reset(seed=3)
    for action in actions:
        np.testing.assert_equal(other.step(action), one.step(action))


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


def test_observations_are_in_the_space() -> None:
    for task in EVERY:
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


# -- the kit itself -----------------------------------------------------------------------------------------------


@for_each("task", EVERY)
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
