"""Base variates that choose: a condition, an index with given or equal probabilities, an order."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.language import draws
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, plain
from taskspec.language.expressions.operators.entry import NodeMaker
from taskspec.language.expressions.types import Kind, Type
from taskspec.language.expressions.variates import entry

COMPARED = 16
"""Constant categorical draws of up to this many outcomes become a sum of comparisons."""


# -- conditions ---------------------------------------------------------------------------------------------------


def bernoulli_threshold(p: Fraction | float) -> int:
    """Threshold below which the words of a condition lie; p is limited to [0, 1], NaN to 0."""
    if p > 0:
        return round(Fraction(min(p, 1)) * draws.NEVER)
    return 0


def _condition(draw: Draw, args: list[entry.Flat], words: entry.Words) -> entry.Flat:
    ps = entry.stretched(args[0], draw.type.size)
    if isinstance(draw.args[0], Const):
        return tuple(w < bernoulli_threshold(p) for w, p in zip(words, ps, strict=False))
    return tuple(draws.bernoulli(w, float(p)) for w, p in zip(words, ps, strict=False))


def _conditions(x: entry.Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    p = draw.args[0]
    if not isinstance(p, Const):
        return x.bernoullis(words, entry.rows(x, draw, args[0]))
    limits = np.array(list(map(bernoulli_threshold, entry.stretched(p.flat, draw.type.size))), np.uint64)
    return words.astype(np.uint64) < limits[:, None]


def _below(b: NodeMaker, draw: Draw, words: Sequence[Node], bias: int) -> list[Node] | None:
    p = draw.args[0]
    if not isinstance(p, Const):
        return None
    limits: list[Node] = []
    for word, q in zip(words, entry.stretched(p.flat, draw.type.size), strict=True):
        limit = bernoulli_threshold(q)
        if limit >= draws.NEVER:
            limits.append(b.scalar(True))
        else:
            limits.append(b.apply("lt", word, b.scalar(limit - bias)))
    return limits


def _condition_outcomes(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    p = entry.within(numbers.argument(draw, args[0]))
    q = numbers.otherwise(draw, p)
    pairs = zip(entry.each(q, draw.type.size), entry.each(p, draw.type.size), strict=True)
    return entry.product(draw, [np.stack(pair) for pair in pairs], np.bool_)


# -- an index with given probabilities ----------------------------------------------------------------------------


def row_table(p: Node) -> tuple[Const, Node] | None:
    """Match probabilities looked up in a constant table: the table (rows, k) and the row's number; else None."""
    match p:
        case Apply(op="index", args=(Const() as table, row)) if row.type.is_scalar:
            return table, row
        case _:
            return None


def _table_rows(table: Const) -> list[tuple[Any, ...]]:
    k = table.type.shape[-1]
    return [table.flat[i : i + k] for i in range(0, len(table.flat), k)]


def _outcome(draw: Draw, args: list[entry.Flat], words: entry.Words) -> entry.Flat:
    mine = words[: draw.type.size]
    p = draw.args[0]
    if isinstance(p, Const) or row_table(p) is not None:
        # the row as it stands in the table: exact, without rounding on the way
        table = draws.thresholds(p.flat if isinstance(p, Const) else args[0])
        return tuple(draws.categorical(w, table) for w in mine)
    weights = list(map(float, args[0]))
    return tuple(draws.weighted_categorical(w, weights) for w in mine)


def _outcomes(x: entry.Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    p = draw.args[0]
    if isinstance(p, Const):
        return x.categoricals(words, _limits(p))
    looked_up = row_table(p)
    if looked_up is None:
        return x.weighted_categoricals(words, args[0].reshape(-1, 1, args[0].shape[-1]))
    present, which = np.unique(args[0], axis=1, return_inverse=True)
    limits = []
    for row in present.T.tolist():
        limits.append(_row_limits(looked_up[0], tuple(row)))
    tables, last_outcomes = zip(*limits, strict=True)
    table = np.concatenate(tables)
    last = np.concatenate(last_outcomes)
    return draws.row_categoricals(words, np.broadcast_to(which.reshape(-1), words.shape[1:]), table, last)


@lru_cache(maxsize=256)
def _limits(p: Const) -> AnyArray:
    """Thresholds of constant probabilities; sets of thousands of outcomes take a while, once."""
    return draws.reachable(draws.thresholds(p.flat))


@lru_cache(maxsize=1024)
def _row_limits(table: Const, row: tuple[float, ...]) -> tuple[AnyArray, AnyArray]:
    return draws.threshold_table([_exact_rows(table)[row]])


@lru_cache(maxsize=16)
def _exact_rows(table: Const) -> dict[tuple[float, ...], tuple[Any, ...]]:
    by_floats = {}
    for row in reversed(_table_rows(table)):
        by_floats[tuple(float(plain(v)) for v in row)] = row
    return by_floats


def _reached_limits(b: NodeMaker, draw: Draw, words: Sequence[Node], bias: int) -> list[Node] | None:
    p = draw.args[0]
    if isinstance(p, Const) and len(p.flat) <= COMPARED:
        limits = []
        for t in draws.thresholds(p.flat):
            if t < draws.NEVER:
                limits.append(b.scalar(t - bias))
        return [_reached(b, limits, w) for w in words]
    looked_up = row_table(p)
    if looked_up is None:
        return None
    return _row_outcomes(b, *looked_up, words, bias)


def _reached(b: NodeMaker, limits: Sequence[Node], word: Node) -> Node:
    total: Node = b.scalar(0)
    for limit in limits:
        total = b.apply("add", total, b.cast(b.apply("le", limit, word), Kind.INT))
    return total


def _row_outcomes(b: NodeMaker, table: Const, row: Node, words: Sequence[Node], bias: int) -> list[Node]:
    k = table.type.shape[-1]
    rows = _table_rows(table)
    if not bias:  # ints with room for the threshold that no word reaches
        exact = list(map(draws.thresholds, rows))
        columns = [_column(b, [t[i] for t in exact], row) for i in range(k - 1)]
        return [_reached(b, columns, w) for w in words]
    limits, last = draws.threshold_table(rows)
    columns = [_column(b, [int(v) - bias for v in limits[:, i]], row) for i in range(k - 1)]
    most = _column(b, last.tolist(), row)
    return [b.apply("min2", _reached(b, columns, w), most) for w in words]


def _column(b: NodeMaker, values: Sequence[int], row: Node) -> Node:
    if len(set(values)) == 1:
        return b.scalar(values[0])
    return b.structure("index", [b.const(values, Type(Kind.INT, (len(values),))), row])


def _in_lane(lane: entry.LaneWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    looked_up = row_table(draw.args[0])
    if looked_up is None:
        return [f"weighted_categorical({word}, {lane.packed(draw.args[0])})" for word in words]
    limits = tuple(map(draws.thresholds, _table_rows(looked_up[0])))
    at = lane.scalar_of(looked_up[1])
    if len(limits[0]) == 1:
        return [f"(0 if {word} < {lane.constant(tuple(r[0] for r in limits))}[{at}] else 1)" for word in words]
    outcomes = []
    for word in words:
        outcomes.append(f"bisect_right({lane.constant(limits)}[{at}], {word})")
    return outcomes


def _in_kernel(k: entry.KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    p = draw.args[0]
    if isinstance(p, Const):
        table = k.array(np.array(draws.thresholds(p.flat), np.int64))
        return [f"i32(search({table}, i64({w})))" for w in words]
    weights = f"({', '.join(k.atoms(p))},)"
    return [f"i32(weighted({w}, {weights}))" for w in words]


# -- one of a range -----------------------------------------------------------------------------------------------


def _index(draw: Draw, args: list[entry.Flat], words: entry.Words) -> entry.Flat:
    counts = entry.stretched(args[0], draw.type.size)
    return tuple(draws.index(w, int(n)) for w, n in zip(words, counts, strict=False))


def _index_outcomes(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    outcomes = []
    for counts in entry.each(args[0], draw.type.size):
        k = np.arange(int(counts.max()))[:, None]
        outcomes.append(numbers.ratio(k < counts, counts))
    return entry.product(draw, outcomes, np.int64)


# -- orders -------------------------------------------------------------------------------------------------------


def _permutation(draw: Draw, args: list[entry.Flat], words: entry.Words) -> entry.Flat:
    n = draw.type.shape[-1]
    order: list[int] = []
    for k in range(0, draw.type.size, n):
        order += draws.permutation(words[k : k + n])
    return tuple(order)


def _permutations(x: entry.Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    grouped = x.xp.moveaxis(words.reshape(-1, draw.type.shape[-1], words.shape[-1]), 1, 0)
    return x.xp.moveaxis(x.permutations(grouped), 0, 1)


def _permutation_count(draw: Draw, bounds: entry.Bounds) -> float:
    n = draw.type.shape[-1]
    return entry.power(math.factorial(min(n, 170)), draw.type.size // n)


def _permutation_outcomes(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    *outer, n = draw.type.shape
    one = np.array(list(itertools.permutations(range(n))), dtype=np.int64)
    every = list(itertools.product(range(len(one)), repeat=math.prod(outer)))
    values = one[np.array(every, dtype=np.int64)].reshape(len(every), *draw.type.shape)
    return values, numbers.ratio(np.ones((len(values), 1), np.int64), np.full((len(values), 1), len(values)))


def _permutation_kernel(k: entry.KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    n = draw.type.shape[-1]
    order: list[str] = []
    for first in range(0, len(words), n):
        order += k.order(words[first : first + n], False)
    return order


TABLE = (
    entry.Variate(  # true with a given probability: a word below a threshold
        name="bernoulli", kind=Kind.BOOL, bounds=lambda draw, args: (0, 1),
        outcomes=entry.Enumeration(lambda draw, bounds: entry.power(2, draw.type.size), _condition_outcomes),
        one=_condition, many=_conditions, compared=_below,
        lane=lambda lane, draw, words: [f"bernoulli({w}, {p})" for w, p in zip(words, lane.argument(draw), strict=True)],
        kernel=lambda k, draw, words: [f"bernoulli({w}, {p})" for w, p in zip(words, k.argument(draw), strict=True)],
    ),
    entry.Variate(  # an index drawn with given probabilities: how many thresholds are at most the word
        name="categorical", kind=Kind.INT, bounds=lambda draw, args: (0, draw.args[0].type.shape[-1] - 1),
        outcomes=entry.Enumeration(
            lambda draw, bounds: entry.power(draw.args[0].type.shape[-1], draw.type.size),
            lambda draw, args, numbers: entry.product(
                draw, [entry.clean(numbers.argument(draw, args[0]))] * draw.type.size, np.int64
            ),
            steps=lambda draw: draw.type.size * (draw.args[0].type.shape[-1] + 4), by_row=True,
        ),
        one=_outcome, many=_outcomes, compared=_reached_limits, lane=_in_lane, kernel=_in_kernel,
    ),
    entry.Variate(  # uniform on range(n)
        name="index", kind=Kind.INT, bounds=lambda draw, args: (0, max(0, args[0].high - 1)),
        outcomes=entry.Enumeration(
            lambda draw, bounds: entry.power(max(1.0, bounds(draw.args[0])[1]), draw.type.size), _index_outcomes,
            weighted=False,
        ),
        one=_index, many=lambda x, draw, args, words: x.indices(words, entry.rows(x, draw, args[0])),
        lane=lambda lane, draw, words: [f"({w} * {n} >> 32)" for w, n in zip(words, lane.argument(draw), strict=True)],
        kernel=lambda k, draw, words: [f"i32(index({w}, {n}))" for w, n in zip(words, k.argument(draw), strict=True)],
    ),
    entry.Variate(  # uniform: the stable order of n words
        name="permutation", kind=Kind.INT, bounds=lambda draw, args: (0, max(0, draw.type.shape[-1] - 1)), sorts=True,
        outcomes=entry.Enumeration(_permutation_count, _permutation_outcomes, weighted=False),
        one=_permutation, many=_permutations, kernel=_permutation_kernel,
    ),
)  # fmt: skip
