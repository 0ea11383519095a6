"""Vector environments at the edges of what a task declares, and of what their numbers hold."""

import numpy as np
import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.task.task import Task
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text
from tests.shared.specs import spec_file

SPEC = """
state:
  s: {type: int, low: 0, high: HIGH}
  u: {type: int, low: 0, high: 1}
action:
  a: {type: int, low: 0, high: 1}
observation:
  o: {value: s, low: 1, high: 3}
  v: u
  space: one_hot
horizon: 20
initial: {s: 0, u: 1}
dynamics:
  s': (s * FACTOR + 1) % (HIGH + 1)
  u': 1 - u
reward: 0
"""


def edges(high: int, factor: int) -> Task:
    return build_text(SPEC.replace("HIGH", str(high)).replace("FACTOR", str(factor)))


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_a_number_outside_its_bounds_sets_no_place(backend: str) -> None:
    pytest.importorskip(backend)
    env = VectorEnvironment(edges(4, 1), 3, backend=backend)
    seen, _ = env.reset(seed=0)
    for k in range(10):
        assert seen.tolist() == [[k % 5 == 1, k % 5 == 2, k % 5 == 3, k % 2 == 1, k % 2 == 0]] * 3
        seen, *_ = env.step(np.zeros(3, np.int64))


def test_ints_that_may_pass_32_bits_are_refused_by_jax_alone() -> None:
    pytest.importorskip("jax")
    assert refusal(VectorEnvironment, edges(10**9, 1000), 1, backend="jax").codes == ["E715"]


@pytest.mark.parametrize(("backend", "high"), [("jax", 10**6), ("numpy", 10**6), ("numpy", 10**9), ("numba", 10**9)])
def test_ints_are_exact(backend: str, high: int) -> None:
    pytest.importorskip(backend)
    env = VectorEnvironment(edges(high, 1000), 1, backend=backend)
    env.reset(seed=0)
    s = 0
    for _ in range(15):
        env.step(np.zeros(1, np.int64))
        s = (s * 1000 + 1) % (high + 1)
        assert env.state(0)["s"] == s


COUNT = """
state: {s: {type: int}}
action: {a: {type: int, low: 0, high: 1}}
horizon: none
initial: {s: START}
dynamics: {s': s + 30}
reward: 0
"""


def count(start: int) -> VectorEnvironment:
    env = VectorEnvironment(build_text(COUNT.replace("START", str(start))), 1, backend="jax")
    env.reset(seed=0)
    env.step(np.zeros(1, np.int64))
    return env


def test_a_count_without_end_is_refused_by_jax_only_near_the_end_of_its_ints() -> None:
    pytest.importorskip("jax")
    assert count(5).state(0)["s"] == 35
    VectorEnvironment(load(spec_file("queue")), 1, backend="jax").reset(seed=0)
    with pytest.raises(SpecError, match="E715"):
        count(2147483600)


MIXED = """
state:
  k: {type: int, low: -9, high: 9}
  b: {type: bool}
  x: {type: real, low: -9, high: 9}
action:
  i: {type: int, low: -2, high: 2}
  c: {type: bool}
  r: {type: real, low: -1, high: 1}
horizon: 20
initial: {k: 0, b: false, x: 0}
dynamics: {k': i, b': c, x': r}
reward: 0
"""


def test_whole_actions_in_a_box_are_rounded_by_the_functions_for_jax() -> None:
    jax = pytest.importorskip("jax")
    from taskspec.programs.jax import Functional

    task = build_text(MIXED)
    functional = Functional(task)
    _, state = functional.reset(jax.random.key(0))
    for action in ([1.7, 0.4, 0.25], [-1.6, 0.7, -0.5], [0.5, 1.0, 0.0], [1.5, 0.0, 1.0]):
        _, after, *_ = functional.step(state, np.array(action, np.float32))
        k, b, x = after.values
        assert (int(k), bool(b), float(x)) == (round(action[0]), bool(round(action[1])), action[2])
