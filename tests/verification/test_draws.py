"""Draws: the same values in the same order on every backend."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import CATEGORICAL, DISTS, Dist
from taskspec.language.expressions.types import Kind, Type
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement
from tests.shared.values import BACKENDS, SLOWLY, constant, type_of

HEAD = """
taskspec: 1
name: Draws
title: Draws
summary: Every distribution.
action:
  a: {type: int, low: 0, high: 1}
horizon: 7
reward: 0
"""
CONSTANT = """
state:
  u: {type: real}
  n: {type: real, shape: [3]}
  e: {type: real}
  k: {type: int}
  b: {type: bool}
  c: {type: int, low: 0, high: 2}
  d: {type: real, shape: [3]}
  i: {type: int, low: -2, high: 5}
  p: {type: int, shape: [5], low: 0, high: 4}
  s: {type: int, low: 0, high: 40}
  k2: {type: int}
  ks: {type: int, shape: [3]}
  bs: {type: bool, shape: [4]}
  ps: {type: int, shape: [2, 3], low: 0, high: 2}
  cs: {type: int, shape: [2], low: 0, high: 19}
  x: {type: int, low: -3, high: 7}
initial:
  u: Uniform(-1, 3)
  n: Normal(mean=1, std=2, shape=3)
  e: Exponential(rate=2)
  k: Poisson(rate=4)
  b: Bernoulli(0.3)
  c: "Categorical([1/2, 1/3, 1/6])"
  d: "Dirichlet(alpha=[0.5, 1, 2])"
  i: UniformInt(-2, 5)
  p: Permutation(5)
  s: Uniform({s for s in range(41)})
  k2: Poisson(rate=300)
  ks: "Poisson(rate=[0.5, 0, 200])"
  bs: "Bernoulli([0, 0.2, 0.8, 1])"
  ps: Permutation(3, shape=2)
  cs: "Categorical([k / 190 for k in range(20)], shape=2)"
  x: "Categorical({7: 1/4, -3: 3/4})"
dynamics:
  u': Uniform(-1, 3)
  n': Normal(mean=1, std=2, shape=3)
  e': Exponential(rate=2)
  k': Poisson(rate=4)
  b': Bernoulli(0.3)
  c': "Categorical([1/2, 1/3, 1/6])"
  d': "Dirichlet(alpha=[0.5, 1, 2])"
  i': UniformInt(-2, 5)
  p': Permutation(5)
  s': Uniform({s for s in range(41)})
  k2': Poisson(rate=300)
  ks': "Poisson(rate=[0.5, 0, 200])"
  bs': "Bernoulli([0, 0.2, 0.8, 1])"
  ps': Permutation(3, shape=2)
  cs': "Categorical([k / 190 for k in range(20)], shape=2)"
  x': "Categorical({7: 1/4, -3: 3/4})"
"""
DEPENDENT = """
state:
  m: {type: int, low: 1, high: 3}
  u: {type: real}
  n: {type: real}
  e: {type: real}
  k: {type: int}
  b: {type: bool}
  c: {type: int, low: 0, high: 2}
  r: {type: int, low: 0, high: 2}
  d: {type: real, shape: [2]}
  i: {type: int, low: 0, high: 5}
constants:
  rows: [[0, 1/2, 1/2], [1/3, 1/3, 1/3], [0, 0, 1], [1, 0, 0]]
initial: {m: 1, u: 0, n: "Normal(0, 1)", e: 0, k: 0, b: false, c: 0, r: 0, d: "[0, 0]", i: 0}
dynamics:
  m': 1 + (m + a) % 3
  u': Uniform(0, m)
  n': Normal(mean=m, std=m)
  e': Exponential(rate=m)
  k': Poisson(rate=clip(m * 20, 0, 100))
  b': Bernoulli(m / 4)
  c': "Categorical([m, 1, 2] / (m + 3))"
  r': Categorical(rows[m])
  d': "Dirichlet(alpha=[m / 2, 1])"
  i': UniformInt(0, m + 2)
"""


def task_of(text: str) -> Task:
    return build(read_text(HEAD + text), None, {}, "")


QUICK = {("numba", "SameStep", 7), *(("numpy", mode, lanes) for mode, lanes in (
    ("SameStep", 1), ("NextStep", 7), ("Disabled", 64)))}  # fmt: skip
"""Those of every day: compiling takes a while, and so do 64 scalar environments."""
CASES = [
    pytest.param(*case, marks=[] if case in QUICK else [pytest.mark.slow])
    for case in product(BACKENDS, ("SameStep", "NextStep", "Disabled"), (1, 7, 64))
]


@pytest.mark.parametrize(("backend", "mode", "lanes"), CASES)
@pytest.mark.parametrize("text", [CONSTANT, DEPENDENT], ids=["constant", "dependent"])
def test_draws_agree_on_all_backends(text: str, backend: str, mode: str, lanes: int) -> None:
    pytest.importorskip(backend)
    Agreement(task_of(text), backend, lanes, mode).run(25)


def every_sample(fixed: bool) -> str:
    """A state whose elements are drawn from the samples of the table of distributions, in all shapes.

    Arguments are constants, or state that does not change.
    """
    types = {}
    initial = {}
    dynamics = {}
    for dist in (*DISTS.values(), CATEGORICAL):
        for i, sample in enumerate(dist.samples):
            written = {k: str(list(v) if isinstance(v, tuple) else v) for k, v in sample.items()}
            for a in dist.arguments:
                if a.name in sample and not fixed and not a.static:
                    name = f"{dist.name.lower()}_{i}_{a.name}"
                    values = np.ravel(sample[a.name])
                    types[name] = declared(type_of(sample[a.name]), f", low: {min(values)}, high: {max(values)}")
                    initial[name] = written[a.name]
                    dynamics[name] = name
                    written[a.name] = name
            for shape in ((), (3,), (2, 2)) if dist.shaped else ((),):
                name = f"{dist.name.lower()}_{i}_of_{len(shape)}"
                call = ", ".join(f"{k}={v}" for k, v in written.items()) + (f", shape={shape}" if shape else "")
                types[name] = declared(drawn_type(dist, sample, shape))
                initial[name] = dynamics[name] = f"{dist.name}({call})"
    lines = ["state:", *(f"  {name}: {type_}" for name, type_ in types.items())]
    lines += ["initial:", *(f"  {name}: {text!r}" for name, text in initial.items())]
    return "\n".join([*lines, "dynamics:", *(f"  {name}': {text!r}" for name, text in dynamics.items())])


def declared(type_: Type, more: str = "") -> str:
    return f"{{type: {type_.kind.name.lower()}" + (f", shape: {list(type_.shape)}" if type_.shape else "") + more + "}"


def drawn_type(dist: Dist, sample: Mapping[str, Any], shape: tuple[int, ...]) -> Type:
    b = Builder()
    defaults = {a.name: b.scalar(a.default) for a in dist.arguments if a.default is not None}
    given = {k: b.cast(constant(b, v), Kind.REAL) if k == "p" else constant(b, v) for k, v in sample.items()}
    return dist.build(b, defaults | given, shape).type


@pytest.mark.parametrize("backend", SLOWLY)
@pytest.mark.parametrize("fixed", [True, False], ids=["constant", "read"])
def test_samples_of_distributions_agree(fixed: bool, backend: str) -> None:
    pytest.importorskip(backend)
    Agreement(task_of(every_sample(fixed)), backend, 7, "SameStep").run(12)
