"""Where brackets stand: for every operator how tightly it binds, and how tightly each of its operands must.

One table for what is printed as text, where the grammar of the language decides, and one for mathematics, where the eye does:
a fraction and a floor enclose what is in them, a remainder binds less than a product, a sum sign takes the product after it,
and two signs never stand side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from taskspec.lang.functions import INFIX


@dataclass(frozen=True, slots=True)
class Rule:
    """How tightly an operator binds, and its operands at least; the last entry holds for all further operands.

    `lead` says that the first operand may begin with a sign.
    """

    own: int
    operands: tuple[int, ...]
    lead: bool = False

    def operand(self, i: int) -> int:
        return self.operands[min(i, len(self.operands) - 1)]


# -- text -------------------------------------------------------------------------------------------------------------

CHOICE, SIGN, NAME = 0, 7, 9
"""Text: `a if b else c`, `-x`, and what needs no brackets anywhere. The levels in between are those of the operator table."""


def _grammar(symbol: str) -> Rule:
    """An operator that groups from the left."""
    own = INFIX[symbol].precedence
    return Rule(own, (own, own + 1))


_OR, _AND, _NOT, _COMPARE, _SUM, _POWER = (INFIX[symbol].precedence for symbol in ("or", "and", "not", "==", "+", "**"))
TEXT: dict[str, Rule] = {
    **{symbol: _grammar(symbol) for symbol in ("+", "-", "*", "/", "//", "%")},
    "**": Rule(_POWER, (NAME, SIGN)),
    "sign": Rule(SIGN, (SIGN,)),
    "compare": Rule(_COMPARE, (_SUM,)),
    "not": Rule(_NOT, (_NOT,)),
    "and": Rule(_AND, (_NOT,)),
    "or": Rule(_OR, (_AND,)),
    "if": Rule(CHOICE, (_OR, _OR, CHOICE)),  # value, condition, otherwise
    "clause": Rule(CHOICE, (_OR,)),
    "subscript": Rule(NAME, (NAME,)),
}


# -- mathematics ------------------------------------------------------------------------------------------------------


class Level(IntEnum):
    """How tightly notation binds, from what runs on as far as it can to what needs no brackets anywhere."""

    SCOPE = 0
    OR = 1
    AND = 2
    NOT = 3
    RELATION = 4
    EXTREME = 5  # the sides of relations
    SUM = 6
    REMAINDER = 7
    BIG = 8
    PRODUCT = 9
    FACTOR = 10
    POWER = 11
    ATOM = 12


ENCLOSED = Rule(Level.ATOM, (Level.SCOPE,))
"""Whatever stands between delimiters of its own, as the arguments of most functions do."""

NOTATION: dict[str, Rule] = {
    "or": Rule(Level.OR, (Level.NOT,)),  # two different connectives side by side are easier to read with brackets
    "and": Rule(Level.AND, (Level.NOT,)),
    "not": Rule(Level.NOT, (Level.ATOM,)),
    "compare": Rule(Level.RELATION, (Level.EXTREME,)),
    "congruence": Rule(Level.RELATION, (Level.SUM, Level.SCOPE), lead=True),
    "+": Rule(Level.SUM, (Level.SUM,), lead=True),
    "-": Rule(Level.SUM, (Level.SUM, Level.REMAINDER), lead=True),
    "%": Rule(Level.REMAINDER, (Level.PRODUCT, Level.FACTOR)),
    "sign": Rule(Level.PRODUCT, (Level.BIG,)),
    "*": Rule(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True),
    "/": Rule(Level.FACTOR, (Level.SCOPE,), lead=True),
    "//": Rule(Level.ATOM, (Level.PRODUCT, Level.FACTOR), lead=True),
    "**": Rule(Level.POWER, (Level.ATOM, Level.SCOPE)),
    "cases": Rule(Level.FACTOR, (Level.SCOPE,)),
    "subscript": Rule(Level.ATOM, (Level.ATOM, Level.SCOPE)),
    "quantifier": Rule(Level.SCOPE, (Level.SCOPE,)),
    "extreme": Rule(Level.EXTREME, (Level.FACTOR,)),
    "big": Rule(Level.BIG, (Level.BIG,)),
    "domain": Rule(Level.RELATION, (Level.EXTREME,)),
    # functions and distributions, by name; those that are not here enclose their arguments
    "exp": Rule(Level.POWER, (Level.SCOPE,)),
    "dot": Rule(Level.PRODUCT, (Level.PRODUCT, Level.FACTOR), lead=True),
    "put": Rule(Level.ATOM, (Level.ATOM, Level.SCOPE)),
    "sum": Rule(Level.BIG, (Level.BIG,)),
    "prod": Rule(Level.BIG, (Level.BIG,)),
    "any": Rule(Level.SCOPE, (Level.ATOM,)),
    "all": Rule(Level.SCOPE, (Level.ATOM,)),
    "Normal": Rule(Level.ATOM, (Level.SCOPE, Level.ATOM)),
}
