"""Every operator, distribution and draw on every vector backend, against the reference interpreter."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.operators import FUNCTIONS, TABLE, Operator
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.programs.array_form import ArrayForm, Scratch, arrays
from taskspec.programs.lane_form import LaneValue
from taskspec.programs.numba.kernel import EVERYTHING, KernelLane
from taskspec.programs.numpy import _NAMESPACE as NUMPY
from tests.shared.sparse import sparse
from tests.shared.values import (
    BACKENDS,
    SLOWLY,
    Argument,
    Key,
    arguments,
    by_types,
    columns,
    flats,
    reads,
    with_constants,
)

Values = dict[Key, np.ndarray]
Evaluate = Callable[[Builder, Node, Values], np.ndarray]


# -- one node on each backend -------------------------------------------------------------------------------------


def on_numpy(b: Builder, root: Node, values: Values) -> np.ndarray:
    names = {}
    space: dict[str, Any] = dict(NUMPY)
    for (role, name), value in values.items():
        names[role, name] = f"x_{name}"
        space[f"x_{name}"] = value
    scratch = Scratch()
    form = ArrayForm(names, lambda d, a: "", scratch=scratch)
    statements, (result,) = form.emit([root])
    space |= arrays(form.constants, batch.array)
    space["n"] = lanes_of(values)
    with np.errstate(all="ignore"):
        exec("\n".join([*scratch.declarations, *statements, f"result = {result}"]), space)
    return np.asarray(space["result"])


def on_jax(b: Builder, root: Node, values: Values) -> np.ndarray:
    jax = pytest.importorskip("jax")
    from taskspec.programs.jax import library, program

    names = {}
    narrow = {}
    for (role, name), value in values.items():
        names[role, name] = f"x_{name}"
        narrow[f"x_{name}"] = value.astype({"b": np.bool_, "i": np.int32, "f": np.float32}[value.dtype.kind])
    form = program.JaxForm(names, lambda d, a: "")
    statements, (result,) = form.emit([root])
    space = {**program._NAMESPACE, **arrays(form.constants, program._array), "rt": library.RUNTIME}
    exec("\n    ".join([f"def f({', '.join(narrow)}):", *statements, f"return {result}"]), space)
    return np.asarray(jax.jit(space["f"])(**narrow))


def on_numba(b: Builder, root: Node, values: Values) -> np.ndarray:
    numba = pytest.importorskip("numba")
    from taskspec.programs.numba import kernel_draws, runtime

    names = {}
    loads = []
    rows = {}
    for (role, name), value in values.items():
        atoms = []
        for k, row in enumerate(value.reshape(-1, value.shape[-1])):
            atoms.append(f"x_{name}_{k}")
            loads.append(f"x_{name}_{k} = r_{name}_{k}[j]")
            rows[f"r_{name}_{k}"] = np.ascontiguousarray(row)
        names[role, name] = LaneValue(atoms)
    lane = KernelLane(names, {}, b.certain, unrolled=EVERYTHING)
    (result,) = lane.emit([root])
    stores = [f"out[{k}, j] = {atom}" for k, atom in enumerate(result.atoms or [])]
    lines = [f"def f(n, out, {', '.join(rows)}):\n    for j in range(n):", *loads, *lane.finish(stores)]
    space = {**vars(math), **vars(kernel_draws), **vars(runtime), **lane.constants, "nan": math.nan, "inf": math.inf}
    exec("\n        ".join(lines), space)
    n = lanes_of(values)
    out = np.zeros((root.type.size, n), batch.DTYPES[root.type.kind])
    numba.njit(error_model="numpy")(space["f"])(n, out, *rows.values())
    return out.reshape(*root.type.shape, n)


def lanes_of(values: Values) -> int:
    return int(next(iter(values.values())).shape[-1])


EVALUATE: dict[str, Evaluate] = {"numpy": on_numpy, "numba": on_numba, "jax": on_jax}


# -- operators ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("op", sparse(TABLE, 4), ids=lambda op: op.name)
def test_operators_mean_what_the_reference_says(op: Operator, backend: str) -> None:
    for rows in by_types(op.samples):
        agrees(backend, rows, lambda b, nodes: b.apply(op.name, *nodes), op)


def agrees(
    backend: str, rows: list[list[Argument]], make: Callable[[Builder, list[Node]], Node], op: Operator | None = None
) -> None:
    """What `make` builds of arguments means on a backend what it means to the interpreter, on every row of arguments."""
    b = Builder()
    root = make(b, reads(b, rows[0]))
    lanes = EVALUATE[backend](b, root, columns(rows))
    lanes = np.broadcast_to(lanes, (*root.type.shape, len(rows))).reshape(root.type.size, len(rows)).T
    for lane, row in zip(lanes, rows, strict=True):
        (expected,) = evaluate([root], flats(row))
        first = abs(row[0].flat[0])
        is_large = op is not None and op.name in ("sin", "cos", "tan") and first > 1e6
        if backend == "jax" and is_large:
            continue  # float32 does not hold the argument
        tolerance = tolerance_of(backend, op, is_large)
        np.testing.assert_allclose(
            lane.astype(float), np.array(expected, float), rtol=tolerance, atol=tolerance, err_msg=f"{row}"
        )


def tolerance_of(backend: str, op: Operator | None, is_large: bool) -> float:
    if backend == "jax":
        return 2e-6
    if backend == "numba" and op is not None and op.name in ("sin", "cos"):
        return 2e-7 if is_large else 1e-15
    if op is not None and op.precise:
        return 0
    return 1e-14


X = np.arange(1.0, 2001.0)
Y = 1 + X[::-1] % 97
QUOTIENTS: dict[str, tuple[Callable[..., Node], Callable[..., Any]]] = {
    "x / 3": (lambda b, x, y: b.apply("div", x, b.scalar(3.0)), lambda x, y: x / 3),
    "x / 7": (lambda b, x, y: b.apply("div", x, b.scalar(7.0)), lambda x, y: x / 7),
    "x / -2.5": (lambda b, x, y: b.apply("div", x, b.scalar(-2.5)), lambda x, y: x / -2.5),
    "x / y": (lambda b, x, y: b.apply("div", x, y), lambda x, y: x / y),
    "6 / sqrt(x)": (lambda b, x, y: b.apply("div", b.scalar(6.0), b.apply("sqrt", x)), lambda x, y: 6 / np.sqrt(x)),
    "x / y / 7": (lambda b, x, y: b.apply("div", b.apply("div", x, y), b.scalar(7.0)), lambda x, y: x / y / 7),
    "x / (y / 7)": (lambda b, x, y: b.apply("div", x, b.apply("div", y, b.scalar(7.0))), lambda x, y: x / (y / 7)),
    "x / 7 * 7": (
        lambda b, x, y: b.apply("mul", b.apply("div", x, b.scalar(7.0)), b.scalar(7.0)),
        lambda x, y: x / 7 * 7,
    ),
    "ceil(x / 7)": (
        lambda b, x, y: b.apply("ceil", b.apply("div", x, b.scalar(7.0))),
        lambda x, y: [math.ceil(Fraction(int(n), 7)) for n in x],
    ),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("form", QUOTIENTS)
def test_quotients_are_rounded_once(form: str, backend: str) -> None:
    """To the bit, as NumPy divides numbers of the same precision."""
    make, expected = QUOTIENTS[form]
    b = Builder()
    x, y = arguments([X[0], Y[0]])
    root = make(b, *reads(b, [x, y]))
    precision = np.float32 if backend == "jax" else np.float64
    values = EVALUATE[backend](b, root, {x.key: X, y.key: Y})
    assert np.array_equal(values.reshape(-1), expected(X.astype(precision), Y.astype(precision)))


# -- functions and structure --------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", SLOWLY)
@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_mean_what_the_interpreter_says(name: str, backend: str) -> None:
    for sample, static in STRUCTURES[name].samples:
        row = arguments(sample)
        agrees(backend, [row] * 3, lambda b, nodes, static=static: b.structure(name, nodes, static))  # type: ignore[misc]


@pytest.mark.parametrize("backend", SLOWLY)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_mean_what_the_interpreter_says(name: str, backend: str) -> None:
    function = FUNCTIONS[name]
    for sample in function.samples:
        row = arguments(sample)

        def make(b: Builder, nodes: list[Node], row: Sequence[Argument] = row) -> Node:
            return function.build(b, with_constants(b, nodes, row, function.static))

        agrees(backend, [row] * 3, make)
