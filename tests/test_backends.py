"""Every operator, distribution and draw on every vector backend, against the reference interpreter."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec.backends.arrayform import ArrayForm, Scratch, arrays
from taskspec.backends.kernel import EVERYTHING, KernelLane
from taskspec.backends.lane import Value
from taskspec.backends.numpy import _NAMESPACE as NUMPY
from taskspec.envs.conformance import Agreement
from taskspec.lang import batch
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Node, Role
from taskspec.lang.ops import TABLE, Op
from taskspec.lang.types import Kind, Type
from taskspec.source import read
from taskspec.spec.build import build
from taskspec.spec.task import Task

BACKENDS = ("numpy", "numba", "jax")
DTYPES = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
EXACT = {"sin", "cos", "tan", "tanh", "exp", "log", "atan2", "pow"}
Values = dict[tuple[Role, str], np.ndarray]
Evaluate = Callable[[Builder, Node, Values], np.ndarray]


# -- one node on each backend -------------------------------------------------------------------------------------


def on_numpy(b: Builder, root: Node, reads: Values) -> np.ndarray:
    names = {key: f"x_{key[1]}" for key in reads}
    form = ArrayForm(names, b.bounds, lambda d, a: "", scratch=Scratch())
    (value,) = form.emit([root])
    n = next(iter(reads.values())).shape[-1]
    lines = [*(form.scratch.declarations if form.scratch else []), *form.lines, f"result = {value}"]
    space = {**NUMPY, **arrays(form.constants, batch.array), "n": n}
    space |= {name: reads[key] for key, name in names.items()}
    with np.errstate(all="ignore"):
        exec("\n".join(lines), space)
    return np.asarray(space["result"])


def on_jax(b: Builder, root: Node, reads: Values) -> np.ndarray:
    pytest.importorskip("jax")
    import jax

    from taskspec.backends.jax import library, program

    names = {key: f"x_{key[1]}" for key in reads}
    form = ArrayForm(names, b.bounds, lambda d, a: "")
    (value,) = form.emit([root])
    body = "\n".join(f"    {line}" for line in [*form.lines, f"return {value}"])
    space = {**program._NAMESPACE, **arrays(form.constants, program._array), "rt": library.RUNTIME}
    exec(f"def f({', '.join(names.values())}):\n{body}", space)
    narrow = {"b": np.bool_, "i": np.int32, "f": np.float32}
    return np.asarray(jax.jit(space["f"])(*(v.astype(narrow[v.dtype.kind]) for v in reads.values())))


def on_numba(b: Builder, root: Node, reads: Values) -> np.ndarray:
    numba = pytest.importorskip("numba")
    from taskspec.backends.numba import basics, draws, operators

    names, loads, arguments = {}, [], []
    for (role, name), value in reads.items():
        rows = value.reshape(-1, value.shape[-1])
        names[role, name] = Value([f"x_{name}_{k}" for k in range(len(rows))])
        arguments += [(f"r_{name}_{k}", np.ascontiguousarray(row)) for k, row in enumerate(rows)]
        loads += [f"x_{name}_{k} = r_{name}_{k}[j]" for k in range(len(rows))]
    lane = KernelLane(names, {}, b.bounds, unrolled=EVERYTHING)
    (value,) = lane.emit([root])
    stores = [f"out[{k}, j] = {atom}" for k, atom in enumerate(value.atoms or [])]
    body = "\n".join(f"        {line}" for line in [*loads, *lane.lines, *stores])
    parameters = ", ".join(name for name, _ in arguments)
    space = {**vars(basics), **vars(draws), **vars(operators), **lane.constants, "nan": math.nan, "inf": math.inf}
    exec(f"def f(n, out, {parameters}):\n    for j in range(n):\n{body}", space)
    n = next(iter(reads.values())).shape[-1]
    out = np.zeros((root.type.size, n), DTYPES[root.type.kind])
    numba.njit(error_model="numpy")(space["f"])(n, out, *(row for _, row in arguments))
    return out.reshape(*root.type.shape, n)


EVALUATE: dict[str, Evaluate] = {"numpy": on_numpy, "numba": on_numba, "jax": on_jax}


# -- operators ----------------------------------------------------------------------------------------------------


def kind_of(value: Any) -> Kind:
    values = value if isinstance(value, tuple) else (value,)
    kinds = [Kind.BOOL if isinstance(v, bool) else Kind.INT if isinstance(v, int) else Kind.REAL for v in values]
    return max(kinds)


def groups(op: Op) -> dict[tuple[Type, ...], list[tuple[Any, ...]]]:
    """The samples of an operator by the types of their arguments."""
    found: dict[tuple[Type, ...], list[tuple[Any, ...]]] = {}
    for sample in op.samples:
        types = tuple(Type(kind_of(v), (len(v),) if isinstance(v, tuple) else ()) for v in sample)
        found.setdefault(types, []).append(sample)
    return found


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("op", TABLE, ids=lambda op: op.name)
def test_operators_mean_what_the_reference_says(op: Op, backend: str) -> None:
    for types, samples in groups(op).items():
        b = Builder()
        nodes = [b.read(Role.STATE, f"n{i}", t) for i, t in enumerate(types)]
        root = b.apply(op.name, *nodes)
        columns = list(zip(*samples, strict=True))
        reads = {
            (Role.STATE, f"n{i}"): np.array(column, DTYPES[t.kind]).T.reshape(*t.shape, len(samples))
            for i, (column, t) in enumerate(zip(columns, types, strict=True))
        }
        actual = EVALUATE[backend](b, root, reads)
        for k, sample in enumerate(samples):
            promoted = [_promoted(v, a.type.kind) for v, a in zip(sample, getattr(root, "args", nodes), strict=False)]
            expected = np.array(op.reference(*promoted))
            tolerance = 2e-6 if backend == "jax" else 1e-14 if op.name in EXACT else 0
            if backend == "numba" and op.name in ("sin", "cos"):
                tolerance = 2e-7 if abs(sample[0]) > 1e6 else 1e-15
            if backend == "jax" and op.name in ("sin", "cos", "tan") and abs(sample[0]) > 1e6:
                continue  # float32 does not hold the argument
            np.testing.assert_allclose(
                actual[..., k].astype(float),
                expected.astype(float),
                rtol=tolerance,
                atol=tolerance,
                err_msg=f"{sample}",
            )


def _promoted(value: Any, kind: Kind) -> Any:
    convert = {Kind.BOOL: bool, Kind.INT: int, Kind.REAL: float}[kind]
    return tuple(map(convert, value)) if isinstance(value, tuple) else convert(value)


# -- draws --------------------------------------------------------------------------------------------------------

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
    return build(read(HEAD + text), None, {}, "")


QUICK = {("numba", "SameStep", 7), ("jax", "Disabled", 7)}
"""Compiling takes a while: one case for each of these is enough for every day."""
CASES = [
    pytest.param(*case, marks=[pytest.mark.slow] if case[0] != "numpy" and case not in QUICK else [])
    for case in product(BACKENDS, ("SameStep", "NextStep", "Disabled"), (1, 7, 64))
]


@pytest.mark.parametrize(("backend", "mode", "lanes"), CASES)
@pytest.mark.parametrize("text", [CONSTANT, DEPENDENT], ids=["constant", "dependent"])
def test_draws_agree_on_all_backends(text: str, backend: str, mode: str, lanes: int) -> None:
    pytest.importorskip(backend)
    Agreement(task_of(text), backend, lanes, mode).run(25)
