"""Measures in the infos of steps: the same in every kind of environment, and away from rewards and ends."""

import pytest

import taskspec
from taskspec.language.task.task import Task
from tests.conftest import needs_vectors
from tests.shared.conformance import Agreement
from tests.shared.sections import build_text

SPEC = """
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: choice, values: {left: -1, right: 1}}}
noise: {slip: Bernoulli(1/4)}
horizon: 4
initial: {s: 1}
dynamics: {s': "clip(s + (a if slip else 1), 0, 3)"}
reward: s' == 3
terminal: s' == 0
"""
MEASURES = """\
measures:
  cost: slip * s + Bernoulli(1/2)
  moved: {value: "s' != s and not terminal", doc: whether it moved}
"""


@pytest.fixture
def task() -> Task:
    return build_text(SPEC + MEASURES)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@needs_vectors()
def test_vector_environments_have_the_infos_of_scalar_ones(task: Task, backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    Agreement(task, backend, 3, mode).run(12)


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


def test_measures_change_nothing_else(task: Task) -> None:
    measured = taskspec.make(task)
    plain = taskspec.make(build_text(SPEC))
    for seed in range(20):
        assert measured.reset(seed=seed)[0] == plain.reset(seed=seed)[0]
        ended = False
        while not ended:
            *found, info = measured.step(1)
            *expected, nothing = plain.step(1)
            assert (found, nothing) == (expected, {})
            assert info.keys() == {"measures"}
            ended = found[2] or found[3]


def test_a_measure_that_is_not_finite_is_shown_in_its_line() -> None:
    (diagnostic,) = taskspec.exact.soundness(build_text(f"{SPEC}measures: {{cost: 1 / (s - 1)}}"))
    assert (diagnostic.code, diagnostic.span.line) == ("E406", 10)
    assert "the measure 'cost' is inf" in diagnostic.message
