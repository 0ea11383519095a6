"""The value of a draw from its words: one draw at a time on Python numbers, or many by NumPy, to the bit the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.lang.batch import DTYPES
from taskspec.lang.ir import Draw
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.entry import Flat, Words
from taskspec.lang.variates.layout import WordLayout, words_of

Array = np.ndarray[Any, Any]


def sampler(layout: WordLayout, words: Words) -> Callable[[Draw, list[Flat]], Flat]:
    """A sampler for `lang.evaluate`: gives every draw of a phase the value of its words."""

    def sample(draw: Draw, args: list[Flat]) -> Flat:
        return one(draw)(args, words[layout.first[draw.site] :])

    return sample


def batch_sampler(layout: WordLayout, words: Array) -> Callable[[Draw, list[Array]], Array]:
    """A sampler for `lang.batch`: every draw over a block of words, uint32 (count, N), (*shape, N) each."""

    def sample(draw: Draw, args: list[Array]) -> Array:
        first = layout.first[draw.site]
        return many(draw)(args, words[first : first + words_of(draw)])

    return sample


def one(draw: Draw) -> Callable[[Sequence[Flat], Words], Flat]:
    """The function of a draw's arguments and words on Python numbers."""
    return partial(VARIATES[draw.base].one or _alone, draw)


def many(draw: Draw) -> Callable[[Sequence[Array], Array], Array]:
    """The function of a draw's arguments (*shape, N or 1) and words (count, N) that gives its values (*shape, N)."""
    return partial(_many, draw)


def _many(draw: Draw, args: Sequence[Array], words: Array) -> Array:
    form = VARIATES[draw.base].many
    assert form is not None, draw.base
    found = np.asarray(form(draws, draw, args, words))
    return found.astype(DTYPES[draw.type.kind], copy=False).reshape(*draw.type.shape, words.shape[1])


def _alone(draw: Draw, args: Sequence[Flat], words: Words) -> Flat:
    """A batch of one."""
    given = [
        np.array(flat, DTYPES[a.type.kind]).reshape(*a.type.shape, 1) for a, flat in zip(draw.args, args, strict=True)
    ]
    column = np.array(words[: words_of(draw)], np.uint32)[:, None]
    return tuple(_many(draw, given, column).reshape(-1).tolist())
