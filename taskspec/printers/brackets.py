"""Where brackets stand: for every operator how tightly it binds, and how tightly each of its operands must.

One table for what is printed as text, where the grammar of the language decides, and one for mathematics, where the eye does
(operators, functions and distributions say it in their entries):
a fraction and a floor enclose what is in them, a remainder binds less than a sum, a sum sign takes the product after it,
and two signs never stand side by side.
"""

from __future__ import annotations

from taskspec.lang.dists import DISTS
from taskspec.lang.operators import FUNCTIONS, INFIX
from taskspec.lang.operators.levels import Brackets, Level

# -- text -------------------------------------------------------------------------------------------------------------

CHOICE, SIGN, NAME = 0, 7, 9
"""Text: `a if b else c`, `-x`, and what needs no brackets anywhere. The levels in between are those of the operator table."""


def _grammar(symbol: str) -> Brackets:
    """An operator that groups from the left."""
    own = INFIX[symbol].precedence
    return Brackets(own, (own, own + 1))


_OR, _AND, _NOT, _COMPARE, _SUM, _POWER = (INFIX[symbol].precedence for symbol in ("or", "and", "not", "==", "+", "**"))
TEXT: dict[str, Brackets] = {
    **{symbol: _grammar(symbol) for symbol in ("+", "-", "*", "/", "//", "%")},
    "**": Brackets(_POWER, (NAME, SIGN)),
    "sign": Brackets(SIGN, (SIGN,)),
    "compare": Brackets(_COMPARE, (_SUM,)),
    "not": Brackets(_NOT, (_NOT,)),
    "and": Brackets(_AND, (_NOT,)),
    "or": Brackets(_OR, (_AND,)),
    "if": Brackets(CHOICE, (_OR, _OR, CHOICE)),  # value, condition, otherwise
    "clause": Brackets(CHOICE, (_OR,)),
    "subscript": Brackets(NAME, (NAME,)),
}


# -- mathematics ------------------------------------------------------------------------------------------------------


NOTATION: dict[str, Brackets] = {
    **{symbol: infix.brackets for symbol, infix in INFIX.items() if infix.brackets is not None},
    **{name: written.brackets for table in (FUNCTIONS, DISTS) for name, written in table.items()},
    "compare": Brackets(Level.RELATION, (Level.EXTREME,)),
    "congruence": Brackets(Level.RELATION, (Level.SUM, Level.SCOPE), lead=True),
    "sign": Brackets(Level.PRODUCT, (Level.BIG,)),
    "cases": Brackets(Level.FACTOR, (Level.SCOPE,)),
    "subscript": Brackets(Level.ATOM, (Level.ATOM, Level.SCOPE)),
    "quantifier": Brackets(Level.SCOPE, (Level.SCOPE,)),
    "extreme": Brackets(Level.EXTREME, (Level.FACTOR,)),
    "big": Brackets(Level.BIG, (Level.BIG,)),
    "domain": Brackets(Level.RELATION, (Level.EXTREME,)),
}
