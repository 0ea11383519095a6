"""Vector environments beside Gymnasium's own over scalar ones: results, infos key by key, frames and attributes."""

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import taskspec
from taskspec.envs.options import LaneError
from taskspec.envs.vector import VectorEnvironment

LANES = 3
TASKS = ["derail/EarlyTermPos-v0", "derail/Sort-v0", "derail/NoisyObs-v0", "derail/Parabola-v0", "derail/ProcGoal-v0"]


def same(ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys()
        for key in theirs:
            same(ours[key], theirs[key])
    elif isinstance(theirs, np.ndarray) and theirs.dtype == object:
        assert ours.dtype == object and ours.shape == theirs.shape
        for a, b in zip(ours, theirs, strict=True):
            same(a, b)
    elif isinstance(theirs, tuple):
        for a, b in zip(ours, theirs, strict=True):
            same(a, b)
    elif theirs is None:
        assert ours is None
    else:
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-12)


def pair(task_id: str, mode: AutoresetMode) -> tuple[VectorEnvironment, SyncVectorEnv]:
    """Ours and Gymnasium's own, after a reset, with actions to draw."""
    ours = taskspec.make_vec(task_id, num_envs=LANES, backend="numpy", autoreset_mode=mode)
    theirs = SyncVectorEnv([partial(taskspec.make, task_id)] * LANES, autoreset_mode=mode)
    ours.action_space.seed(1)
    same(ours.reset(seed=5), theirs.reset(seed=5))
    return ours, theirs


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
@pytest.mark.parametrize(
    "task_id", ["derail/RiskyPathSeals", "derail/NoisyObsSeals", "derail/ParabolaSeals", "derail/SortSeals"]
)
def test_infos_tell_states_as_gymnasiums_own_do(task_id: str, mode: AutoresetMode) -> None:
    ours, theirs = pair(task_id, mode)
    told = 0
    for _ in range(30):
        if mode == AutoresetMode.DISABLED and ours.time.max() >= (ours.task.horizon or 0):
            mask = {"reset_mask": np.ones(LANES, np.bool_)}
            same(ours.reset(options=mask), theirs.reset(options=dict(mask)))
        actions = ours.action_space.sample()
        found = ours.step(actions)
        wanted = theirs.step(actions)
        same(found[0], wanted[0])
        same(found[4], wanted[4])
        for key, value in wanted[4].items():
            assert found[4][key].dtype == value.dtype
        told += found[4]["_new_state"].sum() if found[4] else 0
    assert told >= 20 * LANES


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("task_id", TASKS)
def test_results_and_infos_are_those_of_gymnasiums_own(task_id: str, mode: AutoresetMode) -> None:
    ours, theirs = pair(task_id, mode)
    ends = 0
    for _ in range(40):
        actions = ours.action_space.sample()
        found = ours.step(actions)
        wanted = theirs.step(actions)
        for a, b in zip(found, wanted, strict=True):
            same(a, b)
        over = found[2] | found[3]
        ends += int(over.sum())
        if mode is AutoresetMode.DISABLED and over.any():
            same(ours.reset(options={"reset_mask": over})[0], theirs.reset(options={"reset_mask": over})[0])
    assert ends > 0


def test_lanes_have_no_attributes_of_their_own() -> None:
    env = VectorEnvironment("RiskyPath", 2, backend="numpy")
    env.reset(seed=0)
    with pytest.raises(LaneError, match=r"E713.*one task"):
        env.set_attr("state", [{"s": "goal"}] * 2)
    with pytest.raises(LaneError, match=r"E713.*no 'gravity'; it has task, state"):
        env.get_attr("gravity")


def test_the_spec_tells_the_horizon_and_makes_the_same_again() -> None:
    env = gym.make_vec("derail/Branching-v0", num_envs=2, L=4)
    assert env.spec is not None and env.spec.max_episode_steps == 4
    again = gym.make_vec(env.spec)
    same(env.reset(seed=0), again.reset(seed=0))
    with pytest.raises(taskspec.SpecError, match=r"E713.*have 7 steps, not 4"):
        gym.make_vec(env.spec, L=7)
    with pytest.raises(taskspec.SpecError, match=r"E713.*have 4 steps, not 7"):
        gym.make_vec("derail/Branching-v0", num_envs=2, L=4, max_episode_steps=7)


def test_stable_baselines3_renders_and_asks_lanes() -> None:
    pytest.importorskip("stable_baselines3")
    from taskspec.envs.sb3 import Sb3VecEnv

    env = Sb3VecEnv("RiskyPath", 4, backend="numpy", render_mode="rgb_array")
    env.reset()
    env.step(np.array([0, 1, 0, 1]))
    alone = taskspec.make("RiskyPath", render_mode="rgb_array")
    alone.reset(seed=1)
    alone.step(1)
    assert np.array_equal(env.get_images()[1], alone.render())
    assert env.render().shape == (960, 1280, 3)
    assert env.env_method("render", indices=[1])[0].shape == (480, 640, 3)
    assert env.get_attr("state", indices=1) == [alone.state]
    assert env.has_attr("time") and env.has_attr("action_masks") and not env.has_attr("taught")
    with pytest.raises(LaneError, match="E713"):
        env.set_attr("state", {})
