"""Base variates that are whole numbers: of a range, of events, and orders."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from taskspec import draws
from taskspec.base.arrays import AnyArray
from taskspec.lang.ir import Const, Draw, Node
from taskspec.lang.types import INF, Kind
from taskspec.lang.variates import outcomes
from taskspec.lang.variates.entry import (
    Bounds,
    Draws,
    Enumeration,
    Flat,
    KernelWriter,
    ProbabilityArithmetic,
    Variate,
    Words,
    groups,
    rows,
    stretched,
)

# -- one of a range -----------------------------------------------------------------------------------------------


def _index(draw: Draw, args: list[Flat], words: Words) -> Flat:
    counts = stretched(args[0], draw.type.size)
    return tuple(draws.index(w, int(n)) for w, n in zip(words, counts, strict=False))


def _most(draw: Draw, bounds: Bounds) -> float:
    return outcomes.power(max(1.0, bounds(draw.args[0])[1]), draw.type.size)


def _index_outcomes(draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic) -> tuple[AnyArray, AnyArray]:
    found = []
    for counts in outcomes.each(args[0], draw.type.size):
        k = np.arange(int(counts.max()))[:, None]
        found.append(numbers.ratio(k < counts, counts))
    return outcomes.product(draw, found, np.int64)


# -- events -------------------------------------------------------------------------------------------------------


def poisson_bound(draw: Draw) -> float | None:
    """Return the largest rate of a Poisson draw, fixed when the task is built; None where the spec gives the rate as
    a constant.
    """
    if len(draw.args) == 1:
        return None
    bound = draw.args[1]
    assert isinstance(bound, Const)
    return float(bound.value)


def _poisson_words(draw: Draw) -> int:
    bound = poisson_bound(draw)
    return draw.type.size * (1 if bound is None else draws.poisson_words(bound))


def _poisson_passes(draw: Draw) -> int:
    """Return a word is searched for count by count where the rate is known only at run time."""
    bound = poisson_bound(draw)
    return 1 if bound is None else draws.poisson_terms(bound)


def _poisson(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.size
    bound = poisson_bound(draw)
    rates = stretched(args[0], n)
    if bound is None:
        tables = [draws.poisson_table(float(rate)) for rate in rates]
        return tuple(f + draws.categorical(w, t) for (f, t), w in zip(tables, words, strict=False))
    step = draws.poisson_words(bound)
    return tuple(draws.poisson(words[step * i : step * (i + 1)], float(r), bound) for i, r in enumerate(rates))


def _poissons(x: Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    rate = draw.args[0]
    bound = poisson_bound(draw)
    size = draw.type.size
    if bound is not None:
        grouped = x.xp.moveaxis(words.reshape(size, -1, words.shape[-1]), 1, 0)
        return x.poissons(grouped, rows(x, draw, args[0]), bound)
    assert isinstance(rate, Const)
    tables = [(first, draws.reachable(limits)) for first, limits in map(draws.poisson_table, map(float, rate.flat))]
    if len(tables) == 1:
        return tables[0][0] + x.categoricals(words, tables[0][1])
    return x.xp.stack([first + x.categoricals(w, limits) for (first, limits), w in zip(tables, words, strict=True)])


def _poisson_kernel(k: KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    rate = draw.args[0]
    bound = poisson_bound(draw)
    if bound is not None:
        arguments = f"{bound!r}, {draws.poisson_terms(bound)}"
        pairs = zip(groups(draw, words), k.argument(draw), strict=True)
        return [f"i32(poisson({g}, {r}, {arguments}))" for g, r in pairs]
    assert isinstance(rate, Const)
    tables = [draws.poisson_table(float(r)) for r in stretched(rate.flat, len(words))]
    named = [(first, k.array(np.array(limits, np.int64))) for first, limits in tables]
    return [f"i32({first} + search({t}, i64({w})))" for (first, t), w in zip(named, words, strict=True)]


def poisson_terms(highest: Node) -> int:
    """Return how many counts of a Poisson draw are gone through, whose constant rates, or the bound of these, are given.

    The tail that is left out weighs less than 1e-20.
    """
    assert isinstance(highest, Const)
    rate = max(0.0, *map(float, highest.flat))  # rates below 0 are refused elsewhere
    return int(rate + 10 * math.sqrt(rate) + 25)


def _poisson_outcomes(draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic) -> tuple[AnyArray, AnyArray]:
    terms = poisson_terms(draw.args[-1])
    found = [poisson_row(rate, terms) for rate in outcomes.each(numbers.argument(draw, args[0]), draw.type.size)]
    return outcomes.product(draw, found, np.int64)


def poisson_row(rates: AnyArray, terms: int) -> AnyArray:
    """Return probabilities (K, N) of counts below `terms`: products of ratios up and down from the mode, over their total."""
    rates = np.where(rates > 0, rates, 0.0)
    mode = np.floor(rates)
    step = np.arange(1.0, terms)[:, None]
    one = np.ones((1, len(rates)))
    above = np.concatenate([one, np.cumprod(rates / (mode + step), axis=0)])
    below = np.concatenate([one, np.cumprod(np.maximum(mode - step + 1, 0) / np.maximum(rates, 1.0), axis=0)])
    away = np.arange(terms)[:, None] - mode.astype(np.int64)
    found = np.where(away >= 0, np.take_along_axis(above, np.maximum(away, 0), 0),
                     np.take_along_axis(below, np.maximum(-away, 0), 0))  # fmt: skip
    return outcomes.clean(found)


# -- orders -------------------------------------------------------------------------------------------------------


def _permutation(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.shape[-1]
    return tuple(i for k in range(0, draw.type.size, n) for i in draws.permutation(words[k : k + n]))


def _permutations(x: Draws, draw: Draw, args: Sequence[AnyArray], words: AnyArray) -> AnyArray:
    grouped = x.xp.moveaxis(words.reshape(-1, draw.type.shape[-1], words.shape[-1]), 1, 0)
    return x.xp.moveaxis(x.permutations(grouped), 0, 1)


def _permutation_count(draw: Draw, bounds: Bounds) -> float:
    n = draw.type.shape[-1]
    return outcomes.power(math.factorial(min(n, 170)), draw.type.size // n)


def _permutation_outcomes(
    draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic
) -> tuple[AnyArray, AnyArray]:
    *outer, n = draw.type.shape
    one = np.array(list(itertools.permutations(range(n))), dtype=np.int64)
    every = list(itertools.product(range(len(one)), repeat=math.prod(outer)))
    values = one[np.array(every, dtype=np.int64)].reshape(len(every), *draw.type.shape)
    return values, numbers.ratio(np.ones((len(values), 1), np.int64), np.full((len(values), 1), len(values)))


def _permutation_kernel(k: KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    n = draw.type.shape[-1]
    return [a for first in range(0, len(words), n) for a in k.order(words[first : first + n], False)]


TABLE = (
    Variate(  # uniform on range(n)
        name="index", kind=Kind.INT, bounds=lambda draw, args: (0, max(0, args[0].high - 1)),
        outcomes=Enumeration(_most, _index_outcomes, weighted=False), one=_index,
        many=lambda x, draw, args, words: x.indices(words, rows(x, draw, args[0])),
        lane=lambda lane, draw, words: [f"({w} * {n} >> 32)" for w, n in zip(words, lane.argument(draw), strict=True)],
        kernel=lambda k, draw, words: [f"i32(index({w}, {n}))" for w, n in zip(words, k.argument(draw), strict=True)],
    ),
    Variate(  # of a given rate, by inversion; the second argument bounds a rate that is no constant
        name="poisson", kind=Kind.INT, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: draw.args[0],
        outcomes=Enumeration(
            lambda draw, bounds: outcomes.power(poisson_terms(draw.args[-1]), draw.type.size), _poisson_outcomes,
            steps=lambda draw: draw.type.size * 6 * poisson_terms(draw.args[-1]),  # products of as many ratios as counts
            tail=True,
        ),
        words=_poisson_words, one=_poisson, many=_poissons, kernel=_poisson_kernel, passes=_poisson_passes,
    ),
    Variate(  # uniform: the stable order of n words
        name="permutation", kind=Kind.INT, bounds=lambda draw, args: (0, max(0, draw.type.shape[-1] - 1)), sorts=True,
        outcomes=Enumeration(_permutation_count, _permutation_outcomes, weighted=False),
        one=_permutation, many=_permutations, kernel=_permutation_kernel,
    ),
)  # fmt: skip
