"""Parts of matrices, elements replaced, other shapes, products, and vectors with several `for`s: beside NumPy."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv

SPEC = """
taskspec: 1
name: Matrices
constants:
  k: [[5, 7, 1], [2, 0, 3]]
state:
  m: {type: int, low: -9, high: 9, shape: [2, 3]}
  w: {type: real, low: -9, high: 9, shape: [3]}
  i: {type: int, low: -1, high: 3}
action:
  a: {type: int, low: 0, high: 1}
horizon: 40
initial: {m: "reshape(range_, (2, 3))", w: "(0.5, -1, 2)", i: 0}
definitions:
  range_: "[p - 2 for p in range(6)]"
observation:
OBSERVED
dynamics:
  m': "put(m, (a, i), clip(m[a, i] * -2 + i + a, -9, 9))"
  i': i + 1 if i < 3 else -1
reward: sum(m[:, i])
"""
K = np.array([[5, 7, 1], [2, 0, 3]])
OBSERVED: dict[str, Callable[[Any, Any, int, int], Any]] = {  # of m, w, i, and the column nearest to i
    "m[:, 0]": lambda m, w, i, c: m[:, 0],
    "m[:, -1]": lambda m, w, i, c: m[:, -1],
    "m[:, i]": lambda m, w, i, c: m[:, c],
    "m[1, ::-1]": lambda m, w, i, c: m[1, ::-1],
    "m[i, 1:]": lambda m, w, i, c: m[min(max(i, 0), 1), 1:],
    "m[::-1, :2]": lambda m, w, i, c: m[::-1, :2],
    "w if len(w) == 3 else m[0, :2]": lambda m, w, i, c: w,
    "w if len(w) < 3 else m[0, :2] if pi > 3 else m": lambda m, w, i, c: m[0, :2],
    "m[:, 1:][0]": lambda m, w, i, c: m[0, 1:],
    "k[:, i]": lambda m, w, i, c: K[:, c],
    "k[1:, ::2]": lambda m, w, i, c: K[1:, ::2],
    "put(m, (0, -1), 7)": lambda m, w, i, c: np.vstack([[*m[0, :2], 7], m[1]]),
    "put(k, (1, 9), 0.5)": lambda m, w, i, c: np.vstack([K[0], [2, 0, 0.5]]),
    "put(m, (i, i), -i)": lambda m, w, i, c: replaced(m, min(max(i, 0), 1), c, -i),
    "put(m, [1, 0], i)": lambda m, w, i, c: replaced(m, 1, 0, i),
    "put(m, 1, w)": lambda m, w, i, c: np.vstack([m[0], w]),
    "reshape(m, 6)": lambda m, w, i, c: m.reshape(6),
    "reshape(m, (3, 2))[2]": lambda m, w, i, c: m.reshape(3, 2)[2],
    "reshape(w, (3, 1))": lambda m, w, i, c: w.reshape(3, 1),
    "dot(m, w)": lambda m, w, i, c: m @ w,
    "dot((1, i), m)": lambda m, w, i, c: np.array([1, i]) @ m,
    "dot(m, reshape(k, (3, 2)))": lambda m, w, i, c: m @ K.reshape(3, 2),
    "dot(k, w)": lambda m, w, i, c: K @ w,
    "[p * i + q for p in range(2) for q in range(p, 3)]": lambda m, w, i, c: [
        p * i + q for p in range(2) for q in range(p, 3)
    ],
    "[m[p, q] for (p, q) in {(0, 1), (1, 2)} for r in range(2) if p + r < 2]": lambda m, w, i, c: [
        m[0, 1], m[0, 1], m[1, 2],
    ],
    "count([k[p, q] < k[r, q] for p in range(2) for r in range(2) if p != r for q in range(3)])": lambda m, w, i, c: 3,
}  # fmt: skip


def replaced(m: Any, row: int, column: int, value: Any) -> Any:
    found = np.array(m, float)
    found[row, column] = value
    return found


def matrices() -> Task:
    lines = [f"  o{n}: '{text}'" for n, text in enumerate(OBSERVED)]
    return build(read_text(SPEC.replace("OBSERVED", "\n".join(lines))))


def split(task: Task, seen: Any) -> list[Any]:
    """An observation, by component."""
    return np.split(seen, np.cumsum([c.type.size for c in task.observation.components])[:-1])


def test_parts_are_those_of_numpy() -> None:
    task = matrices()
    env: Any = taskspec.make(task)
    seen, _ = env.reset(seed=0)
    m = np.arange(-2, 4).reshape(2, 3)
    w = np.array([0.5, -1, 2])
    i = 0
    for a in itertools.islice(itertools.cycle((0, 1, 1, 0, 1)), 30):
        c = min(max(i, 0), 2)
        for text, part in zip(OBSERVED, split(task, seen), strict=True):
            expected = np.asarray(OBSERVED[text](m, w, i, c), float).reshape(-1)
            np.testing.assert_allclose(part, expected, rtol=1e-6, err_msg=f"{text} for i = {i}")
        seen, reward, *_ = env.step(a)
        assert reward == m[:, c].sum()
        m = replaced(m, a, c, np.clip(m[a, c] * -2 + i + a, -9, 9))
        i = i + 1 if i < 3 else -1


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_backends_agree(backend: Any) -> None:
    pytest.importorskip(backend)
    Agreement(matrices(), backend, 4, "SameStep", one=ReferenceEnv).run(40)


@pytest.mark.parametrize(
    ("reward", "code", "words"),
    [
        ("sum(m[:, 3])", "E315", "index 3 is outside a vector of 3"),
        ("sum(m[:, a, 0])", "E307", "cannot take 3 indices"),
        ("sum(m[(0, 1), :])", "E307", "each of several indices must be an int or a slice"),
        ("sum(w if a == 1 else m[0, :2])", "E307", "the shapes [3] and [2] do not match"),
        ("m[:, 0]", "E307", "the reward is a single number, but this has shape [2]"),
        ("sum(put(m, (0, 1, 1), 1))", "E306", "`put` needs an int as index, not int vector [3]"),
        ("sum(put(m, (0.5, 1), 1))", "E306", "`put` needs an int as index, not real"),
        ("sum(put(m, (0, 1), w))", "E307", "`put` cannot place"),
        ("sum(reshape(m, (2, 2)))", "E307", "`reshape` cannot arrange 6 elements as [2, 2]"),
        ("sum(reshape(m, a + 6))", "E312", "'shape' of reshape must be a constant"),
        ("sum(reshape(m, 0))", "E307", "elements"),
        ("sum(reshape(a, 1))", "E306", "`reshape` needs a vector"),
        ("sum(dot(w, m))", "E307", "the shapes [3] and [2, 3] do not match"),
        ("dot(w, 2)", "E306", "`dot` needs vectors or matrices, not int"),
        ("sum([p for p in range(200) for q in range(200)])", "E314", "40,000 elements to write out"),
        ("sum([p for p in range(3) for p2 in range(a)])", "E312", "must be a constant"),
    ],
)
def test_what_does_not_fit_is_said(reward: str, code: str, words: str) -> None:
    text = SPEC.replace("observation:\nOBSERVED\n", "").replace("reward: sum(m[:, i])", f"reward: '{reward}'")
    with pytest.raises(SpecError) as found:
        build(read_text(text))
    assert [d.code for d in found.value.diagnostics] == [code]
    assert words in found.value.diagnostics[0].message
