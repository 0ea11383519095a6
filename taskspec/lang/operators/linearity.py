"""Where a value is linear in what its arguments are linear in."""

from __future__ import annotations

from collections.abc import Sequence


def every(below: Sequence[bool]) -> bool:
    """Sums, and what only chooses elements."""
    return True


def one(below: Sequence[bool]) -> bool:
    """Products: of two dependent factors a square may come."""
    return sum(below) == 1


def unless_second(below: Sequence[bool]) -> bool:
    return not below[1]


def unless_first(below: Sequence[bool]) -> bool:
    return not below[0]
