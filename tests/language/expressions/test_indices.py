"""Indices, and states that leave their range: one rule, the same values on every backend, and no read outside a vector.

Expected values are written by hand from the language's reference: an index that is known counts from the end when it is
negative, one that depends on the state is moved to the nearest end.
"""

import re
from itertools import product
from typing import Any

import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.envs.options import StateError
from taskspec.exact.model.extract import extract
from taskspec.exact.soundness.soundness import soundness
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement
from tests.shared.diagnostics import codes
from tests.shared.for_each import for_each
from tests.shared.sections import build_text

SPEC = """
taskspec: 1
name: Indices
parameters:
  n: {type: int, default: 1, low: 0, high: 3}
constants:
  v: [10, 20, 30]
  m: [[1, 2, 3], [4, 5, 6]]
definitions:
  before: s - 1
  last: -n
  always: -(s < 99)
  back(i): v[-i]
  pick(i): v[i]
noise:
  none: -1
state:
  s: {type: int, low: 0, high: 4}
  w: {type: int, shape: [3], low: 0, high: 99}
  x: {type: real, low: -9, high: 9}
  y: {type: int, low: 0, high: 99}
  zero: {type: int, low: -1, high: 0}
action:
  a: {type: int, low: 0, high: 1}
horizon: 5
initial:
  s: 0
  w: [10, 20, 30]
  x: 0
  zero: 0
  y: v[zero - 1]
dynamics:
  s': min(s + 1, 4)
  x': x - 1
  zero': 0
reward: REWARD
"""


def task_of(reward: str, **parameters: Any) -> Task:
    return build_text(SPEC.replace("REWARD", reward), **parameters)


def rewards(task: Task) -> list[float]:
    """What an episode pays in the scalar environment: s is 0, 1, 2, 3, 4, and x is 0, -1, ..."""
    env = taskspec.make(task)
    env.reset(seed=0)
    return [env.step(0)[1] for _ in range(5)]


CASES: dict[str, list[float]] = {
    # known before the task runs: from the end
    "v[-1]": [30] * 5, "v[-3]": [10] * 5, "v[-n]": [30] * 5, "v[last]": [30] * 5, "back(1)": [30] * 5, "m[-1, -2]": [5] * 5,
    "m[-len(w) + 2, 0]": [4] * 5,
    "w[-1] + s": [30, 31, 32, 33, 34], "sum([v[i - 1] for i in range(3)])": [60] * 5, "v[[-1, 0]][0]": [30] * 5,
    "put(v, -1, 0)[2]": [0] * 5, "put(v, 9, 0)[2]": [0] * 5, "swap(v, 0, -1)[0]": [30] * 5,
    # named by the state: to the nearest end
    "v[s]": [10, 20, 30, 30, 30], "v[s - 1]": [10, 10, 20, 30, 30], "v[before]": [10, 10, 20, 30, 30],
    "v[-s]": [10] * 5, "back(s)": [10] * 5, "w[s - 2]": [10, 10, 10, 20, 30], "m[s - 1, 1 - s]": [2, 1, 4, 4, 4],
    "v[[s - 1, 2 - s]][1]": [30, 20, 10, 10, 10], "v[t - 1]": [10, 10, 20, 30, 30], "v[-a]": [10] * 5,
    "put(w, s - 1, 0)[0]": [0, 0, 10, 10, 10], "put(w, s - 1, 0)[2]": [30, 30, 30, 0, 0],
    "swap(w, s - 1, 2)[0]": [30, 30, 10, 10, 10], "v[floor(x)]": [10] * 5, "v[floor(-x) + 1]": [20, 30, 30, 30, 30],
    "v[floor(1e30 * x)]": [10] * 5, "v[floor(x / 0)]": [10] * 5,
    # named by the state, though it comes to the same everywhere
    "v[-(s < 99)]": [10] * 5, "v[-1 if s < 99 else 0]": [10] * 5, "put(v, -(s < 99), 0)[0]": [0] * 5,
    "pick(-(s < 99))": [10] * 5, "v[always]": [10] * 5, "v[zero' - 1]": [10] * 5, "v[none]": [10] * 5, "y": [10] * 5,
}  # fmt: skip


@for_each("reward", CASES)
def test_where_an_index_points(reward: str) -> None:
    assert rewards(task_of(reward)) == CASES[reward]


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_where_indices_point_on_every_backend(backend: str) -> None:
    """All cases in one task, each in one element of what is observed."""
    pytest.importorskip(backend)
    parts = ", ".join(c for c in CASES if not {"t", "a", "x", "none", "zero", "swap"} & set(re.findall(r"\b[a-z]+", c)))
    text = SPEC.replace("REWARD", "0") + f'observation:\n  o: "[{parts}]"\n'
    Agreement(build_text(text), backend, 3, "SameStep").run(12)


@pytest.mark.parametrize("reward", ["v[3]", "v[-4]", "m[0, 3]", "v[n + 2]"])
def test_a_known_index_outside_is_an_error(reward: str) -> None:
    with pytest.raises(SpecError, match="E315"):
        task_of(reward)


# -- states that leave their range ------------------------------------------------------------------------------------

LEAVES = {
    "a table of thousands of rows": (
        "table: '[i % 7 for i in range(3000)]'", "low: 0, high: 2999", "1", "1000000 * (s + a)", "table[s]", [1, 3, 3],
    ),
    "below": ("table: [1, 2, 3]", "low: 0, high: 2", "2", "s - 2 - a", "table[s]", [3, 1, 1]),
    "a divisor": ("", "low: 1, high: 9", "5", "s - 4", "12 // s + 12 % s + 12 / s", [2 + 2 + 12 / 5, 24, 24]),
    "a row of a table": ("", "low: 0, high: 2", "2", "s + 9 * a - 1", "{by: [s'], rows: {0: 5, 1: 6, 2: 7}}", [6, 5, 5]),
    "the start": ("table: [1, 2, 3]", "low: 0, high: 2", "7", "s", "table[s]", [3, 3, 3]),
    "each element on its own": (
        "", "shape: [2], low: [0, 5], high: [2, 6]", "[0, 5]", "s + 2", "10 * s[0] + s[1]", [5, 26, 26],
    ),
    "far away": ("", "low: -3, high: 4000000000", "0", "s - 2**40", "s", [0, -3, -3]),
}  # fmt: skip


def leaving(name: str) -> tuple[Task, list[float]]:
    constants, bounds, initial, dynamics, reward, expected = LEAVES[name]
    text = f"""
constants:
  one: 1
  {constants}
state:
  s: {{type: int, {bounds}}}
action:
  a: {{type: int, low: 0, high: 1}}
horizon: 4
initial:
  s: {initial}
dynamics:
  s': {dynamics}
reward: {reward}
"""
    return build_text(text), expected


@pytest.mark.parametrize("name", LEAVES)
def test_a_state_keeps_to_its_range(name: str) -> None:
    task, expected = leaving(name)
    env = taskspec.make(task)
    env.reset(seed=0)
    assert [env.step(0)[1] for _ in expected] == expected


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@pytest.mark.parametrize("name", LEAVES)
def test_a_state_keeps_to_its_range_on_every_backend(name: str, backend: str) -> None:
    pytest.importorskip(backend)
    task, _ = leaving(name)
    if backend == "jax" and name in ("far away", "a table of thousands of rows"):
        with pytest.raises(SpecError, match="E715"):
            Agreement(task, backend, 3, "NextStep")
        return
    Agreement(task, backend, 3, "NextStep").run(10)


@pytest.mark.parametrize("name", LEAVES)
def test_a_state_that_leaves_its_range_is_reported(name: str) -> None:
    """By `check`, and by the exact model."""
    task, _ = leaving(name)
    assert codes(soundness(task)) == ["E404" if name == "the start" else "E403"]
    if task.is_finite and name not in ("far away", "the start"):
        with pytest.raises(SpecError, match="outside the state space"):
            extract(task)


@pytest.mark.parametrize("value", [-1, 3, 2**40])
def test_a_state_is_not_set_outside_its_range(value: int) -> None:
    task, _ = leaving("below")
    with pytest.raises(StateError, match="E709"):
        taskspec.make(task).reset(options={"state": {"s": value}})


# -- the time ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("backend", "mode"),
    [
        pytest.param(backend, mode, marks=pytest.mark.slow if (backend, mode) == ("numba", "NextStep") else [])
        for backend, mode in product(("numpy", "numba", "jax"), ("SameStep", "NextStep", "Disabled"))
    ],
)
def test_the_time_as_an_index(backend: str, mode: str) -> None:
    """Lanes whose episodes have ended are stepped with the others, and their time is that of no step."""
    pytest.importorskip(backend)
    text = """
constants:
  table: "[i % 7 for i in range(9)]"
state: {v: {type: int, shape: [9, 2], low: 0, high: 99}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 9
initial:
  v: "[(i, 2 * i) for i in range(9)]"
dynamics: {v': v}
reward: table[t] + sum(v[t]) + a
"""
    Agreement(build_text(text), backend, 3, mode).run(30)


# -- reals ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_an_index_made_of_reals_is_moved_whatever_bounds_say(backend: str) -> None:
    """25 times 1.16 is 29 or a little less, as it is added up; a table of 29 rows has none of that number."""
    pytest.importorskip(backend)
    text = """
constants:
  table: "[i for i in range(29)]"
state: {v: {type: real, shape: [25], low: 1.16, high: 1.16}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 5
initial:
  v: "[1.16 for i in range(25)]"
dynamics: {v': v}
reward: table[floor(sum(v))]
"""
    task = build_text(text)
    env = taskspec.make(task)
    env.reset(seed=0)
    assert env.step(0)[1] == 28.0
    Agreement(task, backend, 3, "SameStep").run(12)
