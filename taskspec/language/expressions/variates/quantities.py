"""Base variates that are quantities: reals, counts, and substitutes for draws in exact models."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.language import draws
from taskspec.language.expressions.ir import Const, Draw, Node
from taskspec.language.expressions.types import INF, REAL, Kind
from taskspec.language.expressions.variates import entry

NORMAL_REACH = 6.67
"""No standard normal that is drawn lies further out: its radius comes from 31 bits."""


# -- Dirichlet ----------------------------------------------------------------------------------------------------


def _shares(k: entry.KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    values = []
    for group, alpha in zip(entry.groups(draw, words), k.argument(draw), strict=True):
        value = k.name()
        shrink = k.name()
        k.append(f"{value}, {shrink} = gamma_parts({group}, {alpha})")
        values.append((value, shrink))
    largest = _largest(k, [value for value, _ in values])
    logs = [k.assign(f"log_share({value}, {largest}, {shrink})") for value, shrink in values]
    most = _largest(k, logs)
    parts = [k.assign(f"exp32({x} - {most})") for x in logs]
    total = parts[0]
    for part in parts[1:]:
        total = k.assign(f"({total} + {part})")
    return [f"share({part}, {total})" for part in parts]


def _largest(k: entry.KernelWriter, atoms: Sequence[str]) -> str:
    largest = atoms[0]
    for atom in atoms[1:]:
        largest = k.assign(f"select({atom} > {largest}, {atom}, {largest})")
    return largest


# -- Poisson ------------------------------------------------------------------------------------------------------


def poisson_bound(draw: Draw) -> float | None:
    """Largest rate, fixed when the task is built; None where the spec gives the rate as a constant."""
    if len(draw.args) == 1:
        return None
    bound = draw.args[1]
    assert isinstance(bound, Const)
    return float(bound.value)


def _poisson_words(draw: Draw) -> int:
    bound = poisson_bound(draw)
    if bound is None:
        return draw.type.size
    return draw.type.size * draws.poisson_words(bound)


def _poisson_passes(draw: Draw) -> int:
    bound = poisson_bound(draw)
    if bound is None:
        return 1
    return draws.poisson_terms(bound)


def _poissons(x: entry.Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    rate = draw.args[0]
    bound = poisson_bound(draw)
    if bound is not None:
        grouped = x.xp.moveaxis(words.reshape(draw.type.size, -1, words.shape[-1]), 1, 0)
        return x.poissons(grouped, entry.rows(x, draw, args[0]), bound)
    assert isinstance(rate, Const)
    tables = []
    for first, limits in map(draws.poisson_table, map(float, rate.flat)):
        tables.append((first, draws.reachable(limits)))
    if len(tables) == 1:
        return tables[0][0] + x.categoricals(words, tables[0][1])
    return x.xp.stack([first + x.categoricals(w, limits) for (first, limits), w in zip(tables, words, strict=True)])


def _poisson_kernel(k: entry.KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    rate = draw.args[0]
    bound = poisson_bound(draw)
    lines = []
    if bound is not None:
        arguments = f"{bound!r}, {draws.poisson_terms(bound)}"
        for group, each in zip(entry.groups(draw, words), k.argument(draw), strict=True):
            lines.append(f"i32(poisson({group}, {each}, {arguments}))")
        return lines
    assert isinstance(rate, Const)
    tables = [draws.poisson_table(float(r)) for r in entry.stretched(rate.flat, len(words))]
    named = [(first, k.array(np.array(limits, np.int64))) for first, limits in tables]
    return [f"i32({first} + search({t}, i64({w})))" for (first, t), w in zip(named, words, strict=True)]


def poisson_terms(highest: Node) -> int:
    """Return how many counts of a Poisson draw are gone through, whose constant rates, or the bound of these, are given.

    The tail that is left out weighs less than 1e-20.
    """
    assert isinstance(highest, Const)
    rate = max(0.0, *map(float, highest.flat))  # rates below 0 are refused elsewhere
    return int(rate + 10 * math.sqrt(rate) + 25)


def _poisson_outcomes(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    terms = poisson_terms(draw.args[-1])
    rates = entry.each(numbers.argument(draw, args[0]), draw.type.size)
    return entry.product(draw, [_poisson_row(rate, terms) for rate in rates], np.int64)


def _poisson_row(rates: AnyArray, terms: int) -> AnyArray:
    """Probabilities (K, N) of counts below `terms`: products of ratios up and down from the mode, over their total."""
    rates = np.where(rates > 0, rates, 0.0)
    mode = np.floor(rates)
    step = np.arange(1.0, terms)[:, None]
    one = np.ones((1, len(rates)))
    above = np.concatenate([one, np.cumprod(rates / (mode + step), axis=0)])
    below = np.concatenate([one, np.cumprod(np.maximum(mode - step + 1, 0) / np.maximum(rates, 1.0), axis=0)])
    away = np.arange(terms)[:, None] - mode.astype(np.int64)
    upper = np.take_along_axis(above, np.maximum(away, 0), 0)
    lower = np.take_along_axis(below, np.maximum(-away, 0), 0)
    return entry.clean(np.where(away >= 0, upper, lower))


# -- what stands for draws in exact models where nothing tells their outcomes apart (`taskspec.exact.model.lump`) ----------


def _total(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    """Count the conditions that hold, from the probability of each draw and whether its condition holds with and without it."""
    p = entry.within(numbers.argument(draw, args[0]))
    q = numbers.otherwise(draw, p)
    row = np.ones((1, 1), p.dtype)
    if p.dtype == object:
        row = numbers.ratio(np.ones((1, 1), int), np.ones((1, 1), int))
    for p_on, p_off, on, off in zip(p, q, *args[1:], strict=True):
        holds = np.where(on, np.where(off, 1, p_on), np.where(off, p_off, 0))
        fails = np.where(on, np.where(off, 0, p_off), np.where(off, p_on, 1))
        shape = (1, max(row.shape[-1], holds.shape[-1]))
        none = np.zeros(shape, row.dtype)
        row = np.concatenate([entry.both(row, fails), none]) + np.concatenate([none, entry.both(row, holds)])
    return np.arange(len(row)), row


def _arrangement(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    alike, places = (a[:, 0] for a in args)
    kinds, counts = np.unique(alike, return_counts=True)
    left = counts[None, :]
    ways = np.ones(1, dtype=object)
    chosen = np.empty((1, 0), np.int64)
    for _ in places:
        row, kind = np.nonzero(left)
        ways = ways[row] * left[row, kind]
        chosen = np.concatenate([chosen[row], kinds[kind][:, None]], axis=1)
        left = left[row] - (np.arange(len(kinds)) == kind[:, None])
    values = np.full((len(chosen), draw.type.size), kinds[0])
    values[:, places] = chosen
    return values, numbers.ratio(ways[:, None], np.full((1, 1), math.perm(draw.type.size, len(places)), dtype=object))


def _arrangements(draw: Draw, bounds: entry.Bounds) -> float:
    """Count arrangements: in each number of places, of ever more kinds of values."""
    alike, places = draw.args
    assert isinstance(alike, Const) and isinstance(places, Const)
    ways = [1] + [0] * places.type.size
    for held in Counter(alike.flat).values():
        before = ways
        ways = []
        for k in range(len(before)):
            ways.append(sum(before[k - i] * math.comb(k, i) for i in range(min(k, held) + 1)))
    return float(min(ways[-1], 10**300))


def _most(draw: Draw) -> int:
    most = draw.args[-1]
    assert isinstance(most, Const)
    return int(most.value)


def _capped(draw: Draw, args: list[AnyArray], numbers: entry.ProbabilityArithmetic) -> entry.Outcomes:
    most = _most(draw)
    terms = poisson_terms(draw.args[-2])
    capped = []
    for rate in entry.each(numbers.argument(draw, args[0]), draw.type.size):
        row = _poisson_row(rate, terms)
        capped.append(np.concatenate([row[:most], row[most:].sum(axis=0, keepdims=True)]))
    return entry.product(draw, capped, np.int64)


TABLE = (
    entry.Variate(  # a multiple of 2**-24 in [0, 1)
        name="uniform", kind=Kind.REAL, bounds=lambda draw, args: (0, 1),
        mean=lambda b, draw: b.const(Fraction(1, 2), REAL),
        one=lambda draw, args, words: tuple(map(draws.uniform, words[: draw.type.size])),
        many=lambda x, draw, args, words: x.uniforms(words),
        kernel=lambda k, draw, words: [f"uniform({w})" for w in words],
    ),
    entry.Variate(  # standard, by Box and Muller's method; words in pairs
        name="normal", kind=Kind.REAL, bounds=lambda draw, args: (-NORMAL_REACH, NORMAL_REACH), cut=True,
        mean=lambda b, draw: b.scalar(0.0), words=lambda draw: draws.normal_words(draw.type.size),
        many=lambda x, draw, args, words: x.normals(words, draw.type.size), loop="normals",
    ),
    entry.Variate(  # standard
        name="exponential", kind=Kind.REAL, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: b.scalar(1.0),
        many=lambda x, draw, args, words: x.exponentials(words), loop="exponentials",
    ),
    entry.Variate(  # shares with given concentrations, by Marsaglia and Tsang's method
        name="dirichlet", kind=Kind.REAL, bounds=lambda draw, args: (0, 1),
        mean=lambda b, draw: b.apply("div", draw.args[0], b.apply("sum", draw.args[0])), kernel=_shares,
        words=lambda draw: draws.gamma_words(draw.type.size),
        many=lambda x, draw, args, words: x.dirichlets(words, entry.rows(x, draw, args[0])),
    ),
    entry.Variate(  # of a given shape and scale 1, by the same method
        name="gamma", kind=Kind.REAL, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: draw.args[0],
        words=lambda draw: draws.gamma_words(draw.type.size),
        many=lambda x, draw, args, words: x.gammas(words, entry.rows(x, draw, args[0])),
        kernel=lambda k, draw, words: [
            f"gamma({group}, {alpha})" for group, alpha in zip(entry.groups(draw, words), k.argument(draw), strict=True)
        ],
    ),
    entry.Variate(  # of a given rate, by inversion; the second argument bounds a rate that is no constant
        name="poisson", kind=Kind.INT, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: draw.args[0],
        outcomes=entry.Enumeration(
            lambda draw, bounds: entry.power(poisson_terms(draw.args[-1]), draw.type.size), _poisson_outcomes,
            steps=lambda draw: draw.type.size * 6 * poisson_terms(draw.args[-1]),  # products of as many ratios as counts
            tail=True,
        ),
        words=_poisson_words, many=_poissons, kernel=_poisson_kernel, passes=_poisson_passes,
    ),
    entry.Variate(  # a Poisson draw, all of whose counts from some on come to the same; after its own arguments, which
        name="capped", kind=Kind.INT, many=None, bounds=lambda draw, args: (0, args[-1].high),
        outcomes=entry.Enumeration(
            lambda draw, bounds: entry.power(_most(draw) + 1, draw.type.size), _capped,
            steps=lambda draw: draw.type.size * 7 * poisson_terms(draw.args[-2]), tail=True,  # and a sum of as many
        ),
    ),
    entry.Variate(  # the count of conditions that hold
        name="total", kind=Kind.INT, many=None, bounds=lambda draw, args: (0, draw.args[0].type.size),
        outcomes=entry.Enumeration(
            lambda draw, bounds: draw.args[0].type.size + 1, _total,
            steps=lambda draw: 4 * draw.args[0].type.size + 4,  # two products and a sum for each, of what was rounded
            inputs=lambda draw: draw.args[0].type.size,
        ),
    ),
    entry.Variate(  # a permutation, reduced to classes of values in the places that are read
        name="arrangement", kind=Kind.INT, many=None, bounds=lambda draw, args: (args[0].low, args[0].high),
        outcomes=entry.Enumeration(_arrangements, _arrangement, steps=lambda draw: 1, weighted=False),  # a quotient of ints
    ),
)  # fmt: skip
