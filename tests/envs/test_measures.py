"""Measures in the infos of steps: the same in every kind of environment, and away from rewards and ends."""

from pathlib import Path

import pytest

import taskspec
from taskspec.language.task.task import Task
from tests.conftest import needs_vectors
from tests.shared.conformance import check_infos

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


@pytest.fixture
def task(tmp_path: Path) -> Task:
    path = tmp_path / "walk.yaml"
    path.write_text(SPEC.replace("MEASURES", MEASURES))
    return taskspec.load(path)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@needs_vectors()
def test_vector_environments_have_the_infos_of_scalar_ones(task: Task, backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    check_infos(task, backend, mode)


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
        assert jax.device_get(info["measures"]) == measures
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
