"""Which random words a draw takes: the words of a phase, dealt out to its draws in the order they were written.

A step and a reset are phases of their own; each has a `Layout` over the draws below its roots.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from taskspec import draws
from taskspec.lang.ir import Apply, Const, Draw, Node
from taskspec.lang.ir import draws as draws_below


def words_of(draw: Draw) -> int:
    """How many words a draw takes."""
    size = draw.type.size
    match draw.base:
        case "normal":
            return draws.normal_words(size)
        case "gamma":
            return draws.GAMMA_WORDS * size
        case "poisson" if not isinstance(draw.args[0], Const):
            return draws.poisson_words(poisson_bound(draw)) * size
        case _:
            return size


def poisson_bound(draw: Draw) -> float:
    """The largest rate of a Poisson draw, fixed when the task is built."""
    bound = draw.args[1]
    assert isinstance(bound, Const)
    return float(bound.value)


def row_table(p: Node) -> tuple[Const, Node] | None:
    """For probabilities looked up in a constant table: the table (rows, k) and the row's number; else None."""
    match p:
        case Apply(op="index", args=(Const() as table, row)) if row.type.is_scalar:
            return table, row
        case _:
            return None


@dataclass(frozen=True)
class Layout:
    """The draws of a phase and the first word of each, by site; `count` words in all."""

    draws: tuple[Draw, ...]
    first: dict[int, int]
    count: int

    @classmethod
    def of(cls, roots: Iterable[Node]) -> Layout:
        found, first, count = draws_below(roots), {}, 0
        for draw in found:
            first[draw.site] = count
            count += words_of(draw)
        return cls(found, first, count)
