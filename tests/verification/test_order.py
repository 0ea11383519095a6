"""What a step gives is of the state before it, where nothing is primed: bare reads in every place, on every backend.

Each spec takes one line of each section from the lists below. The reference interpreter is what they are compared with.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.sparse import sparse

HEAD = """
taskspec: 1
name: Order
state:
  x: {type: int, low: 0, high: 9}
  y: {type: int, low: 0, high: 9}
  f: {type: bool}
  g: {type: bool}
  r: {type: real, low: -9, high: 9}
  v: {type: int, low: 0, high: 9, shape: [3]}
  w: {type: real, low: 0, high: 99, shape: [40]}
  c: {type: choice, values: [left, right]}
action:
  a: {type: bool}
noise:
  n: Uniform(0, 1)
initial: {x: "UniformInt(2, 7)", y: 1, f: false, g: true, r: 0.5, v: "[1, 2, 3]", w: "[i for i in range(40)]", c: left}
"""
DYNAMICS = (
    "{x': x}",
    "{x': y, y': x, f': g, g': f}",
    "{f': a, g': f, c': right if f else left}",
    "{x': \"min(x + 1, 9)\", y': x, r': x}",
    '{v\': "[v[1], v[2], v[0]]", w\': reverse(w), r\': "w[3]"}',
    '{v\': "swap(v, x % 3, 1)", w\': "concat(w[1:], [r])", x\': "v[y % 3]"}',
    "{f': true, y': t % 10, r': -r, v': \"put(v, y % 3, x)\"}",
    "{w': \"Uniform(0, 1, shape=40)\", x': \"UniformInt(0, 9)\", y': x, r': n}",
    '{v\': "[x, y, x]", x\': "v[0]", w\': "[r for i in range(40)]"}',
)
REWARD = ("x", "r", "t", "v[0]", "v[x % 3]", "w[39]", "w[x]", "x'", "r'", "f", "n", "3", "sum(w)", "w'[x]", "-0.0")
TERMINAL = (
    "f", "g", "f'", "a", "true", "false", "f and not f", "x == 0 and x == 3", "t == 2", "v[0] == 2", "n < 1/3",
    "c == right", "g and g'",
)  # fmt: skip
OBSERVATION = (
    "", "{o: x}", "{o: f}", "{o: c}", "{o: r}", "{o: y + 1}", "{o: v}", "{o: w}", "{o: t}", "{o: \"v[1]\"}", "{o: \"w[x]\"}",
    "{o: x, p: f, space: one_hot}", "{o: v, p: c, space: multi_discrete}", "{o: x, p: w, q: v, k: r, space: dict}",
    "{o: n, p: y, q: \"Uniform(0, 1)\"}", "{o: w, p: x, q: w}", "{o: 1}",
)  # fmt: skip
MODES = ("NextStep", "SameStep", "Disabled")


def specs() -> list[tuple[str, str, str, str]]:
    """Every line of each section with every dynamics; the other sections go round."""
    found = []
    for section, lines in enumerate((REWARD, TERMINAL, OBSERVATION)):
        for number, (dynamics, line) in enumerate(product(DYNAMICS, lines)):
            parts = [group[(number * 7 + number // 5) % len(group)] for group in (REWARD, TERMINAL, OBSERVATION)]
            parts[section] = line
            found.append((dynamics, *parts))
    return found  # type: ignore[return-value]


def task_of(dynamics: str, reward: str, terminal: str, observation: str, number: int = 0) -> Task:
    lines = [f"dynamics: {dynamics}", f"reward: {reward}", f"terminal: {terminal}", f"horizon: {3 + number % 4}"]
    lines += [f"observation: {observation}"] * bool(observation)
    task = build(read_text(HEAD + "\n".join(lines)), None, {}, "")
    wanted = {"absorbing": number % 5 == 4, "time_observed": number % 7 == 6}
    return taskspec.modify(task, *(name for name, given in wanted.items() if given))


def identical(found: Any, expected: Any) -> bool:
    """Equal with the signs of zeros."""
    if isinstance(expected, dict):
        return found.keys() == expected.keys() and all(identical(found[k], expected[k]) for k in expected)
    a = np.asarray(found)
    b = np.asarray(expected)
    same = a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return same and (a.dtype.kind != "f" or np.array_equal(np.signbit(a), np.signbit(b)))


CASES = list(enumerate(specs()))


@pytest.mark.parametrize("start", sparse(range(16), 4))
def test_the_scalar_environment_pays_and_shows_what_the_state_was(start: int) -> None:
    for number, parts in CASES[start::16]:
        task = task_of(*parts, number)
        env = taskspec.make(task)
        reference = ReferenceEnv(task)
        env.action_space.seed(number)
        assert identical(env.reset(seed=number)[0], reference.reset(seed=number)[0]), parts
        for _ in range(12):
            action = env.action_space.sample()
            found = env.step(action)
            expected = reference.step(action)
            assert identical(list(found[1:4]), list(expected[1:4])), (parts, found, expected)
            assert identical(found[0], expected[0]), (parts, found, expected)
            assert identical(dict(env.unwrapped.state), dict(reference.state)), parts
            if found[2] or found[3]:
                assert identical(env.reset()[0], reference.reset()[0]), parts


@pytest.mark.parametrize("start", sparse(range(16), 8))
def test_numpy_pays_and_shows_what_the_state_was(start: int) -> None:
    for number, parts in CASES[start::16]:
        agreement = Agreement(task_of(*parts, number), "numpy", 3, MODES[number % 3], number, ReferenceEnv, states=True)
        agreement.tolerance = 0
        agreement.run(10)


EVERY_BACKEND = [
    pytest.param(backend, number, marks=[pytest.mark.slow] if k % 12 else [])
    for backend, shift in (("numba", 0), ("jax", 6))
    for k, (number, _) in enumerate(CASES[shift::13])
]


@pytest.mark.parametrize(("backend", "number"), EVERY_BACKEND)
def test_compiled_backends_pay_and_show_what_the_state_was(backend: str, number: int) -> None:
    pytest.importorskip(backend)
    task = task_of(*dict(CASES)[number], number)
    Agreement(task, backend, 3, MODES[number % 3], number, ReferenceEnv, states=True).run(10)


def test_nothing_handed_out_changes_with_the_next_step() -> None:
    task = task_of("{x': y, y': x, w': reverse(w)}", "x", "f", "{o: x, p: w, space: dict}")
    env = taskspec.make(task)
    vector = VectorEnvironment(task, 2, backend="numpy")
    first = env.reset(seed=0)[0]
    kept = vector.reset(seed=0)[0]
    before = {k: np.copy(v) for k, v in first.items()}
    held = {k: np.copy(v) for k, v in kept.items()}
    state = {k: np.copy(v) for k, v in env.unwrapped.state.items()}
    shown = env.unwrapped.state
    for _ in range(2):
        env.step(1)
        vector.step(np.ones(2, int))
    assert identical(first, before)
    assert identical(kept, held)
    assert identical(dict(shown), state)


# -- by hand ------------------------------------------------------------------------------------------------------

SMALL = """
taskspec: 1
name: Small
state: {s: {type: int, low: 0, high: 9}, prev: {type: int, low: 0, high: 9}, done: {type: bool}}
action: {a: {type: bool}}
initial: {s: 0, prev: 0, done: false}
dynamics: {s': "min(s + 1, 9)", prev': s, done': a}
horizon: 5
"""


def small(rest: str) -> Task:
    return build(read_text(SMALL + rest), None, {}, "")


def walked(task: Task, backend: str, actions: list[int], mode: str = "Disabled") -> list[Any]:
    """(observation, reward, terminated, truncated) of steps from the first state, on any backend."""
    if backend == "scalar":
        env = taskspec.make(task)
        first, _ = env.reset(seed=0)
        return [first, *(tuple(env.step(a)[:4]) for a in actions)]
    vector = VectorEnvironment(task, 2, backend=backend, autoreset_mode=mode)
    first, _ = vector.reset(seed=0)
    return [first[0], *(tuple(part[0] for part in vector.step(np.array([a, a]))[:4]) for a in actions)]


@pytest.mark.parametrize("backend", ["scalar", "numpy", "numba", "jax"])
def test_what_is_not_primed_is_of_the_state_that_was_left(backend: str) -> None:
    task = small("reward: s\nterminal: done\nobservation: {o: prev}")
    found = walked(task, backend, [0, 1, 0])
    assert found == [0, (0, 0, False, False), (1, 1, False, False), (2, 2, True, False)]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize("terminal", ["s' == 0 and s' == 3", "s * 0 == 1", "s' < 0"])
def test_conditions_that_never_hold_leave_the_horizon(terminal: str, backend: str, mode: str) -> None:
    task = small(f"reward: s' * 0 + 2\nterminal: {terminal}\nobservation: {{o: s * 0 + 7}}")
    found = walked(task, backend, [0] * 5, mode)
    assert found == [7, *[(7, 2, False, False)] * 4, (7, 2, False, True)]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_conditions_that_always_hold_end_the_first_step(backend: str, mode: str) -> None:
    task = small("reward: s' - s' + 1\nterminal: s' < 3 or s' >= 3\nobservation: {o: s}")
    assert walked(task, backend, [0], mode)[1][1:] == (1, True, False)


@pytest.mark.parametrize("backend", ["scalar", "numpy", "numba", "jax"])
def test_what_steps_make_constant_is_seen_to_differ_at_the_reset(backend: str) -> None:
    head = SMALL.replace("dynamics: {s': \"min(s + 1, 9)\", prev': s, done': a}", "dynamics: {done': true, prev': 3}")
    task = build(read_text(head + "reward: 0\nobservation: {o: done, p: prev, q: s}"), None, {}, "")
    found = walked(task, backend, [0, 0])
    assert [list(found[0]), *(list(step[0]) for step in found[1:])] == [[0, 0, 0], [1, 3, 0], [1, 3, 0]]
