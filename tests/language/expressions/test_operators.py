"""The operator tables: every entry, on its samples and at awkward points, means the same in every form.

Reference interpreter, generated lane code, array form and constant folding are compared; so are the bounds that intervals
promise. A new entry of a table is tested without touching this file.
"""

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from taskspec.language import draws
from taskspec.language.expressions import batch
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Apply, Const, Node, walk
from taskspec.language.expressions.operators import FUNCTIONS, OPERATORS, Operator
from taskspec.language.expressions.operators.vectors import STRUCTURES
from taskspec.language.expressions.types import Kind, Type
from taskspec.language.expressions.variates import WordLayout, batch_sampler, sampler, words_of
from taskspec.programs import scalar
from taskspec.programs.lane_form import LaneEmitter, LaneValue
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.values import (
    PYTHON,
    Argument,
    Flat,
    arguments,
    bounded_reads,
    by_types,
    columns,
    constants,
    flats,
    reads,
    with_constants,
)

NAN = math.nan
INF = math.inf
POINTS: dict[Kind, Flat] = {
    Kind.BOOL: (True, False),
    Kind.INT: (0, 1, -1, 2, -7, 5, 2**31 - 1, -(2**31)),
    Kind.REAL: (0.0, -0.0, 1.0, -1.0, 2.5, -0.5, 3.5, 1e9, 1e300, -1e300, 5e-324, INF, -INF, NAN),
}
SMALL_POINTS = POINTS | {Kind.INT: (0, 1, -1, 2, -7, 5)}  # whose sums and products fit 64 bits
LENGTHS = (3, 20)  # written out element by element, and looped over
Rows = list[list[Argument]]


# -- the forms --------------------------------------------------------------------------------------------------------


def by_reference(node: Node, row: Sequence[Argument]) -> Flat:
    return evaluate([node], flats(row))[0]


def by_lane(b: Builder, node: Node, row: Sequence[Argument], words: Sequence[int] = ()) -> Flat:
    """The node as generated code, in a module of its own."""
    names = {}
    parameters = []
    values = []
    for a in row:
        parameters.append(a.name)
        if a.type.is_scalar:
            names[a.key] = LaneValue([a.name])
            values.append(a.flat[0])
        else:
            names[a.key] = LaneValue(packed=a.name)
            values.append(a.flat)
    layout = WordLayout.of([node])
    all_words = [f"w{k}" for k in range(layout.count)]
    words_of_draws = {}
    for draw in layout.draws:
        first = layout.first[draw.site]
        words_of_draws[draw.site] = all_words[first : first + words_of(draw)]
    lane = LaneEmitter(names, words_of_draws, b.certain)
    (value,) = lane.emit([node])
    result = f"tuple({lane.packed(node)})"
    if node.type.is_scalar and value.atoms:
        result = f"({value.atoms[0]},)"
    lines = [f"def form({', '.join(parameters + all_words)}):", *lane.finish(results=[result]), f"return {result}"]
    namespace = {**scalar.scalar_namespace(), **lane.constants}
    exec("\n    ".join(lines), namespace)
    return namespace["form"](*values, *words)  # type: ignore[no-any-return]


def by_array(node: Node, rows: Rows) -> list[Flat]:
    """The node over a batch with one lane for every row of arguments."""
    (array,) = batch.evaluate([node], columns(rows))
    lanes = np.broadcast_to(array, (*node.type.shape, len(rows))).reshape(node.type.size, len(rows)).T
    return list(map(tuple, lanes.tolist()))


def close(actual: Any, expected: Any, exact: bool) -> bool:
    if expected != expected:
        return bool(actual != actual)
    if actual == expected:
        return bool(expected != 0 or math.copysign(1, actual) == math.copysign(1, expected))
    return not exact and math.isfinite(expected) and bool(abs(actual - expected) <= 4e-16 * abs(expected))


def agree(actual: Flat, expected: Flat, node: Node, exact: bool = True) -> bool:
    if len(actual) != len(expected) or not set(map(type, actual)) <= {PYTHON[node.type.kind]}:
        return False
    return all(map(close, actual, expected, itertools.repeat(exact)))


IMPRECISE = [name for name, op in OPERATORS.items() if not op.precise]


def is_precise(node: Node) -> bool:
    return not any(isinstance(each, Apply) and each.op in IMPRECISE for each in walk([node]))


def check(b: Builder, node: Node, rows: Rows, make: Any) -> None:
    """All forms of a node on rows of arguments of the same types."""
    arrays = by_array(node, rows)
    for row, array in zip(rows, arrays, strict=True):
        expected = by_reference(node, row)
        shown = (node, flats(row), expected)
        lane = by_lane(b, node, row)
        assert agree(lane, expected, node), ("lane", lane, shown)
        assert agree(array, expected, node, is_precise(node)), ("array", array, shown)
        folded = make(b, constants(b, row))
        assert isinstance(folded, Const)
        unsigned = list(expected)
        for i, number in enumerate(folded.flat):
            if isinstance(number, Fraction):  # a fraction that is 0 has no sign
                unsigned[i] += 0.0
        assert agree(tuple(batch.array(folded)[..., 0].ravel().tolist()), tuple(unsigned), node), (
            "folded", folded, shown,
        )  # fmt: skip
        low, high = b.bounds(make(b, bounded_reads(b, row)))
        numbers = np.array(expected, float)
        assert np.all((low <= numbers) & (numbers <= high) | np.isnan(numbers)), ("bounds", (low, high), shown)


# -- operators --------------------------------------------------------------------------------------------------------


def check_operator(name: str, rows: Rows) -> None:
    b = Builder()
    check(b, b.apply(name, *reads(b, rows[0])), rows, lambda b, nodes: b.apply(name, *nodes))


@for_each("name", OPERATORS)
def test_samples_of_operators(name: str) -> None:
    for rows in by_types(OPERATORS[name].samples):
        check_operator(name, rows)


def takes(op: Operator, *types: Type) -> bool:
    return isinstance(op.rule(types), Type)


def awkward(name: str) -> list[Rows]:
    """Rows of awkward numbers of every combination of kinds that an elementwise operator takes."""
    op = OPERATORS[name]
    groups = []
    for kinds in itertools.product(Kind, repeat=len(op.samples[0])):
        if takes(op, *map(Type, kinds)):
            points = list(itertools.product(*map(POINTS.__getitem__, kinds)))
            groups.append(list(map(arguments, points[:: 1 + len(points) // 400])))
    return groups


ELEMENTWISE = [name for name, op in OPERATORS.items() if op.elementwise]
REDUCTIONS = [name for name in OPERATORS if name not in ELEMENTWISE]


@for_each("name", ELEMENTWISE)
def test_awkward_points_of_operators(name: str) -> None:
    for rows in awkward(name):
        check_operator(name, rows)


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("name", ELEMENTWISE)
def test_operators_on_vectors(name: str, length: int) -> None:
    """Element by element, with a vector in each place alone and in all."""
    for rows in awkward(name):
        some = itertools.cycle(rows[:: 1 + len(rows) // 37])
        vectors = []
        for column in zip(*itertools.islice(some, length), strict=True):
            first = column[0]
            numbers = tuple(a.flat[0] for a in column)
            vectors.append(Argument(first.name, numbers, Type(first.type.kind, (length,))))
        check_operator(name, [vectors] * 2)
        if len(vectors) == 1:
            continue
        for place, vector in enumerate(vectors):
            row = list(rows[-2])
            row[place] = vector
            check_operator(name, [row] * 2)


@pytest.mark.parametrize("shape", [(1,), (2,), (5,), (16,), (17,), (40,), (70,), (3, 4), (5, 8)])
@pytest.mark.parametrize("name", REDUCTIONS)
def test_reductions_of_vectors(name: str, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(7)
    for kind in Kind:
        type_ = Type(kind, shape)
        if not takes(OPERATORS[name], type_):
            continue
        points = np.array(SMALL_POINTS[kind], object)
        rows = []
        for _ in range(12):
            chosen = points[rng.integers(0, len(points), type_.size)]
            rows.append([Argument("a0", tuple(chosen), type_)])
        check_operator(name, rows)


@pytest.mark.parametrize("name", STRUCTURES)
def test_samples_of_structure(name: str) -> None:
    assert STRUCTURES[name].samples
    for sample, static in STRUCTURES[name].samples:
        row = arguments(sample)
        b = Builder()

        def make(b: Builder, nodes: Sequence[Node], static: tuple[int, ...] = static) -> Node:
            return b.structure(name, list(nodes), static)

        check(b, make(b, reads(b, row)), [row] * 3, make)


# -- functions --------------------------------------------------------------------------------------------------------


@for_each("name", FUNCTIONS)
def test_axes_of_functions_are_those_of_their_values(name: str) -> None:
    for sample in FUNCTIONS[name].samples:
        b = Builder()
        row = arguments(sample)
        value = FUNCTIONS[name].build(b, constants(b, row))
        assert FUNCTIONS[name].axes([len(a.type.shape) for a in row]) == len(value.type.shape), sample


@for_each("name", FUNCTIONS)
def test_samples_of_functions(name: str) -> None:
    function = FUNCTIONS[name]
    assert function.samples
    for sample in function.samples:
        row = arguments(sample)

        def make(b: Builder, nodes: Sequence[Node], row: Sequence[Argument] = row) -> Node:
            return function.build(b, with_constants(b, nodes, row, function.static))

        b = Builder()
        check(b, make(b, reads(b, row)), [row] * 2, make)


# -- distributions ----------------------------------------------------------------------------------------------------

EVERY = {**DISTS, CATEGORICAL.name: CATEGORICAL}
COUNT = 64
BLOCKS = ("Normal", "Exponential", "Uniform", "Permutation")
"""Distributions that are drawn in blocks, and not by generated code of one lane."""


def cases() -> list[tuple[str, Any, tuple[int, ...]]]:
    every: list[tuple[str, Any, tuple[int, ...]]] = []
    for name, dist in EVERY.items():
        assert dist.samples, f"{name} has no samples"
        for sample in dist.samples:
            every.append((name, sample, ()))
            if dist.shaped:
                every += [(name, sample, (3,)), (name, sample, (2, 2))]
    return every


@pytest.mark.parametrize("fixed", [True, False], ids=["constant", "read"])
@pytest.mark.parametrize(("name", "sample", "shape"), sparse(cases(), 3))
def test_samples_of_distributions(name: str, sample: dict[str, Any], shape: tuple[int, ...], fixed: bool) -> None:
    """A draw is the same one at a time, over a block, and in generated code."""
    b = Builder()
    dist = EVERY[name]
    row = []
    nodes = {}
    for argument in dist.arguments:
        if argument.name not in sample:
            nodes[argument.name] = b.scalar(argument.default)
            continue
        a = Argument.of(argument.name, sample[argument.name])
        row.append(a)
        if fixed or argument.static:
            nodes[argument.name] = a.constant(b)
        else:
            nodes[argument.name] = b.read(*a.key, a.type, *a.bounds)
    if name == CATEGORICAL.name:
        nodes["p"] = b.cast(nodes["p"], Kind.REAL)
    node = dist.build(b, nodes, shape)
    layout = WordLayout.of([node])
    words = draws.block(5, draws.STEP, 0, COUNT, layout.count)
    (block,) = batch.evaluate([node], columns([row]), batch_sampler(layout, words.T))
    block = np.broadcast_to(block, (*node.type.shape, COUNT)).reshape(node.type.size, COUNT).T
    low, high = b.bounds(node)
    for k in range(COUNT):
        (expected,) = evaluate([node], flats(row), sampler(layout, words[k].tolist()))
        assert agree(tuple(block[k].tolist()), expected, node)
        if not fixed and name not in BLOCKS:
            assert agree(by_lane(b, node, row, words[k].tolist()), expected, node)
        assert low <= min(expected) and max(expected) <= high
