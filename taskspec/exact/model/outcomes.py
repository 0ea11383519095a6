"""Every outcome of the finite draws of some expressions, with its probability, over a batch of points.

Draws are taken one after the other. Where the probabilities are the same at all points and there are
many, an outcome is one pass over the points with the drawn value held fixed; otherwise the points are
repeated, once for each outcome of positive probability.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.lang import interval
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Const, Draw, Role
from taskspec.lang.ranges import Range
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.entry import ProbabilityArithmetic
from taskspec.lang.variates.outcomes import FAINTEST, both, once

Array = np.ndarray[Any, Any]
Reads = Mapping[tuple[Role, str], Array]
LOOP_FROM = 4096
"""From this many points on, an outcome shared by all points is a pass of its own."""


class Floats:
    """Probabilities as float64."""

    def argument(self, draw: Draw, arg: Array) -> Array:
        p = draw.args[0]
        if not isinstance(p, Const) or arg.all():
            return arg
        return np.array([max(float(v), FAINTEST) if v > 0 else float(v) for v in p.flat]).reshape(arg.shape)

    def otherwise(self, draw: Draw, p: Array) -> Array:
        written = draw.args[0]
        if not isinstance(written, Const):
            return np.asarray(1 - p)
        exact = [float(1 - Fraction(v)) if 0 < v < 1 else 1 - one for v, one in zip(written.flat, p.flat, strict=True)]
        return np.array(exact).reshape(p.shape)

    def ratio(self, part: Array, whole: Array) -> Array:
        return np.asarray(part / whole, dtype=np.float64)

    def times(self, a: Array, b: Array) -> Array:
        return both(a, b)


FLOATS = Floats()


@dataclass(frozen=True)
class Branch:
    """Outcomes of the draws at some of the points.

    `weight` is their probability, (M,) or (1,). `origin` gives the point of each, (M,), or is None
    when there is exactly one for every point. `drawn` holds the values of the draws by site,
    (*shape, M) or (*shape, 1).
    """

    weight: Array
    origin: Array | None
    drawn: Mapping[int, Array]
    numbers: ProbabilityArithmetic = FLOATS

    def sample(self, draw: Draw, args: list[Array]) -> Array:
        return self.drawn[draw.site]

    def place(self, reads: Reads) -> Reads:
        """What is read at each outcome's point."""
        if self.origin is None:
            return reads
        origin = self.origin
        return {k: v if v.shape[-1] == 1 else v[..., origin] for k, v in reads.items()}


def count(draws: Sequence[Draw], known: dict[int, Range]) -> float:
    """An upper bound on the outcomes at one point; infinite where a draw is not finite."""
    return math.prod(_outcomes(d, known) for d in draws)


def _outcomes(draw: Draw, known: dict[int, Range]) -> float:
    found = VARIATES[draw.base].outcomes
    return math.inf if found is None else found.count(draw, lambda node: interval.bounds(node, known))


def is_finite(draw: Draw) -> bool:
    """Whether the outcomes can be enumerated. Those of a Poisson are, up to where a tail of 1e-20 is left."""
    return VARIATES[draw.base].outcomes is not None


def branches(
    draws: Sequence[Draw], reads: Reads, lanes: int, numbers: ProbabilityArithmetic = FLOATS
) -> Iterator[Branch]:
    """All outcomes of the finite draws among `draws` (as `ir.draws` orders them) at `lanes` points."""
    start = Branch(numbers.ratio(np.ones(1, np.int64), np.ones(1, np.int64)), None, {}, numbers)
    yield from _expand([d for d in draws if is_finite(d)], reads, lanes, start)


def _expand(draws: Sequence[Draw], reads: Reads, lanes: int, so_far: Branch) -> Iterator[Branch]:
    if not draws:
        yield so_far
        return
    draw, rest, times = draws[0], draws[1:], so_far.numbers.times
    args = evaluate(draw.args, so_far.place(reads), so_far.sample)
    found = VARIATES[draw.base].outcomes
    assert found is not None
    values, p = found.table(draw, args, so_far.numbers)
    if p.shape[-1] == 1 and lanes >= LOOP_FROM and so_far.origin is None:
        for k in np.flatnonzero(p[:, 0] > 0):
            drawn = {**so_far.drawn, draw.site: values[k][..., None]}
            yield from _expand(rest, reads, lanes, replace(so_far, weight=times(so_far.weight, p[k]), drawn=drawn))
        return
    if len(p) == 1:  # nothing is left to chance
        drawn = {**so_far.drawn, draw.site: values[0][..., None]}
        yield from _expand(rest, reads, lanes, replace(so_far, drawn=drawn))
        return
    yield from _expand(rest, reads, lanes, _repeated(so_far, draw, values, p, lanes))


def _repeated(so_far: Branch, draw: Draw, values: Array, p: Array, lanes: int) -> Branch:
    """Every point once for each outcome of positive probability, the outcomes of a point side by side."""
    n = lanes if so_far.origin is None else len(so_far.origin)
    possible = once(operator.gt, p, np.zeros_like(p)).astype(np.bool_)
    point, outcome = np.nonzero(np.broadcast_to(possible.T, (n, len(p))))
    chance = p[outcome, 0] if p.shape[-1] == 1 else p[outcome, point]
    weight = so_far.numbers.times(_at(so_far.weight, point), chance)
    drawn = {site: _at(v, point) for site, v in so_far.drawn.items()}
    drawn[draw.site] = np.moveaxis(values[outcome], 0, -1)
    return replace(so_far, weight=weight, origin=_at_origin(so_far.origin, point), drawn=drawn)


def _at_origin(origin: Array | None, point: Array) -> Array:
    return point if origin is None else origin[point]


def _at(values: Array, point: Array) -> Array:
    return values if values.shape[-1] == 1 else values[..., point]
