"""What stands for draws in exact models where nothing tells their outcomes apart (`taskspec.model.lump`)."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.lang.ir import Const, Draw
from taskspec.lang.types import Kind
from taskspec.lang.variates import outcomes
from taskspec.lang.variates.counts import poisson_row, poisson_terms
from taskspec.lang.variates.entry import Bounds, Enumeration, ProbabilityArithmetic, Variate


def _total(draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic) -> tuple[AnyArray, AnyArray]:
    """Return how many conditions hold, from the probability of each draw and whether its condition holds with and without it."""
    p, *ends = outcomes.within(numbers.argument(draw, args[0])), *args[1:]
    q = numbers.otherwise(draw, p)
    row = np.ones((1, 1), p.dtype) if p.dtype != object else numbers.ratio(np.ones((1, 1), int), np.ones((1, 1), int))
    for p_on, p_off, on, off in zip(p, q, *ends, strict=True):
        holds = np.where(on, np.where(off, 1, p_on), np.where(off, p_off, 0))
        fails = np.where(on, np.where(off, 0, p_off), np.where(off, p_on, 1))
        shape = (1, max(row.shape[-1], holds.shape[-1]))
        none = np.zeros(shape, row.dtype)
        row = np.concatenate([outcomes.both(row, fails), none]) + np.concatenate([none, outcomes.both(row, holds)])
    return np.arange(len(row)), row


def _arrangement(draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic) -> tuple[AnyArray, AnyArray]:
    """Return the outcomes of the observed positions of a permutation, merged by equivalence."""
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


def _arrangements(draw: Draw, bounds: Bounds) -> float:
    """Return how many there are: in each number of places, of ever more kinds of values."""
    alike, places = draw.args
    assert isinstance(alike, Const) and isinstance(places, Const)
    ways = [1] + [0] * places.type.size
    for held in Counter(alike.flat).values():
        ways = [sum(ways[k - i] * math.comb(k, i) for i in range(min(k, held) + 1)) for k in range(len(ways))]
    return float(min(ways[-1], 10**300))


def _most(draw: Draw) -> int:
    """Return the count from which on those of a capped draw are one outcome."""
    most = draw.args[-1]
    assert isinstance(most, Const)
    return int(most.value)


def _capped(draw: Draw, args: list[AnyArray], numbers: ProbabilityArithmetic) -> tuple[AnyArray, AnyArray]:
    """Return counts up to a last one, which has the probability of all from there on."""
    most = _most(draw)
    terms = poisson_terms(draw.args[-2])
    found = []
    for rate in outcomes.each(numbers.argument(draw, args[0]), draw.type.size):
        row = poisson_row(rate, terms)
        found.append(np.concatenate([row[:most], row[most:].sum(axis=0, keepdims=True)]))
    return outcomes.product(draw, found, np.int64)


TABLE = (
    Variate(  # a Poisson draw, all of whose counts from some on come to the same; after its own arguments, which
        name="capped", kind=Kind.INT, many=None, bounds=lambda draw, args: (0, args[-1].high),
        outcomes=Enumeration(
            lambda draw, bounds: outcomes.power(_most(draw) + 1, draw.type.size), _capped,
            steps=lambda draw: draw.type.size * 7 * poisson_terms(draw.args[-2]), tail=True,  # and a sum of as many
        ),
    ),
    Variate(  # the count of conditions that hold
        name="total", kind=Kind.INT, many=None, bounds=lambda draw, args: (0, draw.args[0].type.size),
        outcomes=Enumeration(
            lambda draw, bounds: draw.args[0].type.size + 1, _total,
            steps=lambda draw: 4 * draw.args[0].type.size + 4,  # two products and a sum for each, of what was rounded
            chances=lambda draw: draw.args[0].type.size,
        ),
    ),
    Variate(  # a permutation, reduced to classes of values in the places that are read
        name="arrangement", kind=Kind.INT, many=None, bounds=lambda draw, args: (args[0].low, args[0].high),
        outcomes=Enumeration(_arrangements, _arrangement, steps=lambda draw: 1, weighted=False),  # a quotient of whole numbers
    ),
)  # fmt: skip
