"""Every operator, distribution and draw on every vector backend, against the reference interpreter."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.operators import FUNCTIONS, TABLE, Operator
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.programs.array_form import ArrayForm, Scratch, arrays
from taskspec.programs.lane_form import LaneValue
from taskspec.programs.numba.kernel import EVERYTHING, KernelLane
from taskspec.programs.numpy import _NAMESPACE as NUMPY
from tests.shared.sparse import sparse
from tests.shared.values import BACKENDS, SLOWLY, constant, kind_of, type_of

DTYPES = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
Values = dict[tuple[Role, str], np.ndarray]
Evaluate = Callable[[Builder, Node, Values], np.ndarray]


# -- one node on each backend -------------------------------------------------------------------------------------


def on_numpy(b: Builder, root: Node, reads: Values) -> np.ndarray:
    names = {key: f"x_{key[1]}" for key in reads}
    form = ArrayForm(names, lambda d, a: "", scratch=Scratch())
    statements, (value,) = form.emit([root])
    n = next(iter(reads.values())).shape[-1]
    lines = [*(form.scratch.declarations if form.scratch else []), *statements, f"result = {value}"]
    space = {**NUMPY, **arrays(form.constants, batch.array), "n": n}
    space |= {name: reads[key] for key, name in names.items()}
    with np.errstate(all="ignore"):
        exec("\n".join(lines), space)
    return np.asarray(space["result"])


def on_jax(b: Builder, root: Node, reads: Values) -> np.ndarray:
    pytest.importorskip("jax")
    import jax

    from taskspec.programs.jax import library, program

    names = {key: f"x_{key[1]}" for key in reads}
    form = ArrayForm(names, lambda d, a: "")
    statements, (value,) = form.emit([root])
    body = "\n".join(f"    {line}" for line in [*statements, f"return {value}"])
    space = {**program._NAMESPACE, **arrays(form.constants, program._array), "rt": library.RUNTIME}
    exec(f"def f({', '.join(names.values())}):\n{body}", space)
    narrow = {"b": np.bool_, "i": np.int32, "f": np.float32}
    return np.asarray(jax.jit(space["f"])(*(v.astype(narrow[v.dtype.kind]) for v in reads.values())))


def on_numba(b: Builder, root: Node, reads: Values) -> np.ndarray:
    numba = pytest.importorskip("numba")
    from taskspec.programs.numba import kernel_draws, runtime

    names = {}
    loads = []
    arguments = []
    for (role, name), value in reads.items():
        rows = value.reshape(-1, value.shape[-1])
        names[role, name] = LaneValue([f"x_{name}_{k}" for k in range(len(rows))])
        arguments += [(f"r_{name}_{k}", np.ascontiguousarray(row)) for k, row in enumerate(rows)]
        loads += [f"x_{name}_{k} = r_{name}_{k}[j]" for k in range(len(rows))]
    lane = KernelLane(names, {}, b.certain, unrolled=EVERYTHING)
    (value,) = lane.emit([root])
    stores = [f"out[{k}, j] = {atom}" for k, atom in enumerate(value.atoms or [])]
    body = "\n".join(f"        {line}" for line in [*loads, *lane.finish(stores)])
    parameters = ", ".join(name for name, _ in arguments)
    space = {
        **vars(math),
        **vars(runtime),
        **vars(kernel_draws),
        **vars(runtime),
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


def groups(op: Operator) -> dict[tuple[Type, ...], list[tuple[Any, ...]]]:
    """The samples of an operator by the types of their arguments."""
    found: dict[tuple[Type, ...], list[tuple[Any, ...]]] = {}
    for sample in op.samples:
        types = tuple(Type(kind_of(v), (len(v),) if isinstance(v, tuple) else ()) for v in sample)
        found.setdefault(types, []).append(sample)
    return found


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("op", sparse(TABLE, 4), ids=lambda op: op.name)
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
    types = [type_of(v) for v in sample]
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
