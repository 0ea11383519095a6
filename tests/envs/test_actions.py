"""An action that is one number: the space that learners expect, the forms in which it is taken, and every backend."""

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import taskspec
from taskspec.envs import ActionError
from taskspec.language.task.task import Task
from tests.conftest import needs_vectors
from tests.shared.sections import build_text

PUSH = """
state:
  x: {type: real}
action:
  u: ACTION
horizon: 5
initial: {x: "Uniform(-1, 1)"}
dynamics: {x': x + u / 2}
reward: -u * u - x
"""


def push(action: str = "{type: real, low: -2, high: 2}") -> Task:
    return build_text(PUSH.replace("ACTION", action))


@pytest.mark.parametrize(
    ("action", "shape"),
    [
        ("{type: real, low: -2, high: 2}", (1,)),
        ("{type: real, low: -2, high: 2, shape: []}", ()),
        ("{type: int}", (1,)),
        ("{type: int, shape: []}", ()),
    ],
)
def test_one_number_has_an_axis_unless_the_spec_says_it_has_none(action: str, shape: tuple[int, ...]) -> None:
    task = push(action)
    assert task.action_space.shape == shape
    assert task.action_space.dtype == np.float32


def test_the_space_is_that_of_gymnasiums_own_tasks() -> None:
    assert push().action_space == gym.make("Pendulum-v1").action_space


@pytest.mark.parametrize("action", ["{type: real, low: -2, high: 2}", "{type: real, low: -2, high: 2, shape: []}"])
def test_a_float_an_array_without_an_axis_and_one_with_an_axis_are_one_action(action: str) -> None:
    env = taskspec.make(push(action))
    forms: list[Any] = [0.25, np.float32(0.25), np.array(0.25), np.array([0.25]), np.array([0.25], np.float32), [0.25]]
    taken = []
    for form in forms:
        env.reset(seed=3)
        seen, reward, *_ = env.step(form)
        taken.append((seen.tobytes(), reward))
    assert len(set(taken)) == 1
    for form in ([[0.25]], [0.25, 0.25], np.zeros((1, 1)), [], 2.5, "a"):
        with pytest.raises(ActionError, match="E706"):
            env.step(form)
    assert env.time == 1


@needs_vectors("lanes")
@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@pytest.mark.parametrize("action", ["{type: real, low: -2, high: 2}", "{type: real, low: -2, high: 2, shape: []}"])
def test_lanes_take_batches_of_the_space(backend: Any, action: str) -> None:
    pytest.importorskip(backend)
    task = push(action)
    lanes = taskspec.make_vec(task, num_envs=3, backend=backend)
    seen, _ = lanes.reset(seed=7)
    alone = gym.vector.SyncVectorEnv([partial(taskspec.make, task)] * 3)
    first, _ = alone.reset(seed=7)
    np.testing.assert_allclose(seen, first, rtol=1e-6)
    lanes.action_space.seed(0)
    for _ in range(4):
        actions = lanes.action_space.sample()
        assert actions.shape == (3, *task.action_space.shape)
        seen, rewards, *_ = lanes.step(actions)
        expected, paid, *_ = alone.step(actions)
        np.testing.assert_allclose(seen, expected, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(rewards, paid, rtol=1e-5, atol=1e-6)
