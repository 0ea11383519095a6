"""Values of nodes at many points by each backend's own arithmetic: what it generates of them, run on its own numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node, plain
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.programs import scalar as scalars
from taskspec.programs.array_form import ArrayForm, Scratch, arrays
from taskspec.programs.lane_form import LaneEmitter, LaneValue
from taskspec.programs.numba.kernel import EVERYTHING, KernelLane
from taskspec.programs.numpy import _NAMESPACE as NUMPY

Key = tuple[Role, str]
Flat = tuple[Any, ...]
Points = Sequence[Mapping[Key, Flat]]
Values = list[np.ndarray[Any, Any]]
"""For every root an array (elements, points)."""
DTYPES: dict[Kind, Any] = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
Form = Callable[[Builder, Sequence[Node], Mapping[Key, Type], Points], Values]


def _columns(types: Mapping[Key, Type], points: Points, dtypes: Mapping[Kind, Any] = DTYPES) -> dict[Key, Any]:
    return {
        key: np.array([p[key] for p in points], dtypes[t.kind]).T.reshape(*t.shape, len(points))
        for key, t in types.items()
    }


def _spread(found: Sequence[Any], roots: Sequence[Node], n: int) -> Values:
    return [
        np.broadcast_to(np.asarray(v), (*r.type.shape, n)).reshape(r.type.size, n)
        for v, r in zip(found, roots, strict=True)
    ]


def by_reference(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """Fractions are exact in the compiler only: what a task computes with, and pays, are their floats."""
    found = [[tuple(map(plain, flat)) for flat in evaluate(roots, p)] for p in points]
    return [np.array([f[i] for f in found], object).T.reshape(r.type.size, len(points)) for i, r in enumerate(roots)]


def by_lane(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """The scalar environment's code, on Python's numbers."""
    names = {(role, n): LaneValue([n]) if t.is_scalar else LaneValue(packed=n) for (role, n), t in types.items()}
    lane = LaneEmitter(names, {}, b.certain)
    values = lane.emit(roots)
    shown = [
        f"({lane.scalar(r)},)" if r.type.is_scalar else f"tuple({lane.packed(r)})"
        for r, _ in zip(roots, values, strict=True)
    ]
    lines = [f"def form({', '.join(n for _, n in types)}):", *(f"    {x}" for x in lane.finish(results=shown))]
    space = {**scalars.scalar_namespace(), **lane.constants}
    exec("\n".join([*lines, f"    return {', '.join(shown)},"]), space)
    found = [space["form"](*(p[k] if t.shape else p[k][0] for k, t in types.items())) for p in points]
    return [np.array([f[i] for f in found], object).T.reshape(r.type.size, len(points)) for i, r in enumerate(roots)]


def by_batch(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """The arrays of the exact model and of soundness."""
    return _spread(batch.evaluate(roots, _columns(types, points)), roots, len(points))


def by_numpy(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """The generated code of NumPy environments."""
    names = {key: f"x_{key[1]}" for key in types}
    form = ArrayForm(names, lambda d, a: "", scratch=Scratch())
    statements, shown = form.emit(roots)
    made = form.scratch.declarations if form.scratch else []
    space: dict[str, Any] = {**NUMPY, **arrays(form.constants, batch.array), "n": len(points)}
    space |= {names[k]: v for k, v in _columns(types, points).items()}
    with np.errstate(all="ignore"):
        exec("\n".join([*made, *statements, f"result = ({', '.join(shown)},)"]), space)
    return _spread(space["result"], roots, len(points))


def by_jax(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """The generated code of JAX programs, compiled: float32 and int32."""
    import jax

    from taskspec.programs.jax import library, program

    names = {key: f"x_{key[1]}" for key in types}
    form = ArrayForm(names, lambda d, a: "")
    statements, shown = form.emit(roots)
    body = "\n".join(f"    {line}" for line in [*statements, f"return ({', '.join(shown)},)"])
    space: dict[str, Any] = {
        **program._NAMESPACE,
        **arrays(form.constants, program._array),
        "rt": library.RUNTIME,
    }
    exec(f"def f({', '.join(names.values())}):\n{body}", space)
    with np.errstate(all="ignore"):
        columns = _columns(types, points)
        narrow = {"b": np.bool_, "i": np.int32, "f": np.float32}
        found = jax.jit(space["f"])(*(columns[k].astype(narrow[columns[k].dtype.kind]) for k in types))
    return _spread(found, roots, len(points))


def by_numba(b: Builder, roots: Sequence[Node], types: Mapping[Key, Type], points: Points) -> Values:
    """The generated code of compiled kernels, compiled."""
    import numba

    from taskspec.programs.numba import kernel_draws, runtime

    names = {}
    loads = []
    rows = {}
    for key, column in _columns(types, points).items():
        flat = column.reshape(-1, len(points))
        names[key] = LaneValue([f"x_{key[1]}_{k}" for k in range(len(flat))])
        rows |= {f"r_{key[1]}_{k}": np.ascontiguousarray(row) for k, row in enumerate(flat)}
        loads += [f"x_{key[1]}_{k} = r_{key[1]}_{k}[j]" for k in range(len(flat))]
    lane = KernelLane(names, {}, b.certain, unrolled=EVERYTHING)
    atoms = [atom for value in lane.emit(roots) for atom in value.atoms or ()]
    outs = {f"o{i}": np.zeros((r.type.size, len(points)), DTYPES[r.type.kind]) for i, r in enumerate(roots)}
    places = [f"o{i}[{k}, j]" for i, r in enumerate(roots) for k in range(r.type.size)]
    stores = [f"{place} = {atom}" for place, atom in zip(places, atoms, strict=True)]
    body = "\n".join(f"        {line}" for line in [*loads, *lane.finish(stores)])
    space = {
        **vars(math),
        **vars(runtime),
        **vars(kernel_draws),
        **vars(runtime),
        **lane.constants,
        "nan": math.nan,
        "inf": math.inf,
    }
    exec(f"def f(n, {', '.join((*outs, *rows))}):\n    for j in range(n):\n{body}", space)
    numba.njit(error_model="numpy", boundscheck=True)(space["f"])(len(points), *outs.values(), *rows.values())
    return list(outs.values())
