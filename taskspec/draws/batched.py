"""Values of draws over a batch of lanes, from the same words and to the same bit as `draws.sample`.

Arrays carry the lanes last, as in `lang.batch`: words are uint32 (count, lanes), values (*shape, lanes).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.draws.layout import Layout, poisson_bound, row_table
from taskspec.draws.sample import bernoulli_threshold
from taskspec.lang.ir import Const, Draw

Array = np.ndarray[Any, Any]
BatchSampler = Callable[[Draw, list[Array]], Array]


def batch_sampler(layout: Layout, words: Array) -> BatchSampler:
    """A sampler for `lang.batch.evaluate`.

    Args:
        layout: of the phase to which the words belong.
        words: uint32 (layout.count or more, lanes).
    """

    def sample(draw: Draw, args: list[Array]) -> Array:
        mine = words[layout.first[draw.site] :]
        values = _SAMPLE[draw.base](draw, args, mine)
        return values.reshape(*draw.type.shape, words.shape[-1])

    return sample


def _own(draw: Draw, words: Array) -> Array:
    return words[: draw.type.size]


def _real(values: Array) -> Array:
    return values.astype(np.float64)


def _elements(arg: Array, draw: Draw) -> Array:
    """An argument as (size, lanes or 1), a scalar standing for every element."""
    return arg.reshape(-1, arg.shape[-1]) if arg.ndim > 1 else arg[None]


def _normal(draw: Draw, args: list[Array], words: Array) -> Array:
    size = draw.type.size
    return _real(draws.normals(words[: draws.normal_words(size)], size))


def _gamma(draw: Draw, args: list[Array], words: Array) -> Array:
    size = draw.type.size
    grouped = words[: draws.GAMMA_WORDS * size].reshape(size, draws.GAMMA_WORDS, -1)
    return _real(draws.gammas(np.moveaxis(grouped, 1, 0), _elements(args[0], draw)))


def _poisson(draw: Draw, args: list[Array], words: Array) -> Array:
    size, rate = draw.type.size, draw.args[0]
    if isinstance(rate, Const):
        rates = rate.flat * size if len(rate.flat) == 1 else rate.flat
        tables = [draws.poisson_table(float(r)) for r in rates]
        rows = zip(tables, words, strict=False)
        return np.stack([f + draws.categoricals(w, t).astype(np.int64) for (f, t), w in rows])
    bound = poisson_bound(draw)
    step = draws.poisson_words(bound)
    grouped = np.moveaxis(words[: step * size].reshape(size, step, -1), 1, 0)
    return draws.poissons(grouped, _elements(args[0], draw), bound).astype(np.int64)


def _index(draw: Draw, args: list[Array], words: Array) -> Array:
    counts = np.maximum(_elements(args[0], draw), 1)
    return draws.indices(_own(draw, words), counts).astype(np.int64)


def _categorical(draw: Draw, args: list[Array], words: Array) -> Array:
    mine, p = _own(draw, words), draw.args[0]
    if isinstance(p, Const):
        return draws.categoricals(mine, draws.thresholds(p.flat)).astype(np.int64)
    if row_table(p) is not None:
        return _by_rows(mine, args[0])
    weights = np.broadcast_to(args[0], (args[0].shape[0], mine.shape[-1]))
    drawn = [draws.weighted_categoricals(row, weights) for row in mine]
    return np.stack(drawn).astype(np.int64)


def _by_rows(words: Array, p: Array) -> Array:
    """Draws from rows of a table: exact thresholds for each distinct row."""
    distinct, which = np.unique(p.T, axis=0, return_inverse=True)
    table, last = draws.threshold_table([row.tolist() for row in distinct])
    which = np.broadcast_to(which.reshape(-1), (words.shape[-1],))
    return np.stack([draws.row_categoricals(row, which, table, last) for row in words]).astype(np.int64)


def _bernoulli(draw: Draw, args: list[Array], words: Array) -> Array:
    mine, p = _own(draw, words), draw.args[0]
    if isinstance(p, Const):
        each = p.flat * len(mine) if len(p.flat) == 1 else p.flat
        limits = [bernoulli_threshold(q if isinstance(q, Fraction) else float(q)) for q in each]
        return mine.astype(np.uint64) < np.array(limits, np.uint64)[:, None]
    return draws.bernoullis(mine, _elements(args[0], draw))


def _permutation(draw: Draw, args: list[Array], words: Array) -> Array:
    n = draw.type.shape[-1]
    grouped = _own(draw, words).reshape(-1, n, words.shape[-1])
    return np.stack([draws.permutations(row) for row in grouped]).astype(np.int64)


_SAMPLE: dict[str, Callable[[Draw, list[Array], Array], Array]] = {
    "uniform": lambda draw, args, words: _real(draws.uniforms(_own(draw, words))),
    "exponential": lambda draw, args, words: _real(draws.exponentials(_own(draw, words))),
    "normal": _normal,
    "gamma": _gamma,
    "poisson": _poisson,
    "index": _index,
    "categorical": _categorical,
    "bernoulli": _bernoulli,
    "permutation": _permutation,
}
