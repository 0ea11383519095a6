"""How tightly notation binds, which decides where brackets stand."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """How tightly notation binds, from what runs on as far as it can to what needs no brackets anywhere."""

    SCOPE = 0
    OR = 1
    AND = 2
    NOT = 3
    RELATION = 4
    EXTREME = 5  # the sides of relations
    REMAINDER = 6  # below sums: readers take a remainder of all that stands left of it
    SUM = 7
    BIG = 8
    PRODUCT = 9
    FACTOR = 10
    POWER = 11
    ATOM = 12


@dataclass(frozen=True, slots=True)
class Brackets:
    """How tightly an operator binds, and its operands at least; the last entry holds for all further operands.

    `lead` says that the first operand may begin with a sign.
    """

    own: int
    operands: tuple[int, ...]
    lead: bool = False

    def operand(self, i: int) -> int:
        return self.operands[min(i, len(self.operands) - 1)]


ENCLOSED = Brackets(Level.ATOM, (Level.SCOPE,))
"""Whatever stands between delimiters of its own, as the arguments of most functions do."""
