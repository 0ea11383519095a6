"""Each distribution that is written is one draw, however often the meaning of what it stands in uses it.

`D` in an expression below is one written draw of 0, 1, 2 or 3; what the reward is worth on average is worked out here
from a function of as many independent draws as are written.
"""

import json
import math
import re
from collections.abc import Callable
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec.envs.vector import VectorEnvironment
from taskspec.exact import extract
from taskspec.language.expressions.ir import draws
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.solved import random_return

HEAD = """
constants: {v: "[4, 5, 6, 7]", m: "[[0, 1], [2, 3], [4, 5], [6, 7]]"}
definitions:
  "square(x)": x * x
  "between(x)": 0 < x < 3
  "either(x, y)": x if x > y else y
  "fourth(x)": square(square(x))
noise:
  n: D
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: bool}}
initial: {s: 2}
horizon: 1
"""
CASES: list[tuple[str, Callable[..., Any]]] = [
    # comparisons
    ("1 <= D <= 1", lambda d: d == 1),
    ("0 < D < 3", lambda d: 0 < d < 3),
    ("3 > D >= 1", lambda d: 3 > d >= 1),
    ("s == D == 2", lambda d: d == 2),
    ("1 <= D == s", lambda d: d == 2),
    ("0 != D != 3", lambda d: d not in (0, 3)),
    ("D in {1, 2}", lambda d: d in (1, 2)),
    ("D not in {1, 2, 3}", lambda d: d == 0),
    ("0 < D in {0, 1, 5}", lambda d: d == 1),
    ("(D, 1) in {(0, 1), (2, 1)}", lambda d: d in (0, 2)),
    ("s in {D, 0}", lambda d: d == 2),
    ("s <= D < D <= 3", lambda d, e: 2 <= d < e),
    ("D < D", lambda d, e: d < e),
    ("D == D", lambda d, e: d == e),
    # functions that use an argument more than once
    ("clip(D, 1, 2)", lambda d: min(max(d, 1), 2)),
    ("clip(1, D, 2)", lambda d: min(max(1, d), 2)),
    ("min(D, 2, 1 + D)", lambda d, e: min(d, 2, 1 + e)),
    ("max(1, D, 2)", lambda d: max(1, d, 2)),
    ("abs(D - 2)", lambda d: abs(d - 2)),
    ("sign(D - 1)", lambda d: (d > 1) - (d < 1)),
    ("where(D > 1, D, 9)", lambda d, e: e if d > 1 else 9),
    ("D if D == 2 else 7", lambda d, e: d if e == 2 else 7),
    ("norm2((D, 0))", lambda d: d),
    ("dot((D, 1), (1, 2))", lambda d: d + 2),
    ("sum(cumsum((D, 1)))", lambda d: 2 * d + 1),
    ("sort((D, 1, 2))[1]", lambda d: sorted((d, 1, 2))[1]),
    ("argmax((D, 1, 2))", lambda d: [d, 1, 2].index(max(d, 1, 2))),
    ("onehot(D, 3)[1]", lambda d: d == 1),
    ("v[D]", lambda d: 4 + d),
    ("v[D - 2]", lambda d: [4, 5, 6, 7][max(d - 2, 0)]),
    ("m[D, 1]", lambda d: 2 * d + 1),
    ("sum(m[D])", lambda d: 4 * d + 1),
    ("swap(v, D, 0)[0]", lambda d: 4 + d),
    ("swap(v, D, D)[0]", lambda d, e: 4 + (e if d == 0 else d if e == 0 else 0)),
    ("put(v, D, 0)[1]", lambda d: 0 if d == 1 else 5),
    ("put(v, 0, D)[0]", lambda d: d),
    ("sum(concat(v, D))", lambda d: 22 + d),
    ("sum([D for i in range(2)])", lambda d, e: d + e),  # each element draws for itself
    # powers
    ("D ** 2", lambda d: d**2),
    ("D ** 5", lambda d: d**5),
    ("(D + 1) ** -2", lambda d: Fraction(1, (d + 1) ** 2)),
    ("2 ** D", lambda d: 2**d),
    # definitions
    ("square(D)", lambda d: d * d),
    ("fourth(D)", lambda d: d**4),
    ("between(D)", lambda d: 0 < d < 3),
    ("either(D, 1)", lambda d: max(d, 1)),
    ("either(D, D)", lambda d, e: max(d, e)),
    ("n * n + n", lambda d: d * d + d),
    # arguments of distributions
    ("UniformInt(D, 3)", lambda d: Fraction(d + 3, 2)),
    ("Bernoulli(D / 3)", lambda d: Fraction(d, 3)),
    ("Categorical({D: 1/2, 5: 1/2})", lambda d: Fraction(d + 5, 2)),
    ("Uniform({D, 8})", lambda d: Fraction(d + 8, 2)),
    # next states
    ("s' * s'", lambda d: d * d),
]


PRIME = "'"
OTHERS = re.compile(r"UniformInt|Uniform|Categorical|Bernoulli")


def task_of(rest: str) -> Task:
    return build_text(re.sub(r"\bD\b", "UniformInt(0, 3)", HEAD + rest))


def average(value: Callable[..., Any]) -> Fraction:
    outcomes = [Fraction(value(*point)) for point in product(range(4), repeat=value.__code__.co_argcount)]
    return sum(outcomes, Fraction(0)) / len(outcomes)


@for_each(("text", "value"), CASES)
def test_what_is_written_once_is_drawn_once(text: str, value: Callable[..., Any]) -> None:
    task = task_of(f"dynamics:\n  s': {'D' if PRIME in text else 's'}\nreward: {json.dumps(text)}\n")
    assert len(draws([*task.process.next, task.process.reward])) == value.__code__.co_argcount + len(
        OTHERS.findall(text)
    )
    assert random_return(extract(task)) == pytest.approx(float(average(value)), rel=1e-12)


TABLES = """
dynamics:
  s':
    by: ["D", a]
    rows: {0: {true: 3, false: 3}, 1: 2, else: {true: {0: 1/2, "D": 1/2}, false: 2}}
terminal: 0 < D < 3
observation: {o: s, p: "1 <= D <= 2", q: "clip(D, 1, 2)"}
reward:
  - {if: "0 < D <= 2", then: "square(D)"}
  - {if: "D == 1", then: 7}
  - else: D
"""


def test_tables_and_cases_draw_what_they_write() -> None:
    task = task_of(TABLES)
    written = [
        draws([node])
        for node in (task.process.next[0], task.process.terminal, *task.observation.nodes, task.process.reward)
    ]
    assert [len(found) for found in written] == [3, 1, 0, 1, 1, 4]
    # The first case holds with 1/2 and pays the square of another draw, 14/4 on average; the second with 1/4 of the rest.
    expected = Fraction(1, 2) * Fraction(14, 4) + Fraction(1, 2) * (Fraction(7, 4) + Fraction(3, 4) * Fraction(3, 2))
    assert random_return(extract(task)) == pytest.approx(float(expected), rel=1e-12)


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_backends_draw_them_alike(backend: str) -> None:
    pytest.importorskip(backend)
    Agreement(task_of(TABLES), backend, 40, "SameStep", 3, ReferenceEnv, states=True).run(6)


def test_samples_of_a_chain_have_the_frequency_of_one_draw() -> None:
    task = task_of("dynamics: {s': s}\nreward: 1 <= D <= 1\n")
    env = VectorEnvironment(task, 4096, backend="numpy")
    env.reset(seed=0)
    held = env.step(np.zeros(4096, int))[1].sum()
    assert abs(held - 1024) < 5 * math.sqrt(4096 * 3 / 16)
