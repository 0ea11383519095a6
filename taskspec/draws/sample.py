"""The value of a draw from its words: the meaning that every backend reproduces, one draw at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

from taskspec import draws
from taskspec.draws.layout import WordLayout, poisson_bound, row_table, words_of
from taskspec.lang.ir import Const, Draw

Flat = tuple[Any, ...]
Words = Sequence[int]


def sampler(layout: WordLayout, words: Words) -> Callable[[Draw, list[Flat]], Flat]:
    """A sampler for `lang.evaluate`: gives every draw of a phase the value of its words."""

    def sample(draw: Draw, args: list[Flat]) -> Flat:
        return _SAMPLE[draw.base](draw, args, words[layout.first[draw.site] :])

    return sample


def _each(function: Callable[[int], Any]) -> Callable[[Draw, list[Flat], Words], Flat]:
    return lambda draw, args, words: tuple(function(w) for w in words[: draw.type.size])


def _normal(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.size
    return draws.normal(words[: draws.normal_words(n)], n)


def _dirichlet(draw: Draw, args: list[Flat], words: Words) -> Flat:
    return draws.dirichlet(words[: words_of(draw)], [float(a) for a in args[0]])


def _poisson(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.size
    rates = _stretch(args[0], n)
    bound = poisson_bound(draw)
    if bound is None:
        tables = [draws.poisson_table(float(rate)) for rate in rates]
        return tuple(f + draws.categorical(w, t) for (f, t), w in zip(tables, words, strict=False))
    step = draws.poisson_words(bound)
    return tuple(draws.poisson(words[step * i : step * (i + 1)], float(r), bound) for i, r in enumerate(rates))


def _index(draw: Draw, args: list[Flat], words: Words) -> Flat:
    counts = _stretch(args[0], draw.type.size)
    return tuple(draws.index(w, int(n)) for w, n in zip(words, counts, strict=False))


def _categorical(draw: Draw, args: list[Flat], words: Words) -> Flat:
    mine = words[: draw.type.size]
    p = draw.args[0]
    if isinstance(p, Const):
        table = draws.thresholds(p.flat)
        return tuple(draws.categorical(w, table) for w in mine)
    if row_table(p) is not None:
        # the row as it stands in the table: exact, whatever was rounded on the way
        table = draws.thresholds(args[0])
        return tuple(draws.categorical(w, table) for w in mine)
    return tuple(draws.weighted_categorical(w, [float(x) for x in args[0]]) for w in mine)


def _bernoulli(draw: Draw, args: list[Flat], words: Words) -> Flat:
    ps = _stretch(args[0], draw.type.size)
    if isinstance(draw.args[0], Const):
        return tuple(w < bernoulli_threshold(p) for w, p in zip(words, ps, strict=False))
    return tuple(draws.bernoulli(w, float(p)) for w, p in zip(words, ps, strict=False))


def bernoulli_threshold(p: Fraction | float) -> int:
    """A condition of constant probability (limited to [0, 1], NaN to 0) holds for the words below this."""
    return round(Fraction(min(p, 1)) * draws.NEVER) if p > 0 else 0


def _permutation(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.shape[-1]
    rows = draw.type.size // n
    return tuple(i for r in range(rows) for i in draws.permutation(words[r * n : (r + 1) * n]))


def _stretch(flat: Flat, size: int) -> Flat:
    return flat * size if len(flat) == 1 and size != 1 else flat


_SAMPLE: dict[str, Callable[[Draw, list[Flat], Words], Flat]] = {
    "uniform": _each(draws.uniform),
    "exponential": _each(draws.exponential),
    "normal": _normal,
    "dirichlet": _dirichlet,
    "poisson": _poisson,
    "index": _index,
    "categorical": _categorical,
    "bernoulli": _bernoulli,
    "permutation": _permutation,
}
