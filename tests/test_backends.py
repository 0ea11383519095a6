"""Every operator, distribution and draw on every vector backend, against the reference interpreter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec.backends.emit.arrayform import ArrayForm, Scratch, arrays
from taskspec.backends.emit.lanevalues import LaneValue
from taskspec.backends.numba.kernel import EVERYTHING, KernelLane
from taskspec.backends.numpy.engine import _NAMESPACE as NUMPY
from taskspec.envs.conformance import Agreement
from taskspec.lang import batch
from taskspec.lang.builder import Builder
from taskspec.lang.dists import CATEGORICAL, DISTS, Dist
from taskspec.lang.evaluate import evaluate
from taskspec.lang.ir import Node, Role
from taskspec.lang.operators import FUNCTIONS, TABLE, Operator
from taskspec.lang.operators.structure import STRUCTURES
from taskspec.lang.types import Kind, Type
from taskspec.source import read
from taskspec.task.build import build
from taskspec.task.task import Task

BACKENDS = ("numpy", "numba", "jax")
SLOWLY = ("numpy", *(pytest.param(backend, marks=pytest.mark.slow) for backend in ("numba", "jax")))
DTYPES = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
Values = dict[tuple[Role, str], np.ndarray]
Evaluate = Callable[[Builder, Node, Values], np.ndarray]


# -- one node on each backend -------------------------------------------------------------------------------------


def on_numpy(b: Builder, root: Node, reads: Values) -> np.ndarray:
    names = {key: f"x_{key[1]}" for key in reads}
    form = ArrayForm(names, lambda d, a: "", scratch=Scratch())
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
    form = ArrayForm(names, lambda d, a: "")
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
        names[role, name] = LaneValue([f"x_{name}_{k}" for k in range(len(rows))])
        arguments += [(f"r_{name}_{k}", np.ascontiguousarray(row)) for k, row in enumerate(rows)]
        loads += [f"x_{name}_{k} = r_{name}_{k}[j]" for k in range(len(rows))]
    lane = KernelLane(names, {}, b.certain, unrolled=EVERYTHING)
    (value,) = lane.emit([root])
    stores = [f"out[{k}, j] = {atom}" for k, atom in enumerate(value.atoms or [])]
    body = "\n".join(f"        {line}" for line in [*loads, *lane.lines, *stores])
    parameters = ", ".join(name for name, _ in arguments)
    space = {
        **vars(math),
        **vars(basics),
        **vars(draws),
        **vars(operators),
        **lane.constants,
        "nan": math.nan,
        "inf": math.inf,
    }
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


def groups(op: Operator) -> dict[tuple[Type, ...], list[tuple[Any, ...]]]:
    """The samples of an operator by the types of their arguments."""
    found: dict[tuple[Type, ...], list[tuple[Any, ...]]] = {}
    for sample in op.samples:
        types = tuple(Type(kind_of(v), (len(v),) if isinstance(v, tuple) else ()) for v in sample)
        found.setdefault(types, []).append(sample)
    return found


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("op", TABLE, ids=lambda op: op.name)
def test_operators_mean_what_the_reference_says(op: Operator, backend: str) -> None:
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
            tolerance = 2e-6 if backend == "jax" else 0 if op.precise else 1e-14
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


# -- functions and structure --------------------------------------------------------------------------------------


def agrees(backend: str, sample: Sequence[Any], make: Callable[[Builder, list[Node]], Node]) -> None:
    """What `make` builds of arguments means on a backend what it means to the interpreter."""
    types = [_type_of(v) for v in sample]
    flats = [tuple(np.ravel(np.array(v, object))) for v in sample]
    b = Builder()
    root = make(b, [b.read(Role.STATE, f"n{i}", t) for i, t in enumerate(types)])
    keys = [(Role.STATE, f"n{i}") for i in range(len(sample))]
    (expected,) = evaluate([root], dict(zip(keys, flats, strict=True)))
    columns = [np.array(f, DTYPES[t.kind]).reshape(*t.shape, 1) for f, t in zip(flats, types, strict=True)]
    reads = {key: np.repeat(c, 3, axis=-1) for key, c in zip(keys, columns, strict=True)}
    found = np.broadcast_to(EVALUATE[backend](b, root, reads), (*root.type.shape, 3)).reshape(root.type.size, 3)
    tolerance = 2e-6 if backend == "jax" else 1e-14
    for lane in found.T:
        np.testing.assert_allclose(lane.astype(float), np.array(expected, float), rtol=tolerance, atol=tolerance)


def _type_of(value: Any) -> Type:
    array = np.array(value, object)
    return Type(kind_of(tuple(array.flat)), array.shape)


@pytest.mark.parametrize("backend", SLOWLY)
@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_mean_what_the_interpreter_says(name: str, backend: str) -> None:
    for sample, static in STRUCTURES[name].samples:
        agrees(backend, sample, lambda b, nodes, static=static: b.structure(name, nodes, static))  # type: ignore[misc]


@pytest.mark.parametrize("backend", SLOWLY)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_mean_what_the_interpreter_says(name: str, backend: str) -> None:
    function = FUNCTIONS[name]
    for sample in function.samples:

        def make(b: Builder, nodes: list[Node], sample: Sequence[Any] = sample) -> Node:
            return function.build(
                b, [constant(b, sample[i]) if i in function.static else n for i, n in enumerate(nodes)]
            )

        agrees(backend, sample, make)


def constant(b: Builder, value: Any) -> Node:
    type_ = _type_of(value)
    return b.const(tuple(np.array(value, object).flat) if type_.shape else value, type_)


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


def every_sample(fixed: bool) -> str:
    """A state whose elements are drawn from the samples of the table of distributions, in all shapes.

    Arguments are constants, or state that does not change.
    """
    types, initial, dynamics = {}, {}, {}
    for dist in (*DISTS.values(), CATEGORICAL):
        for i, sample in enumerate(dist.samples):
            written = {k: str(list(v) if isinstance(v, tuple) else v) for k, v in sample.items()}
            for a in dist.arguments:
                if a.name in sample and not fixed and not a.static:
                    name, values = f"{dist.name.lower()}_{i}_{a.name}", np.ravel(sample[a.name])
                    types[name] = declared(_type_of(sample[a.name]), f", low: {min(values)}, high: {max(values)}")
                    initial[name], dynamics[name] = written[a.name], name
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
    Agreement(task_of(every_sample(fixed)), backend, 7, "SameStep").run(25)
