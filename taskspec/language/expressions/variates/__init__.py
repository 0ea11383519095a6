"""The table of base variates, the random words that each draw takes, and the value of a draw from its words.

An entry of the table is the single source of everything known about a base variate. Distributions (`expressions.dists`) are
arithmetic over base variates. A new one is an entry, its value over arrays in `draws`, and the same for JAX and Numba.

A step and a reset are phases of their own. Each has a `WordLayout` (`Task.step_words`, `Task.reset_words`) over all the draws
that its sections write, those included whose values turn out not to matter: what a word is for depends on the text of the spec
alone, and on no simplification.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.named import entries_by_name
from taskspec.language import draws
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.ir import Draw
from taskspec.language.expressions.ir import draws as draws_below
from taskspec.language.expressions.types import Expression
from taskspec.language.expressions.variates import choices, quantities
from taskspec.language.expressions.variates.entry import Flat, Variate, Words

VARIATES: dict[str, Variate] = entries_by_name((*choices.TABLE, *quantities.TABLE))


def words_of(draw: Draw) -> int:
    return VARIATES[draw.base].words(draw)


@dataclass(frozen=True)
class WordLayout:
    """The draws of a phase and the first word of each, by site; `count` words in all."""

    draws: tuple[Draw, ...]
    first: dict[int, int]
    count: int

    @classmethod
    def of(cls, roots: Iterable[Expression]) -> WordLayout:
        return cls.dealt(draws_below(roots))

    @classmethod
    def dealt(cls, draws: Iterable[Draw]) -> WordLayout:
        """Deal words to each of the draws, in the order of their sites."""
        by_site = tuple(sorted(draws, key=lambda d: d.site))
        first = {}
        count = 0
        for draw in by_site:
            first[draw.site] = count
            count += words_of(draw)
        return cls(by_site, first, count)


# The value of a draw from its words: one draw at a time on Python numbers, or many by NumPy, to the bit the same.


def sampler(layout: WordLayout, words: Words) -> Callable[[Draw, list[Flat]], Flat]:
    """Sample for `evaluate`: every draw of a phase has the value of its words."""

    def sample(draw: Draw, args: list[Flat]) -> Flat:
        return one(draw)(args, words[layout.first[draw.site] :])

    return sample


def batch_sampler(layout: WordLayout, words: Array) -> Callable[[Draw, list[Array]], Array]:
    """Sample for `batch.evaluate`: every draw over a block of words, uint32 (count, N), (*shape, N) each."""

    def sample(draw: Draw, args: list[Array]) -> Array:
        first = layout.first[draw.site]
        return _many(draw, args, words[first : first + words_of(draw)])

    return sample


def one(draw: Draw) -> Callable[[list[Flat], Words], Flat]:
    return partial(VARIATES[draw.base].one or _batch_of_one, draw)


def many(draw: Draw) -> Callable[[Sequence[Array], Array], Array]:
    """Get the function from a draw's arguments (*shape, N or 1) and words (count, N) to its values (*shape, N)."""
    return partial(_many, draw)


def _many(draw: Draw, args: Sequence[Array], words: Array) -> Array:
    form = VARIATES[draw.base].many
    assert form is not None, draw.base
    values = np.asarray(form(draws, draw, args, words))
    return values.astype(DTYPES[draw.type.kind], copy=False).reshape(*draw.type.shape, words.shape[1])


def _batch_of_one(draw: Draw, args: list[Flat], words: Words) -> Flat:
    given = []
    for node, flat in zip(draw.args, args, strict=True):
        given.append(np.array(flat, DTYPES[node.type.kind]).reshape(*node.type.shape, 1))
    column = np.array(words[: words_of(draw)], np.uint32)[:, None]
    return tuple(_many(draw, given, column).reshape(-1).tolist())
