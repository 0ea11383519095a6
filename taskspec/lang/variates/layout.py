"""Which random words a draw takes: the words of a phase, dealt out to its draws in the order they were written.

A step and a reset are phases of their own. Each has a `WordLayout` (`Task.step_words`, `Task.reset_words`) over all the draws
that its sections write, those included whose values turn out not to matter: what a word is for depends on the text of the spec
alone, and on no simplification.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from taskspec.lang.ir import Draw, Node
from taskspec.lang.ir import draws as draws_below
from taskspec.lang.variates import VARIATES


def words_of(draw: Draw) -> int:
    """How many words a draw takes."""
    return VARIATES[draw.base].words(draw)


@dataclass(frozen=True)
class WordLayout:
    """The draws of a phase and the first word of each, by site; `count` words in all."""

    draws: tuple[Draw, ...]
    first: dict[int, int]
    count: int

    @classmethod
    def of(cls, roots: Iterable[Node]) -> WordLayout:
        """The layout of the draws that some expressions are made of."""
        return cls.dealt(draws_below(roots))

    @classmethod
    def dealt(cls, draws: Iterable[Draw]) -> WordLayout:
        """Words for each of the draws, in the order of their sites."""
        found, first, count = tuple(sorted(draws, key=lambda d: d.site)), {}, 0
        for draw in found:
            first[draw.site] = count
            count += words_of(draw)
        return cls(found, first, count)
