"""Draws of many steps or lanes at once: values over a batch of words, by NumPy, to the bit those of `draws.sample`."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.draws.layout import WordLayout, poisson_bound, row_table, words_of
from taskspec.draws.sample import bernoulli_threshold
from taskspec.lang.ir import Const, Draw, plain

Array = np.ndarray[Any, Any]


def batch_sampler(layout: WordLayout, words: Array) -> Callable[[Draw, list[Array]], Array]:
    """A sampler for `lang.batch`: every draw over a block of words, uint32 (count, N), as `draws.sample` gives it."""

    def sample(draw: Draw, args: list[Array]) -> Array:
        first = layout.first[draw.site]
        mine = words[first : first + words_of(draw)]
        flat = _SAMPLE[draw.base](draw, args, mine)
        return np.asarray(flat).reshape(*draw.type.shape, words.shape[1])

    return sample


def _rows(draw: Draw, arg: Array) -> Array:
    """An argument with one row for every element of the draw: (size, N or 1)."""
    flat = arg.reshape(-1, arg.shape[-1])
    return np.broadcast_to(flat, (draw.type.size, flat.shape[1]))


def _grouped(draw: Draw, words: Array) -> Array:
    """Words as (words an element, elements, N)."""
    size = draw.type.size
    return np.moveaxis(words.reshape(size, -1, words.shape[1]), 1, 0)


def _real(values: Array) -> Array:
    return values.astype(np.float64)


def _normal(draw: Draw, args: list[Array], words: Array) -> Array:
    return _real(draws.normals(words, draw.type.size))


def _dirichlet(draw: Draw, args: list[Array], words: Array) -> Array:
    return _real(draws.dirichlets(words, _rows(draw, args[0])))


def _poisson(draw: Draw, args: list[Array], words: Array) -> Array:
    rates, bound = draw.args[0], poisson_bound(draw)
    if bound is None:
        assert isinstance(rates, Const)
        flat = rates.flat * (draw.type.size if rates.type.is_scalar else 1)
        tables = [draws.poisson_table(float(r)) for r in flat]
        rows = [first + draws.categoricals(w, t).astype(np.int64) for (first, t), w in zip(tables, words, strict=True)]
        return np.stack(rows)
    return draws.poissons(_grouped(draw, words), _rows(draw, args[0]), bound).astype(np.int64)


def _index(draw: Draw, args: list[Array], words: Array) -> Array:
    return draws.indices(words, _rows(draw, args[0])).astype(np.int64)


def _categorical(draw: Draw, args: list[Array], words: Array) -> Array:
    p = draw.args[0]
    if isinstance(p, Const):
        return draws.categoricals(words, _limits(p)).astype(np.int64)
    looked_up = row_table(p)
    if looked_up is not None:
        rows, which = np.unique(args[0], axis=1, return_inverse=True)
        table, last = draws.threshold_table([_exact_row(looked_up[0], row) for row in rows.T.tolist()])
        chosen = np.broadcast_to(which.reshape(-1), words.shape[1:])
        return draws.row_categoricals(words, chosen, table, last).astype(np.int64)
    weights = args[0].reshape(-1, 1, args[0].shape[-1])
    return draws.weighted_categoricals(words, weights).astype(np.int64)


@lru_cache(maxsize=256)
def _limits(p: Const) -> Array:
    """Thresholds of constant probabilities; sets of thousands of outcomes take a while, once."""
    return draws.reachable(draws.thresholds(p.flat))


def _exact_row(table: Const, row: list[float]) -> tuple[Any, ...]:
    """The row of a table of probabilities, in the exact numbers it was written with."""
    k = table.type.shape[-1]
    rows = (table.flat[i : i + k] for i in range(0, len(table.flat), k))
    return next(r for r in rows if [float(plain(v)) for v in r] == row)


def _bernoulli(draw: Draw, args: list[Array], words: Array) -> Array:
    p = draw.args[0]
    if isinstance(p, Const):
        flat = p.flat * (draw.type.size if p.type.is_scalar else 1)
        limits = np.array([bernoulli_threshold(v) for v in flat], np.uint64)
        return words.astype(np.uint64) < limits[:, None]
    return draws.bernoullis(words, _rows(draw, args[0]))


def _permutation(draw: Draw, args: list[Array], words: Array) -> Array:
    n = draw.type.shape[-1]
    grouped = np.moveaxis(words.reshape(-1, n, words.shape[1]), 1, 0)
    return np.moveaxis(draws.permutations(grouped), 0, 1).astype(np.int64)


_SAMPLE: dict[str, Callable[[Draw, list[Array], Array], Array]] = {
    "uniform": lambda draw, args, words: _real(draws.uniforms(words)),
    "exponential": lambda draw, args, words: _real(draws.exponentials(words)),
    "normal": _normal,
    "dirichlet": _dirichlet,
    "poisson": _poisson,
    "index": _index,
    "categorical": _categorical,
    "bernoulli": _bernoulli,
    "permutation": _permutation,
}
