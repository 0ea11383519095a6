"""Parts of notation: binding strength and brackets, templates of operators, products, primes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.operators import FUNCTIONS, INFIX
from taskspec.language.expressions.operators.entry import ENCLOSED, Brackets, Level
from taskspec.show.printers import tree as m
from taskspec.show.printers.tex import read

# One table for what is printed as text, where the grammar of the language decides, and one for mathematics, where the eye
# does (operators, functions and distributions say it in their entries): a fraction and a floor enclose what is in them, a
# remainder binds less than a sum, a sum sign takes the product after it, and two signs never stand side by side.

CHOICE = 0  # `a if b else c`
SIGN = 7  # `-x`; the operator table has the levels in between
NAME = 9  # what needs no brackets anywhere
_OR, _AND, _NOT, _COMPARE, _SUM, _POWER = (INFIX[symbol].precedence for symbol in ("or", "and", "not", "==", "+", "**"))
TEXT: dict[str, Brackets] = {
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
for _symbol in ("+", "-", "*", "/", "//", "%"):  # grouped from the left
    TEXT[_symbol] = Brackets(INFIX[_symbol].precedence, (INFIX[_symbol].precedence, INFIX[_symbol].precedence + 1))

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


@dataclass(frozen=True, slots=True)
class Piece:
    """A tree, how tightly its outermost operator binds, and whether it begins with a sign."""

    tree: m.Math
    level: int = Level.ATOM
    signed: bool = False

    def at(self, level: int, lead: bool = False) -> m.Math:
        """Bracket a tree where it must bind at least this tightly; in sums and products only the first has a sign."""
        fits = self.level >= level and (lead or not self.signed or level <= Level.EXTREME)
        if fits:
            return self.tree
        return m.brackets(self.tree)


def operands(operator: str, pieces: Iterable[Piece]) -> list[m.Math]:
    """Set operands, with the brackets that their operator asks for."""
    rule = NOTATION.get(operator, ENCLOSED)
    operands = []
    for i, piece in enumerate(pieces):
        operands.append(piece.at(rule.operand(i), lead=rule.lead and i == 0))
    return operands


def applied(operator: str, tree: m.Math, signed: bool = False) -> Piece:
    return Piece(tree, NOTATION.get(operator, ENCLOSED).own, signed)


def prime(tree: m.Math, primed: bool = True) -> m.Math:
    if not primed:
        return tree
    if isinstance(tree, m.Script) and tree.sup is None:
        return replace(tree, primes=tree.primes + 1)
    return m.Script(tree, primes=1)


def indexed(tree: m.Math, below: m.Math) -> m.Math:
    if not isinstance(tree, m.Script):
        return m.Script(tree, below)
    if tree.sub is not None:
        below = m.Row((tree.sub, m.Sym(","), below))
    return replace(tree, sub=below)


def indicator(truth: m.Math) -> m.Math:
    return m.Row((m.Ident("1", "blackboard"), m.Fence("[", truth, "]")))


def multiply(trees: Sequence[m.Math], vectors: Sequence[bool]) -> m.Math:
    """Write a product: letters and numbers stand side by side, anything else takes a dot.

    Vectors that are multiplied element by element take a dot in a circle, for a dot alone is their inner product.
    """
    out = [trees[0]]
    after_vector = vectors[0]
    for tree, is_vector in zip(trees[1:], vectors[1:], strict=True):
        if after_vector and is_vector:
            out.append(m.Sym("⊙"))
        elif not _may_touch(out[-1], tree):
            out.append(m.Sym("⋅"))
        elif _is_name(tree):
            out.append(m.Gap())
        out.append(tree)
        after_vector = after_vector or is_vector
    return m.Row(tuple(out))


def _may_touch(left: m.Math, right: m.Math) -> bool:
    if isinstance(right, m.Script | m.Ident) and _letter(right):
        if isinstance(left, m.Row) and len(left.items) == 2 and isinstance(left.items[0], m.Sym):  # a sign
            return _letter(left.items[1]) or isinstance(_last(left), m.Num | m.Frac)
        return _letter(left) or isinstance(_last(left), m.Num | m.Frac)
    if isinstance(right, m.Fence) and right.left == "(":
        return isinstance(_last(left), m.Num)
    return _is_name(right) and (_letter(left) or isinstance(left, m.Num))


def _letter(node: m.Math) -> bool:
    match node:
        case m.Ident(text=text, style=style):
            return len(text) == 1 and style == "italic"
        case m.Script(base=base):
            return _letter(base)
        case _:
            return False


def _last(node: m.Math) -> m.Math:
    """End of a factor: the 2 of -2."""
    if isinstance(node, m.Row) and node.items:
        return _last(node.items[-1])
    return node


def _is_name(node: m.Math) -> bool:
    match node:
        case m.Row(items=(m.Ident(), m.Fence(left="("))):
            return True
        case _:
            return False


def fill(latex: str, holes: Iterable[tuple[str, m.Math]]) -> m.Math:
    """Fill the holes of a template of the operator table with trees."""
    values = dict(holes)
    return _filled(_parsed(latex, tuple(values)), values)


@lru_cache(maxsize=512)
def _parsed(latex: str, names: tuple[str, ...]) -> m.Math:
    return read(latex, frozenset((*names, "*")))


def _filled(node: m.Math, values: Mapping[str, m.Math]) -> m.Math:
    if isinstance(node, m.Hole):
        return values.get(node.name, node)
    result: m.Math = m.mapped(node, partial(_filled, values=values))
    match result:
        case m.Script(base=m.Num(text="0" | "1") as base, sub=None, sup=m.Num(text="2"), primes=0):
            return base  # nobody writes 1 squared
        case _:
            return result
