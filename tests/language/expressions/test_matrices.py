"""Parts of matrices, elements replaced, other shapes, products, and vectors with several `for`s: beside NumPy."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.sections import build_text

SPEC = """
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
    return build_text(SPEC.replace("OBSERVED", "\n".join(lines)))


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
    Agreement(matrices(), backend, 4, "SameStep", one=ReferenceEnv).run(15)
