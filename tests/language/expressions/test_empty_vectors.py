"""Vectors without elements: a parameter that counts something may be 0."""

from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import scores
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.sparse import sparse

DISTRACTED = """
summary: Walk to the end, beside numbers that mean nothing.
parameters:
  M: {type: int, default: 3, low: 0, high: 9, doc: how many numbers mean nothing}
state:
  s: {type: int, low: 0, high: 3}
  noise: {type: real, shape: [M]}
  lamps: {type: choice, values: [out, lit], shape: [M]}
  wires: {type: int, low: 0, high: 1, shape: [M, 2]}
action:
  a: {type: choice, values: {left: -1, right: 1}}
  press: {type: bool, shape: [M]}
horizon: 4
initial:
  s: 0
  noise: Normal(shape=M)
  lamps: "[out for i in range(M)]"
  wires: "[[0, 1] for i in range(M)]"
dynamics:
  s': clip(s + a, 0, 3)
  noise': 0.5 * noise + Normal(shape=M)
  lamps': "[1 - lamps[i] if press[i] else lamps[i] for i in range(M)]"
  wires': "[[wires[i, 1], wires[i, 0]] for i in range(M)]"
observation: {s: s, noise: noise, lamps: lamps, wires: wires}
reward: s' - count(press) + 0 * sum(noise) + (0 * max(noise) if M > 0 else 0)
expert: {a: right, press: "[i < 0 for i in range(M)]"}
claims:
  - claim: optimal_return == 9
    for: [{M: 0}]
examples:
  - {state: {s: 0, wires: []}, action: {a: right, press: []}, next: {s: 1, lamps: []}, reward: 1, for: [{M: 0}]}
"""

VALUES = [
    ("sum(v) + sum(c) + count(v > 0) + norm1(v) + norm2(c) + dot(v, c) + len(v)", 0),
    ("prod(v)", 1),
    ("all(v > 0) + 2 * any(v > 0)", 1),
    ("sum(concat(v, s, c, (2, 3))) + len(concat(c, v))", 5),
    ("len(sort(v)) + len(argsort(c)) + len(cumsum(v)) + len(reverse(c)) + len(v[::-1]) + len(v[1:])", 0),
    ("fold(add, 7, v) + sum(scan(add, 7, c))", 7),
    ("sum(m[3:1]) + sum(m[:, 2:2]) + sum(m[:0, s]) + sum(c[c]) + sum(m[c])", 0),
    ("sum(dot(m[:, :0], v)) + len(dot(m[:, :0], v))", 2),
    ("sum(reshape(v, (0, 3))) + len(reshape(c, (3, 0)))", 3),
    ("s in range(M) or s in [] or s in {x for x in c}", 0),
    ("all(v == c) + all(v + 1 < clip(v, 0, 1) * s) + all((v if s > 0 else c) == v)", 3),
    ("sum([[i * j for j in range(3)] for i in range(M)]) + len([x for x in {0, 1} if x > 1])", 0),
    ("sum(onehot(s, M)) + sum(Normal(shape=M)) + count(Subset(M, 0)) + Binomial(M, 1/2) + len(Permutation(M))", 0),
    ("sum(Uniform(v, v + 1)) + sum(Dirichlet(v + 1)) + sum(Geometric(v)) + sum(Beta(v, 1, shape=M))", 0),
    ("(max(v) if M > 0 else 4) + (c[0] if len(c) > 0 else 5) + (half(v) if M > 1 else 6)", 15),
    ("sum([max(v) if len(v) > 2 else i for i in range(3)])", 3),
]  # fmt: skip

MISTAKES = [
    ("max(v)", "E407", "a vector without elements has no smallest and no largest element"),
    ("argmin(c)", "E407", "a vector without elements has no smallest and no largest element"),
    ("v[0]", "E407", "a vector without elements has no index"),
    ("c[s]", "E407", "a vector without elements has no index"),
    ("sum(put(v, 0, 1))", "E407", "a vector without elements has no index"),
    ("sum(swap(c, s, 0))", "E407", "a vector without elements has no index"),
    ("Uniform({x for x in c})", "E407", "this set is empty"),
    ("Categorical(v)", "E401", "these probabilities sum to 0, not 1"),
    ("sum(v + (1, 2))", "E307", "the shapes [0] and [2] do not match element by element"),
    ("max(w) if M > 0 else 4", "E302", "'w' is not defined here"),
    ("v[0] if s > 5 else 0", "E407", "a vector without elements has no index"),
    ("UniformInt(0, len(v) - 1) if M > 0 else 0", "E408", "'low' of UniformInt is 0, above 'high' -1"),
    ("c[z] if M > 0 else 0", "E407", "a vector without elements has no index"),
]  # fmt: skip


def spec(reward: str) -> str:
    return f"""
parameters:
  M: {{type: int, default: 0, low: 0, high: 9}}
constants:
  m: [[1, 2, 3], [4, 5, 6]]
  c: "[i for i in range(M)]"
definitions:
  "add(x, y)": x + y
  "half(x)": x[1] / 2
noise:
  z: UniformInt(0, 1)
state:
  s: {{type: int, low: 0, high: 3}}
  v: {{type: real, low: 0, high: 1, shape: [M]}}
action:
  u: {{type: int, low: 0, high: 1}}
horizon: 3
initial: {{s: 0}}
dynamics: {{s': "clip(s + u, 0, 3)"}}
reward: "{reward}"
"""


def nothing(text: str, **given: Any) -> Task:
    return build_text(text, **given)


@for_each(("reward", "value"), VALUES)
def test_values_of_nothing(reward: str, value: float) -> None:
    env: Any = taskspec.make(nothing(spec(reward)))
    env.reset(seed=1)
    assert env.step(0)[1] == value


@pytest.mark.parametrize(("reward", "code", "message"), MISTAKES)
def test_nothing_has_no_element(reward: str, code: str, message: str) -> None:
    assert [(d.code, d.message) for d in refusal(nothing, spec(reward)).diagnostics] == [(code, message)]


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@pytest.mark.parametrize("space", sparse(["dict", "box"], 2))
def test_backends_agree_on_nothing(backend: Any, space: str) -> None:
    pytest.importorskip(backend)
    text = DISTRACTED.replace("observation: {", f"observation: {{space: {space}, ")
    for m in (0, 2):
        Agreement(nothing(text, M=m), backend, 5, "SameStep", one=ReferenceEnv).run(12)


def test_nothing_is_seen_as_nothing() -> None:
    env: Any = taskspec.make(nothing(DISTRACTED, M=0))
    seen, _ = env.reset(seed=0)
    assert env.observation_space.shape == (1,) == seen.shape
    assert env.action_space.nvec.tolist() == [2]
    assert [env.step([1])[1] for _ in range(4)] == [1, 2, 3, 3]
    assert {name: np.size(value) for name, value in env.state.items()} == {"s": 1, "noise": 0, "lamps": 0, "wires": 0}
    env.reset(options={"state": {"s": 1, "noise": [], "wires": []}})
    assert env.step([1])[1] == 2


@pytest.mark.parametrize(("space", "expected", "with_two"), [("one_hot", [0, 1, 0, 0], 16), ("multi_discrete", [1], 7)])
def test_nothing_adds_nothing_to_spaces_of_finite_components(space: str, expected: list[int], with_two: int) -> None:
    text = DISTRACTED.replace("observation: {s: s, noise: noise, ", f"observation: {{space: {space}, s: s, ")
    env: Any = taskspec.make(nothing(text, M=0))
    env.reset(seed=0)
    seen = env.step([1])[0]
    assert seen.tolist() == expected
    assert taskspec.make(nothing(text, M=2)).observation_space.shape == (with_two,)


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_reals_may_be_among_ints_where_there_are_none(backend: Any) -> None:
    pytest.importorskip(backend)
    text = DISTRACTED.replace("observation: {s: s, ", "observation: {space: multi_discrete, s: s, ")
    task = nothing(text, M=0)
    assert "noise" in [c.name for c in task.observation.components]
    Agreement(task, backend, 5, "SameStep", one=ReferenceEnv).run(12)


def test_without_its_distractors_a_task_is_solved_exactly() -> None:
    """Of four steps to the right, 1 + 2 + 3 + 3; random ones walk on four places with walls."""
    found = scores(nothing(DISTRACTED, M=0))
    place = np.array([1.0, 0, 0, 0])
    paid = 0.0
    for _ in range(4):
        place = np.array([place[0] + place[1], place[0] + place[2], place[1] + place[3], place[2] + place[3]]) / 2
        paid += float(place @ range(4))
    assert (found.optimal.status, float(found.optimal.value), float(found.expert.value)) == ("exact", 9, 9)
    assert float(found.random.value) == paid


@pytest.mark.parametrize(
    ("old", "new", "section"),
    [
        ("  s: {type: int, low: 0, high: 3}\n", "", "state"),
        ("  u: {type: int, low: 0, high: 1}", "  u: {type: int, low: 0, high: 1, shape: [M]}", "action"),
        ("reward:", "observation: {v: v}\nreward:", "observation"),
    ],
)
def test_a_task_needs_something(old: str, new: str, section: str) -> None:
    text = spec("0").replace(old, new)
    assert refusal(nothing, text).diagnostics[0].message == f"`{section}:` has no element for these parameters"


def test_one_cause_is_reported_once() -> None:
    lines = spec("max(c) + c[s]").replace("horizon: 3\n", "horizon: 3\nterminal: min(c) == 3\n")
    lines = lines.replace("definitions:\n", "definitions:\n  first: c[0]\n")
    (found,) = refusal(build_text, lines).diagnostics
    assert found.code == "E407"
    assert len(found.notes) == 1 and found.notes[0].count("line ") == 2
