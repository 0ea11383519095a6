"""The mathematics tree: notation as it stands on paper, before it is LaTeX, MathML or plain text.

A closed set of nodes. Characters are Unicode throughout; what TeX calls them is in `printers.characters`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Style = Literal["italic", "upright", "bold", "blackboard", "calligraphic", "typewriter"]


@dataclass(frozen=True, slots=True)
class Ident:
    """A letter or a named thing; a name of several letters is upright."""

    text: str
    style: Style = "italic"


@dataclass(frozen=True, slots=True)
class Num:
    """A number as digits."""

    text: str


@dataclass(frozen=True, slots=True)
class Sym:
    """An operator, relation, bracket or punctuation mark: one Unicode character."""

    text: str


@dataclass(frozen=True, slots=True)
class Words:
    """Prose inside mathematics, spaces included."""

    text: str


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap that the neighbours do not make by themselves."""

    width: Literal["thin", "wide"] = "thin"


@dataclass(frozen=True, slots=True)
class Row:
    """Things side by side."""

    items: tuple[Math, ...]


@dataclass(frozen=True, slots=True)
class Frac:
    top: Math
    bottom: Math


@dataclass(frozen=True, slots=True)
class Root:
    body: Math


@dataclass(frozen=True, slots=True)
class Accent:
    """A mark over a body, by TeX's name: `dot`, `hat`."""

    mark: str
    body: Math


@dataclass(frozen=True, slots=True)
class Script:
    """A base with what is written below, above and as primes."""

    base: Math
    sub: Math | None = None
    sup: Math | None = None
    primes: int = 0


@dataclass(frozen=True, slots=True)
class Fence:
    """A body between delimiters, which grow with it; an empty delimiter is not shown."""

    left: str
    body: Math
    right: str


@dataclass(frozen=True, slots=True)
class Cases:
    """Values, each with the words or conditions under which it applies."""

    rows: tuple[tuple[Math, Math], ...]


@dataclass(frozen=True, slots=True)
class Matrix:
    rows: tuple[tuple[Math, ...], ...]


@dataclass(frozen=True, slots=True)
class Arrow:
    """A long arrow with a label above."""

    over: Math


@dataclass(frozen=True, slots=True)
class Big:
    """A sum or product sign with its limits."""

    symbol: str
    sub: Math | None = None
    sup: Math | None = None


@dataclass(frozen=True, slots=True)
class Hole:
    """An argument's place in a template."""

    name: str


Math = (
    Ident | Num | Sym | Words | Gap | Row | Frac | Root | Accent | Script | Fence | Cases | Matrix | Arrow | Big | Hole
)  # fmt: skip


def row(*items: Math) -> Math:
    """Return things side by side; a single one stands for itself."""
    return items[0] if len(items) == 1 else Row(items)


def joined(items: Iterable[Math], mark: str = ",") -> Math:
    """Return items with a mark between them."""
    found: list[Math] = []
    for item in items:
        found += [Sym(mark), item] if found else [item]
    return row(*found) if found else Row(())


def brackets(body: Math) -> Fence:
    return Fence("(", body, ")")


def braces(body: Math) -> Fence:
    return Fence("{", body, "}")


def upright(text: str) -> Ident:
    return Ident(text, "upright")


def children(node: Math) -> tuple[Math, ...]:
    """Return the children of a node, in reading order."""
    match node:
        case Row(items=items):
            return items
        case Frac(top=top, bottom=bottom):
            return (top, bottom)
        case Root(body=body) | Accent(body=body) | Fence(body=body) | Arrow(over=body):
            return (body,)
        case Script(base=base, sub=sub, sup=sup):
            return tuple(x for x in (base, sub, sup) if x is not None)
        case Big(sub=sub, sup=sup):
            return tuple(x for x in (sub, sup) if x is not None)
        case Cases(rows=pairs):
            return tuple(x for pair in pairs for x in pair)
        case Matrix(rows=rows):
            return tuple(x for line in rows for x in line)
        case _:
            return ()


def is_tall(node: Math) -> bool:
    """Return whether brackets around a node must grow."""
    match node:
        case Frac() | Cases() | Matrix() | Big() | Root():
            return True
        case Script(base=base, sup=sup):
            return is_tall(base) or (sup is not None and is_tall(sup))
        case Arrow():
            return False
        case _:
            return any(is_tall(child) for child in children(node))


def width(node: Math) -> float:
    """Return about how wide a node is, in letters; enough to decide where a line breaks."""
    match node:
        case Ident(text=text) | Num(text=text) | Words(text=text):
            return 0.9 * len(text)
        case Sym(text=text):
            return 0.6 if text in ",;()[]{}|‖'" else 2.0
        case Gap(width=gap):
            return 0.4 if gap == "thin" else 2.0
        case Frac(top=top, bottom=bottom):
            return max(width(top), width(bottom)) * 0.8
        case Script(base=base, sub=sub, sup=sup, primes=primes):
            small = max(width(sub) if sub else 0, width(sup) if sup else 0)
            return width(base) + 0.7 * small + 0.4 * primes
        case Cases(rows=rows):
            return 3 + max(width(a) for a, _ in rows) + max(width(b) for _, b in rows)
        case Matrix(rows=rows):
            return 2 + max(sum(width(x) + 1.5 for x in line) for line in rows)
        case Arrow(over=over):
            return 2.5 + 0.7 * width(over)
        case Fence(body=body):
            return 1.2 + width(body)
        case Root(body=body):
            return 1 + width(body)
        case _:
            return sum(width(child) for child in children(node)) + (1.5 if isinstance(node, Big) else 0)
