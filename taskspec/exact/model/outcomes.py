"""Every outcome of the finite draws of some expressions, with its probability, over a batch of points.

Draws are taken one after the other. Where the probabilities are the same at all points and there are
many, an outcome is one pass over the points with the drawn value held fixed; otherwise the points are
repeated, once for each outcome of positive probability.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from taskspec.lang import interval
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Const, Draw, Role
from taskspec.lang.ranges import Range

Array = np.ndarray[Any, Any]
Reads = Mapping[tuple[Role, str], Array]
LOOP_FROM = 4096
"""From this many points on, an outcome shared by all points is a pass of its own."""
FAINTEST = 5e-324
"""What possible outcomes weigh at least, so that a product of small probabilities does not make them impossible."""


class ProbabilityArithmetic(Protocol):
    """The arithmetic in which probabilities are worked out: floats, or rationals (`certified.rational`)."""

    def argument(self, draw: Draw, arg: Array) -> Array:
        """The first argument of a draw, rates and probabilities, (*shape, N)."""

    def ratio(self, part: Array, whole: Array) -> Array:
        """Ints divided by ints."""

    def times(self, a: Array, b: Array) -> Array:
        """The product of two probabilities of which neither is 0."""


class Floats:
    """Probabilities as float64."""

    def argument(self, draw: Draw, arg: Array) -> Array:
        return arg

    def ratio(self, part: Array, whole: Array) -> Array:
        return np.asarray(part / whole, dtype=np.float64)

    def times(self, a: Array, b: Array) -> Array:
        return np.asarray(np.maximum(a * b, FAINTEST))


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
    shape = draw.type.shape
    match draw.base:
        case "bernoulli":
            return _power(2, draw.type.size)
        case "categorical":
            return _power(draw.args[0].type.shape[-1], draw.type.size)
        case "index":
            most = max(1.0, interval.bounds(draw.args[0], known)[1])
            return _power(most, draw.type.size)
        case "poisson":
            return _power(_poisson_most(draw), draw.type.size)
        case "permutation":
            return _power(math.factorial(min(shape[-1], 170)), draw.type.size // shape[-1])
        case "total":
            return draw.args[0].type.size + 1
        case "arrangement":
            return _arrangements(draw)
        case _:
            return math.inf


def _power(base: float, exponent: int) -> float:
    """`base ** exponent`; 1e300 stands for all that is beyond it, as it is finite for all that."""
    return 1e300 if exponent * math.log(max(1.0, base)) > 690 else float(base) ** exponent


def is_finite(draw: Draw) -> bool:
    """Whether the outcomes can be enumerated. Those of a Poisson are, up to where a tail of 1e-16 is left."""
    return draw.base in _TABLES


def branches(
    draws: Sequence[Draw], reads: Reads, lanes: int, numbers: ProbabilityArithmetic = FLOATS
) -> Iterator[Branch]:
    """All outcomes of the finite draws among `draws` (in order of site) at `lanes` points."""
    start = Branch(numbers.ratio(np.ones(1, np.int64), np.ones(1, np.int64)), None, {}, numbers)
    yield from _expand([d for d in draws if is_finite(d)], reads, lanes, start)


def _expand(draws: Sequence[Draw], reads: Reads, lanes: int, so_far: Branch) -> Iterator[Branch]:
    if not draws:
        yield so_far
        return
    draw, rest, times = draws[0], draws[1:], so_far.numbers.times
    args = evaluate(draw.args, so_far.place(reads), so_far.sample)
    values, p = _TABLES[draw.base](draw, args, so_far.numbers)
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
    point, outcome = np.nonzero(np.broadcast_to(p.T > 0, (n, len(p))))
    chance = p[outcome, 0] if p.shape[-1] == 1 else p[outcome, point]
    weight = so_far.numbers.times(_at(so_far.weight, point), chance)
    drawn = {site: _at(v, point) for site, v in so_far.drawn.items()}
    drawn[draw.site] = np.moveaxis(values[outcome], 0, -1)
    return replace(so_far, weight=weight, origin=_at_origin(so_far.origin, point), drawn=drawn)


def _at_origin(origin: Array | None, point: Array) -> Array:
    return point if origin is None else origin[point]


def _at(values: Array, point: Array) -> Array:
    return values if values.shape[-1] == 1 else values[..., point]


# -- outcomes of one draw -------------------------------------------------------------------------
# Each gives values (K, *shape) and probabilities (K, N or 1).


def _product(draw: Draw, rows: Sequence[Array], dtype: Any) -> tuple[Array, Array]:
    """Independent elements: element e takes value k with probability rows[e][k]."""
    shape = draw.type.shape
    if shape == ():
        return np.arange(len(rows[0]), dtype=dtype), rows[0]
    digits = np.array(list(itertools.product(*(range(len(r)) for r in rows))), dtype=np.int64)
    p: Any = 1
    for e, row in enumerate(rows):
        p = p * row[digits[:, e]]
    return digits.reshape(-1, *shape).astype(dtype), p


def _stretched(arg: Array, size: int) -> list[Array]:
    flat = arg.reshape(-1, arg.shape[-1])
    return list(flat) * size if len(flat) == 1 else list(flat)


def _index(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    rows = []
    for counts in _stretched(args[0], draw.type.size):
        k = np.arange(int(counts.max()))[:, None]
        rows.append(numbers.ratio(k < counts, counts))
    return _product(draw, rows, np.int64)


def _bernoulli(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    rows = []
    for p in _stretched(numbers.argument(draw, args[0]), draw.type.size):
        inside = np.minimum(np.maximum(np.where(p == p, p, 0), 0), 1)
        rows.append(np.stack([1 - inside, inside]))
    return _product(draw, rows, np.bool_)


def _categorical(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    return _product(draw, [clean(numbers.argument(draw, args[0]))] * draw.type.size, np.int64)


def clean(p: Array) -> Array:
    """Rows of probabilities (K, N) as the sampler reads them: no negative ones, relative to the total."""
    p = np.where(p > 0, p, 0)
    total = p.sum(axis=0)
    if (total != 1).any():
        empty = total == 0
        p = p / np.where(empty, 1, total)
        p[-1] = np.where(empty, 1, p[-1])
    return p


def poisson_terms(rate: float) -> int:
    """How many counts of a Poisson draw are enumerated: the tail that is left out weighs less than 1e-20."""
    return int(rate + 10 * math.sqrt(rate) + 25)


def _poisson_most(draw: Draw) -> int:
    return poisson_terms(highest_rate(draw))


def highest_rate(draw: Draw) -> float:
    """The highest rate of a Poisson draw, from its last argument: the constant rates, or their bound."""
    highest = draw.args[-1]
    assert isinstance(highest, Const)
    return max(map(float, highest.flat))


def _poisson(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    terms = _poisson_most(draw)
    rows = [_poisson_row(rate, terms) for rate in _stretched(numbers.argument(draw, args[0]), draw.type.size)]
    return _product(draw, rows, np.int64)


def _poisson_row(rates: Array, terms: int) -> Array:
    """Probabilities (K, N) of counts below `terms`: products of ratios up and down from the mode, over their total."""
    rates = np.where(rates > 0, rates, 0.0)
    mode, step = np.floor(rates), np.arange(1.0, terms)[:, None]
    one = np.ones((1, len(rates)))
    above = np.concatenate([one, np.cumprod(rates / (mode + step), axis=0)])
    below = np.concatenate([one, np.cumprod(np.maximum(mode - step + 1, 0) / np.maximum(rates, 1.0), axis=0)])
    away = np.arange(terms)[:, None] - mode.astype(np.int64)
    found = np.where(away >= 0, np.take_along_axis(above, np.maximum(away, 0), 0),
                     np.take_along_axis(below, np.maximum(-away, 0), 0))  # fmt: skip
    return clean(found)


def _permutation(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    *outer, n = draw.type.shape
    one = np.array(list(itertools.permutations(range(n))), dtype=np.int64)
    every = list(itertools.product(range(len(one)), repeat=math.prod(outer)))
    values = one[np.array(every, dtype=np.int64)].reshape(len(every), *draw.type.shape)
    return values, numbers.ratio(np.ones((len(values), 1), np.int64), np.full((len(values), 1), len(values)))


def _total(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    """How many of some conditions hold: of each, its draw's chance, and whether it holds with it, and without it."""
    p, *ends = numbers.argument(draw, args[0]), *args[1:]
    p = np.minimum(np.maximum(np.where(p == p, p, 0), 0), 1)
    row = np.ones((1, 1), p.dtype) if p.dtype != object else numbers.ratio(np.ones((1, 1), int), np.ones((1, 1), int))
    for chance, on, off in zip(p, *ends, strict=True):
        holds = np.where(on, np.where(off, 1, chance), np.where(off, 1 - chance, 0))
        shape = (1, max(row.shape[-1], holds.shape[-1]))
        none = np.zeros(shape, row.dtype)
        row = np.concatenate([row * (1 - holds), none]) + np.concatenate([none, row * holds])
    return np.arange(len(row)), row


def _arrangement(draw: Draw, args: list[Array], numbers: ProbabilityArithmetic) -> tuple[Array, Array]:
    """What may stand in some places of a permutation, as far as its values are told apart; elsewhere, any of them."""
    alike, places = (a[:, 0] for a in args)
    kinds, counts = np.unique(alike, return_counts=True)
    left, ways = counts[None, :], np.ones(1, dtype=object)
    chosen = np.empty((1, 0), np.int64)
    for _ in places:
        row, kind = np.nonzero(left)
        ways = ways[row] * left[row, kind]
        chosen = np.concatenate([chosen[row], kinds[kind][:, None]], axis=1)
        left = left[row] - (np.arange(len(kinds)) == kind[:, None])
    values = np.full((len(chosen), draw.type.size), kinds[0])
    values[:, places] = chosen
    return values, numbers.ratio(ways[:, None], np.full((1, 1), math.perm(draw.type.size, len(places)), dtype=object))


def _arrangements(draw: Draw) -> float:
    """How many there are: in each number of places, of ever more kinds of values."""
    alike, places = draw.args
    assert isinstance(alike, Const) and isinstance(places, Const)
    ways = [1] + [0] * places.type.size
    for held in Counter(alike.flat).values():
        ways = [sum(ways[k - i] * math.comb(k, i) for i in range(min(k, held) + 1)) for k in range(len(ways))]
    return float(min(ways[-1], 10**300))


_TABLES: dict[str, Callable[[Draw, list[Array], ProbabilityArithmetic], tuple[Array, Array]]] = {
    "index": _index,
    "bernoulli": _bernoulli,
    "categorical": _categorical,
    "permutation": _permutation,
    "poisson": _poisson,
    "total": _total,
    "arrangement": _arrangement,
}
