"""Masks of legal actions in the infos of every kind of environment, against the condition worked out by hand."""

from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from tests.conftest import needs_vectors
from tests.shared.conformance import Agreement
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

SPEC = """
parameters: {top: {type: int, default: 4, low: 1, high: 9}}
state: {level: {type: int, low: 0, high: top}, door: {type: bool}}
ACTION
horizon: 6
initial: {level: {0: 1/2, 2: 1/2}, door: Bernoulli(1/2)}
dynamics: {level': "clip(level + MOVE, 0, top)", door': Bernoulli(1/2)}
reward: level'
terminal: level' == top
"""
CHOICE = """action: {a: {type: choice, values: [down, open, up]}}
legal: (a != down or level > 0) and (a == open or not door)"""
FORMS = {
    "choice": (CHOICE, "(a - 1)"),
    "int": (CHOICE.replace("{type: choice, values: [down, open, up]}", "{type: int, low: -1, high: 1}")
                  .replace("down", "-1").replace("open", "0"), "a"),
    "bool": ("action: {a: {type: bool}}\nlegal: not a or not door", "a"),
}  # fmt: skip
LANES = 3
STEPS = 14


def expected(form: str, state: dict[str, Any]) -> list[int]:
    """The mask of a state by hand."""
    still = not state["door"]
    if form == "bool":
        return [1, int(still)]
    return [int(still and state["level"] > 0), 1, int(still)]


@pytest.fixture(params=FORMS)
def form(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def task(form: str) -> Task:
    action, move = FORMS[form]
    return build_text(SPEC.replace("ACTION", action).replace("MOVE", move))


def test_every_state_of_an_episode_has_its_mask(task: Task, form: str) -> None:
    env = taskspec.make(task)
    legal = np.random.default_rng(0)
    for seed in range(20):
        _, info = env.reset(seed=seed)
        ended = False
        while not ended:
            mask = info["action_mask"]
            assert mask.dtype == np.int8
            assert mask.tolist() == expected(form, env.state) == env.action_masks().tolist()
            action = env.action_space.sample(mask)
            assert mask[action - env.action_space.start] == 1
            if legal.random() < 0.5:  # an illegal action has the effect of the equations
                action = int(env.action_space.start)
            *_, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        assert info["action_mask"].tolist() == expected(form, env.state)


def test_a_state_that_is_set_has_its_mask(task: Task, form: str) -> None:
    env = taskspec.make(task)
    for level in range(5):
        for door in (False, True):
            _, info = env.reset(seed=0, options={"state": {"level": level, "door": door}})
            assert info["action_mask"].tolist() == expected(form, {"level": level, "door": door})


@pytest.mark.parametrize("form", ["int"], indirect=True)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@needs_vectors()
def test_vector_environments_have_the_infos_of_scalar_ones(task: Task, backend: str, mode: str) -> None:
    pytest.importorskip(backend)
    agreement = Agreement(task, backend, 3, mode)
    agreement.run(12)
    lanes = agreement.vector
    *_, infos = lanes.step(lanes.action_space.sample())
    assert infos["action_mask"].dtype == np.int8
    assert np.array_equal(lanes.call("action_masks"), infos["action_mask"])


def test_functions_in_jax_have_them_too(task: Task, form: str) -> None:
    jax = pytest.importorskip("jax")
    from taskspec.envs.functional import TaskFuncEnv
    from taskspec.programs.jax import Functional

    functions = Functional(task)
    pure = TaskFuncEnv(task)
    first = int(task.action_space.start)
    for seed in range(8):
        _, state = functions.reset(jax.random.key(seed))
        held = pure.initial(jax.random.key(seed))
        for k in range(3):
            plain = {"level": int(state.values[0]), "door": bool(state.values[1])}
            assert functions.action_mask(state).astype(int).tolist() == expected(form, plain)
            assert pure.state_info(held)["action_mask"].tolist() == functions.action_mask(state).tolist()
            action = first + k % int(task.action_space.n)
            held = pure.transition(held, action, None)
            _, state, _, done, info = functions.step_env(state, action)
            assert info["action_mask"].tolist() == functions.action_mask(state).tolist()
            if done:
                break


def test_nothing_else_changes(task: Task) -> None:
    free = taskspec.make(with_all_actions(task))
    env = taskspec.make(task)
    for seed in range(10):
        assert env.reset(seed=seed)[0].tolist() == free.reset(seed=seed)[0].tolist()
        ended = False
        while not ended:
            seen, *found, _ = env.step(1)
            other, *plain, nothing = free.step(1)
            assert (seen.tolist(), found, {}) == (other.tolist(), plain, nothing)
            ended = found[1] or found[2]
    assert free.action_masks().tolist() == [True] * int(task.action_space.n)


@pytest.mark.parametrize("action", ["{a: {type: real, low: 0, high: 1}}", "{a: {type: bool}, b: {type: bool}}"])
def test_other_actions_are_refused(action: str) -> None:
    error = refusal(build_text, SPEC.replace("ACTION", f"action: {action}\nlegal: level > 0").replace("MOVE", "1"))
    (diagnostic,) = error.diagnostics
    assert (diagnostic.code, diagnostic.span.line) == ("E214", 5)


@pytest.mark.parametrize("name", ["level'", "t", "Bernoulli(1/2)"])
def test_the_condition_is_a_function_of_state_and_action(name: str) -> None:
    error = refusal(
        build_text, SPEC.replace("ACTION", f"action: {{a: {{type: bool}}}}\nlegal: a == {name}").replace("MOVE", "a")
    )
    for diagnostic in error.diagnostics:
        assert diagnostic.span.line == 5
