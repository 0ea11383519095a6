"""Measures in the infos of steps: the same in every kind of environment, and away from rewards and ends."""

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import taskspec
from taskspec.language.task.task import Task
from tests.conftest import VECTORS

SPEC = """
taskspec: 1
name: Walk
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: choice, values: {left: -1, right: 1}}}
noise: {slip: Bernoulli(1/4)}
horizon: 4
initial: {s: 1}
dynamics: {s': "clip(s + (a if slip else 1), 0, 3)"}
reward: s' == 3
terminal: s' == 0
MEASURES
"""
MEASURES = """
measures:
  cost: slip * s + Bernoulli(1/2)
  moved: {value: "s' != s and not terminal", doc: whether it moved}
"""
LANES = 3
STEPS = 12


@pytest.fixture
def task(tmp_path: Path) -> Task:
    path = tmp_path / "walk.yaml"
    path.write_text(SPEC.replace("MEASURES", MEASURES))
    return taskspec.load(path)


def infos(env: Any) -> list[dict[str, Any]]:
    """The infos of some steps, without last observations."""
    rng = np.random.default_rng(0)
    env.reset(seed=5)
    found = [env.step(rng.integers(0, 2, LANES))[4] for _ in range(STEPS)]
    return [{key: value for key, value in each.items() if "final_obs" not in key} for each in found]


def are_equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(are_equal(one[key], other[key]) for key in one)
    return bool(np.array_equal(one, other))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@pytest.mark.skipif(not VECTORS, reason="vector environments need a later Gymnasium")
def test_vector_environments_have_the_infos_of_scalar_ones(task: Task, backend: str, mode: str) -> None:
    if backend != "numpy":
        pytest.importorskip(backend)
    makers = [partial(taskspec.make, task)] * LANES
    scalars = gymnasium.vector.SyncVectorEnv(makers, autoreset_mode=gymnasium.vector.AutoresetMode(mode))
    lanes = taskspec.make_vec(task, num_envs=LANES, backend=backend, autoreset_mode=mode)
    for expected, found in zip(infos(scalars), infos(lanes), strict=True):
        assert are_equal(expected, found), (expected, found)


def test_functions_in_jax_have_them_too(task: Task) -> None:
    jax = pytest.importorskip("jax")
    from taskspec.programs.jax import Functional

    env = taskspec.make(task)
    env.reset(seed=3)
    functions = Functional(task)
    _, state = functions.reset(jax.random.key(3))
    for action in (0, 1):
        _, state, _, done, info = functions.step_env(state, action)
        measures = env.step(action)[4]["measures"]
        assert {name: float(value) for name, value in info["measures"].items()} == measures
        if done:
            break


def test_measures_change_nothing_else(task: Task, tmp_path: Path) -> None:
    path = tmp_path / "plain.yaml"
    path.write_text(SPEC.replace("MEASURES", ""))
    measured = taskspec.make(task)
    plain = taskspec.make(path)
    for seed in range(20):
        assert measured.reset(seed=seed)[0] == plain.reset(seed=seed)[0]
        ended = False
        while not ended:
            *found, info = measured.step(1)
            *expected, nothing = plain.step(1)
            assert (found, nothing) == (expected, {})
            assert info.keys() == {"measures"}
            ended = found[2] or found[3]


def test_a_measure_that_is_not_finite_is_shown_in_its_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(SPEC.replace("MEASURES", "measures: {cost: 1 / (s - 1)}"))
    (diagnostic,) = taskspec.exact.soundness(path)
    assert (diagnostic.code, diagnostic.span.line) == ("E406", 12)
    assert "the measure 'cost' is inf" in diagnostic.message
