"""The operator tables: every entry, on its samples and at awkward points, means the same in every form.

Reference interpreter, generated lane code, array form and constant folding are compared; so are the bounds that intervals
promise. A new entry of a table is tested without touching this file.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Apply, Const, Node, Read, rewrite, walk
from taskspec.language.expressions.operators import FUNCTIONS, OPERATORS
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.language.expressions.variates import WordLayout, batch_sampler, sampler, words_of
from taskspec.programs import scalar
from taskspec.programs.lane_form import LaneEmitter, LaneValue
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse

Flat = tuple[Any, ...]
NAN = math.nan
INF = math.inf
POINTS: dict[Kind, Flat] = {
    Kind.BOOL: (True, False),
    Kind.INT: (0, 1, -1, 2, -7, 5, 2**31 - 1, -(2**31)),
    Kind.REAL: (0.0, -0.0, 1.0, -1.0, 2.5, -0.5, 3.5, 1e9, 1e300, -1e300, 5e-324, INF, -INF, NAN),
}
LENGTHS = (3, 20)  # written out element by element, and looped over


@dataclass(frozen=True)
class Argument:
    """A value with its type: flat, row-major."""

    flat: Flat
    type: Type

    @classmethod
    def of(cls, value: Any) -> Argument:
        shape = []
        inner = value
        while isinstance(inner, tuple):
            shape.append(len(inner))
            inner = inner[0]
        flat = _flat(value)
        kinds = {Kind.REAL if isinstance(v, float) else Kind.BOOL if isinstance(v, bool) else Kind.INT for v in flat}
        kind = max(kinds)
        return cls(
            tuple({Kind.BOOL: bool, Kind.INT: int, Kind.REAL: float}[kind](v) for v in flat), Type(kind, tuple(shape))
        )


def _flat(value: Any) -> Flat:
    return tuple(x for v in value for x in _flat(v)) if isinstance(value, tuple) else (value,)


def reads(b: Builder, arguments: Sequence[Argument]) -> list[Node]:
    return [b.read(Role.VARIABLE, f"a{i}", a.type) for i, a in enumerate(arguments)]


def constants(b: Builder, arguments: Sequence[Argument]) -> list[Node]:
    return [b.const(a.flat if a.type.shape else a.flat[0], a.type) for a in arguments]


# -- the forms --------------------------------------------------------------------------------------------------------


def by_reference(node: Node, arguments: Sequence[Argument]) -> Flat:
    return evaluate([node], {(Role.VARIABLE, f"a{i}"): a.flat for i, a in enumerate(arguments)})[0]


def by_lane(b: Builder, node: Node, arguments: Sequence[Argument], words: Sequence[int] = ()) -> Flat:
    """The node as generated code, in a module of its own."""
    names = {
        (Role.VARIABLE, f"a{i}"): LaneValue([f"a{i}"]) if a.type.is_scalar else LaneValue(packed=f"a{i}")
        for i, a in enumerate(arguments)
    }
    layout = WordLayout.of([node])
    word_names = {d.site: [f"w{layout.first[d.site] + k}" for k in range(words_of(d))] for d in layout.draws}
    lane = LaneEmitter(names, word_names, b.certain)
    (value,) = lane.emit([node])
    result = f"({value.atoms[0]},)" if node.type.is_scalar and value.atoms else f"tuple({lane.packed(node)})"
    parameters = [f"a{i}" for i in range(len(arguments))] + [f"w{k}" for k in range(layout.count)]
    source = "\n".join(
        [
            f"def form({', '.join(parameters)}):",
            *(f"    {x}" for x in lane.finish(results=[result])),
            f"    return {result}",
        ]
    )
    namespace = {**scalar.scalar_namespace(), **lane.constants}
    exec(source, namespace)
    values = [a.flat[0] if a.type.is_scalar else a.flat for a in arguments]
    return namespace["form"](*values, *words)  # type: ignore[no-any-return]


def by_array(node: Node, rows: Sequence[Sequence[Argument]]) -> list[Flat]:
    """The node over a batch with one lane for every row of arguments."""
    values = {}
    for i, a in enumerate(rows[0]):
        columns = np.array([row[i].flat for row in rows], batch.DTYPES[a.type.kind]).T
        values[Role.VARIABLE, f"a{i}"] = columns.reshape(*a.type.shape, len(rows))
    (found,) = batch.evaluate([node], values)
    flat = np.broadcast_to(found, (*node.type.shape, len(rows))).reshape(node.type.size, len(rows))
    return [tuple(column) for column in flat.T.tolist()]


def close(found: Any, expected: Any, exact: bool) -> bool:
    if expected != expected:
        return bool(found != found)
    if found == expected:
        return bool(expected != 0 or math.copysign(1, found) == math.copysign(1, expected))
    return not exact and math.isfinite(expected) and bool(abs(found - expected) <= 4e-16 * abs(expected))


def agree(found: Flat, expected: Flat, node: Node, exact: bool = True) -> bool:
    kinds = {Kind.BOOL: bool, Kind.INT: int, Kind.REAL: float}
    right = all(type(f) is kinds[node.type.kind] for f in found)
    return right and len(found) == len(expected) and all(map(close, found, expected, [exact] * len(found)))


def inexact(node: Node) -> bool:
    return any(isinstance(n, Apply) and n.op in OPERATORS and not OPERATORS[n.op].precise for n in walk([node]))


def check(b: Builder, node: Node, rows: Sequence[Sequence[Argument]], make: Any) -> None:
    """All forms of a node on rows of arguments of the same types."""
    arrays = by_array(node, rows)
    for arguments, array in zip(rows, arrays, strict=True):
        expected = by_reference(node, arguments)
        shown = (node, [a.flat for a in arguments], expected)
        lane = by_lane(b, node, arguments)
        assert agree(lane, expected, node), ("lane", lane, shown)
        assert agree(array, expected, node, not inexact(node)), ("array", array, shown)
        folded = make(b, constants(b, arguments))
        assert isinstance(folded, Const)
        pairs = zip(folded.flat, expected, strict=True)
        unsigned = tuple(
            v + 0.0 if isinstance(f, Fraction) else v for f, v in pairs
        )  # a fraction that is 0 has no sign
        assert agree(tuple(batch.array(folded)[..., 0].ravel().tolist()), unsigned, node), ("folded", folded, shown)
        low, high = b.bounds(make(b, bounded(b, arguments)))
        assert all(low <= v <= high or v != v for v in expected), ("bounds", (low, high), shown)


def bounded(b: Builder, arguments: Sequence[Argument]) -> list[Node]:
    """Reads that are known to be where the arguments are."""
    nodes = []
    for i, a in enumerate(arguments):
        numbers = [v for v in a.flat if v == v]
        edge = (min(numbers), max(numbers)) if numbers else (-INF, INF)
        nodes.append(b.read(Role.VARIABLE, f"b{i}", a.type, *edge))
    return nodes


# -- operators --------------------------------------------------------------------------------------------------------


def by_types(rows: Sequence[Sequence[Argument]]) -> list[list[Sequence[Argument]]]:
    groups: dict[Any, list[Sequence[Argument]]] = {}
    for row in rows:
        groups.setdefault(tuple(a.type for a in row), []).append(row)
    return list(groups.values())


def apply_to(name: str) -> Any:
    return lambda b, nodes: b.apply(name, *nodes)


@for_each("name", OPERATORS)
def test_samples_of_operators(name: str) -> None:
    for rows in by_types([[Argument.of(v) for v in sample] for sample in OPERATORS[name].samples]):
        b = Builder()
        check(b, b.apply(name, *reads(b, rows[0])), rows, apply_to(name))


def awkward(name: str) -> list[list[Sequence[Argument]]]:
    """Rows of awkward numbers of every combination of kinds that an elementwise operator takes."""
    arity = len(OPERATORS[name].samples[0])
    groups: list[list[Sequence[Argument]]] = []
    for kinds in itertools.product(Kind, repeat=arity):
        if isinstance(OPERATORS[name].rule(tuple(Type(k) for k in kinds)), Type):
            points = itertools.product(*(POINTS[k] for k in kinds))
            rows: list[Sequence[Argument]] = [
                [Argument((v,), Type(k)) for v, k in zip(p, kinds, strict=True)] for p in points
            ]
            groups.append(rows[:: 1 + len(rows) // 400])
    return groups


ELEMENTWISE = [name for name, op in OPERATORS.items() if op.elementwise]


@for_each("name", ELEMENTWISE)
def test_awkward_points_of_operators(name: str) -> None:
    for rows in awkward(name):
        b = Builder()
        check(b, b.apply(name, *reads(b, rows[0])), rows, apply_to(name))


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("name", ELEMENTWISE)
def test_operators_on_vectors(name: str, length: int) -> None:
    """Element by element, with a vector in each place alone and in all, and with the shape (2, length / 2)."""
    for rows in awkward(name):
        arity = len(rows[0])
        for stretched in {*((i,) for i in range(arity)), tuple(range(arity))}:
            row = []
            for i, a in enumerate(rows[0]):
                column = [r[i].flat[0] for r in itertools.islice(itertools.cycle(rows[:: 1 + len(rows) // 37]), length)]
                row.append(Argument(tuple(column), Type(a.type.kind, (length,))) if i in stretched else rows[-2][i])
            b = Builder()
            check(b, b.apply(name, *reads(b, row)), [row, row], apply_to(name))


REDUCTIONS = [name for name, op in OPERATORS.items() if not op.elementwise]


@pytest.mark.parametrize("shape", [(1,), (2,), (5,), (16,), (17,), (40,), (70,), (3, 4), (5, 8)])
@pytest.mark.parametrize("name", REDUCTIONS)
def test_reductions_of_vectors(name: str, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(7)
    for kind in Kind:
        type_ = Type(kind, shape)
        if not isinstance(OPERATORS[name].rule((type_,)), Type):
            continue
        points = [
            p for p in POINTS[kind] if kind is Kind.REAL or abs(p) < 1000
        ]  # what would not fit 64 bits is elsewhere
        rows = [
            [Argument(tuple(points[i] for i in rng.integers(0, len(points), type_.size)), type_)] for _ in range(12)
        ]
        b = Builder()
        check(b, b.apply(name, *reads(b, rows[0])), rows, apply_to(name))


@pytest.mark.parametrize("name", STRUCTURES)
def test_samples_of_structure(name: str) -> None:
    assert STRUCTURES[name].samples
    for sample, static in STRUCTURES[name].samples:
        row = [Argument.of(v) for v in sample]
        b = Builder()

        def make(b: Builder, nodes: Sequence[Node], static: tuple[int, ...] = static) -> Node:
            return b.structure(name, list(nodes), static)

        check(b, make(b, reads(b, row)), [row, row, row], make)


# -- functions --------------------------------------------------------------------------------------------------------


@for_each("name", FUNCTIONS)
def test_axes_of_functions_are_those_of_what_they_give(name: str) -> None:
    for sample in FUNCTIONS[name].samples:
        b = Builder()
        nodes = constants(b, [Argument.of(v) for v in sample])
        found = FUNCTIONS[name].build(b, nodes)
        assert FUNCTIONS[name].axes([len(n.type.shape) for n in nodes]) == len(found.type.shape), sample


@for_each("name", FUNCTIONS)
def test_samples_of_functions(name: str) -> None:
    function = FUNCTIONS[name]
    assert function.samples
    for sample in function.samples:
        row = [Argument.of(v) for v in sample]

        def make(b: Builder, nodes: Sequence[Node], row: Sequence[Argument] = row) -> Node:
            fixed = [constants(b, row)[i] if i in function.static else n for i, n in enumerate(nodes)]
            return function.build(b, fixed)

        b = Builder()
        check(b, make(b, reads(b, row)), [row, row], make)


# -- distributions ----------------------------------------------------------------------------------------------------

EVERY = {**DISTS, CATEGORICAL.name: CATEGORICAL}
COUNT = 64


def cases() -> list[tuple[str, Any, tuple[int, ...]]]:
    found: list[tuple[str, Any, tuple[int, ...]]] = []
    for name, dist in EVERY.items():
        assert dist.samples, f"{name} has no samples"
        found += [
            (name, sample, shape) for sample in dist.samples for shape in (((), (3,), (2, 2)) if dist.shaped else ((),))
        ]
    return found


@pytest.mark.parametrize("fixed", [True, False], ids=["constant", "read"])
@pytest.mark.parametrize(("name", "sample", "shape"), sparse(cases(), 3))
def test_samples_of_distributions(name: str, sample: dict[str, Any], shape: tuple[int, ...], fixed: bool) -> None:
    """A draw is the same one at a time, over a block, and in generated code."""
    b = Builder()
    dist = EVERY[name]
    row = [Argument.of(sample[a.name]) for a in dist.arguments if a.name in sample]
    given = [a for a in dist.arguments if a.name in sample]
    nodes = constants(b, row) if fixed else bounded(b, row)
    arguments = {a.name: constants(b, row)[i] if a.static else nodes[i] for i, a in enumerate(given)}
    arguments |= {a.name: b.scalar(a.default) for a in dist.arguments if a.name not in sample}
    if name == CATEGORICAL.name:
        arguments = {"p": b.cast(arguments["p"], Kind.REAL)}
    node = dist.build(b, arguments, shape)
    layout = WordLayout.of([node])
    words = draws.block(5, draws.STEP, 0, COUNT, layout.count)
    flats = {(Role.VARIABLE, f"b{i}"): a.flat for i, a in enumerate(row)}
    arrays = {(Role.VARIABLE, f"b{i}"): np.array(a.flat).reshape(*a.type.shape, 1) for i, a in enumerate(row)}
    (block,) = batch.evaluate([node], arrays, batch_sampler(layout, words.T))
    block = np.broadcast_to(block, (*node.type.shape, COUNT)).reshape(node.type.size, COUNT).T
    for k in range(COUNT):
        (expected,) = evaluate([node], flats, sampler(layout, words[k].tolist()))
        assert agree(tuple(block[k].tolist()), expected, node)
        if not fixed and name not in ("Normal", "Exponential", "Uniform", "Permutation"):  # those are drawn in blocks
            assert agree(lane_draw(b, node, row, words[k].tolist()), expected, node)
        low, high = b.bounds(node)
        assert all(low <= v <= high for v in expected)


def lane_draw(b: Builder, node: Node, row: Sequence[Argument], words: Sequence[int]) -> Flat:
    """The draw in generated code, whose arguments are called a0, a1, ... there."""
    renamed = {f"b{i}": b.read(Role.VARIABLE, f"a{i}", a.type, *_edge(a)) for i, a in enumerate(row)}
    values = {id(n): renamed[n.name] for n in walk([node]) if isinstance(n, Read) and n.name in renamed}
    (again,) = rewrite([node], values, b.remake)
    return by_lane(b, again, row, words)


def _edge(a: Argument) -> tuple[float, float]:
    return min(a.flat), max(a.flat)
