"""Parts of notation: binding strength and brackets, templates of operators, products, primes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from taskspec.lang.dists import DISTS
from taskspec.lang.operators import FUNCTIONS, INFIX
from taskspec.lang.operators.entry import ENCLOSED, Brackets, Level
from taskspec.printers import tree as m
from taskspec.printers.tex import read

# One table for what is printed as text, where the grammar of the language decides, and one for mathematics, where the eye does
# (operators, functions and distributions say it in their entries):
# a fraction and a floor enclose what is in them, a remainder binds less than a sum, a sum sign takes the product after it,
# and two signs never stand side by side.

# -- text -------------------------------------------------------------------------------------------------------------

CHOICE = 0
SIGN = 7
NAME = 9
"""Text: `a if b else c`, `-x`, and what needs no brackets anywhere. The levels in between are those of the operator table."""


def _grammar(symbol: str) -> Brackets:
    """Return an operator that groups from the left."""
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


# -- parts of notation


@dataclass(frozen=True, slots=True)
class Piece:
    """A tree, how tightly its outermost operator binds, and whether it begins with a sign."""

    tree: m.Math
    level: int = Level.ATOM
    signed: bool = False

    def at(self, level: int, lead: bool = False) -> m.Math:
        """Return the tree as an operand that must bind at least this tightly; in sums and products only the first has a sign."""
        fits = self.level >= level and (lead or not self.signed or level <= Level.EXTREME)
        return self.tree if fits else m.brackets(self.tree)


def operands(operator: str, pieces: Iterable[Piece]) -> list[m.Math]:
    """Return the operands of an operator, with the brackets that it asks for."""
    rule = NOTATION.get(operator, ENCLOSED)
    return [piece.at(rule.operand(i), lead=rule.lead and i == 0) for i, piece in enumerate(pieces)]


def applied(operator: str, tree: m.Math, signed: bool = False) -> Piece:
    """Return the application of an operator, as a piece."""
    return Piece(tree, NOTATION.get(operator, ENCLOSED).own, signed)


def prime(tree: m.Math, primed: bool = True) -> m.Math:
    """Return a symbol with a prime, between its subscript and whatever follows."""
    if not primed:
        return tree
    if isinstance(tree, m.Script) and tree.sup is None:
        return replace(tree, primes=tree.primes + 1)
    return m.Script(tree, primes=1)


def indicator(truth: m.Math) -> m.Math:
    return m.Row((m.Ident("1", "blackboard"), m.Fence("[", truth, "]")))


def multiply(trees: Sequence[m.Math]) -> m.Math:
    """Return a product: letters and numbers stand side by side, anything else takes a dot."""
    out: list[m.Math] = []
    for left, tree in zip([None, *trees], trees, strict=False):
        if left is not None and not _may_touch(left, tree):
            out.append(m.Sym("⋅"))
        elif left is not None and _is_name(tree):
            out.append(m.Gap())
        out.append(tree)
    return m.Row(tuple(out))


def _may_touch(left: m.Math, right: m.Math) -> bool:
    """Return whether two factors can stand side by side without being read as something else."""
    if isinstance(right, m.Script | m.Ident) and _letter(right):
        return _letter(_unsigned(left)) or isinstance(_last(left), m.Num | m.Frac)
    if isinstance(right, m.Fence) and right.left == "(":
        return isinstance(_last(left), m.Num)
    return _is_name(right) and (_letter(left) or isinstance(left, m.Num))


def _letter(node: m.Math) -> bool:
    """Return a single letter, with whatever is written around it."""
    match node:
        case m.Ident(text=text, style=style):
            return len(text) == 1 and style == "italic"
        case m.Script(base=base):
            return _letter(base)
        case _:
            return False


def _unsigned(node: m.Math) -> m.Math:
    """Return a factor without its sign."""
    if isinstance(node, m.Row) and len(node.items) == 2 and isinstance(node.items[0], m.Sym):
        return node.items[1]
    return node


def _last(node: m.Math) -> m.Math:
    """Return what a factor ends with: the 2 of -2."""
    return _last(node.items[-1]) if isinstance(node, m.Row) and node.items else node


def _is_name(node: m.Math) -> bool:
    """Return a named function with its arguments, such as sin(x)."""
    return (
        isinstance(node, m.Row)
        and len(node.items) == 2
        and isinstance(node.items[0], m.Ident)
        and isinstance(node.items[1], m.Fence)
        and node.items[1].left == "("
    )


def fill(latex: str, holes: Iterable[tuple[str, m.Math]]) -> m.Math:
    """Return a template of the operator table with trees in its holes."""
    values = dict(holes)
    return _tidy(_fill(parsed(latex, tuple(values)), values))


@lru_cache(maxsize=512)
def parsed(latex: str, names: tuple[str, ...]) -> m.Math:
    return read(latex, frozenset((*names, "*")))


def _fill(node: m.Math, values: Mapping[str, m.Math]) -> m.Math:
    def go(x: m.Math) -> m.Math:
        return _fill(x, values)

    def maybe(x: m.Math | None) -> m.Math | None:
        return None if x is None else go(x)

    match node:
        case m.Hole(name=name):
            return values.get(name, node)
        case m.Row(items=items):
            return m.Row(tuple(go(i) for i in items))
        case m.Frac(top=top, bottom=bottom):
            return m.Frac(go(top), go(bottom))
        case m.Root(body=body):
            return m.Root(go(body))
        case m.Accent(mark=mark, body=body):
            return m.Accent(mark, go(body))
        case m.Fence(left=left, body=body, right=right):
            return m.Fence(left, go(body), right)
        case m.Script(base=base, sub=sub, sup=sup, primes=primes):
            return m.Script(go(base), maybe(sub), maybe(sup), primes)
        case m.Big(symbol=sign, sub=sub, sup=sup):
            return m.Big(sign, maybe(sub), maybe(sup))
        case m.Cases(rows=rows):
            return m.Cases(tuple((go(a), go(b)) for a, b in rows))
        case m.Matrix(rows=lines):
            return m.Matrix(tuple(tuple(go(x) for x in line) for line in lines))
        case m.Arrow(over=over):
            return m.Arrow(go(over))
        case _:
            return node


def _tidy(node: m.Math) -> m.Math:
    """Return a filled template without what nobody writes: 1 squared."""
    match node:
        case m.Script(base=m.Num(text="0" | "1") as base, sub=None, sup=m.Num(text="2"), primes=0):
            return base
        case m.Row(items=items):
            return m.Row(tuple(_tidy(i) for i in items))
        case m.Fence(left=left, body=body, right=right):
            return m.Fence(left, _tidy(body), right)
        case _:
            return node
