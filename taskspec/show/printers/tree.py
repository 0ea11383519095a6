"""The mathematics tree: notation as it stands on paper, before it is LaTeX, MathML or plain text.

A closed set of nodes. Characters are Unicode throughout; what TeX calls them is in `printers.tex`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from taskspec.language.expressions.syntax import Place

Style = Literal["italic", "upright", "bold", "blackboard", "calligraphic", "typewriter"]


@dataclass(frozen=True, slots=True)
class Ident:
    """A letter or a named thing; a name of several letters is upright."""

    text: str
    style: Style = "italic"


@dataclass(frozen=True, slots=True)
class Num:
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
    mark: str  # TeX's name: `dot`, `hat`
    body: Math


@dataclass(frozen=True, slots=True)
class Script:
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
    over: Math


@dataclass(frozen=True, slots=True)
class Big:
    """A sum or product sign with its limits."""

    symbol: str
    sub: Math | None = None
    sup: Math | None = None


@dataclass(frozen=True, slots=True)
class Hole:
    """The place of an argument in a template."""

    name: str


Math = (
    Ident | Num | Sym | Words | Gap | Row | Frac | Root | Accent | Script | Fence | Cases | Matrix | Arrow | Big | Hole
)  # fmt: skip


def row(*items: Math) -> Math:
    if len(items) == 1:
        return items[0]
    return Row(items)


def joined(items: Iterable[Math], mark: str = ",") -> Math:
    pieces: list[Math] = []
    for item in items:
        if pieces:
            pieces.append(Sym(mark))
        pieces.append(item)
    return row(*pieces)


def brackets(body: Math) -> Fence:
    return Fence("(", body, ")")


def tupled(items: Sequence[Math]) -> Math:
    """Write several items as a tuple; one stands alone."""
    if len(items) == 1:
        return items[0]
    return brackets(joined(items))


def braces(body: Math) -> Fence:
    return Fence("{", body, "}")


def equal(left: Math, right: Math) -> Row:
    return Row((left, Sym("="), right))


def such_that(element: Math, condition: Math) -> Row:
    """Write `element : condition`, as in sets and after quantifiers."""
    return Row((element, Sym(":"), Gap(), condition))


def signed(is_negative: bool, number: Math) -> Math:
    if is_negative:
        return Row((Sym("−"), number))
    return number


def upright(text: str) -> Ident:
    return Ident(text, "upright")


def children(node: Any) -> list[Any]:
    """List nodes right below a node of mathematics or of surface syntax, in reading order."""
    nodes = []
    waiting = []
    for name in reversed(node.__dataclass_fields__):
        waiting.append(getattr(node, name))
    while waiting:
        value = waiting.pop()
        if isinstance(value, tuple):
            waiting += reversed(value)
        elif hasattr(value, "__dataclass_fields__") and not isinstance(value, Place):
            nodes.append(value)
    return nodes


def parts(node: Any) -> Iterator[Any]:
    yield node
    for child in children(node):
        yield from parts(child)


def mapped(node: Any, change: Callable[[Any], Any]) -> Any:
    """Rebuild a node of mathematics or of surface syntax with each of its children changed."""

    def go(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(go, value))
        if hasattr(value, "__dataclass_fields__") and not isinstance(value, Place):
            return change(value)
        return value

    return replace(node, **{name: go(getattr(node, name)) for name in node.__dataclass_fields__})


def is_tall(node: Math) -> bool:
    match node:
        case Frac() | Cases() | Matrix() | Big() | Root():
            return True
        case Script(base=base, sup=sup):
            return is_tall(base) or (sup is not None and is_tall(sup))
        case Arrow():
            return False
        case _:
            return any(map(is_tall, children(node)))


def width(node: Math) -> float:  # noqa: C901
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
            small = max((width(script) for script in (sub, sup) if script), default=0)
            return width(base) + 0.7 * small + 0.4 * primes
        case Cases(rows=rows):
            return 3 + sum(max(map(width, column)) for column in zip(*rows, strict=True))
        case Matrix(rows=rows):
            return 2 + max(sum(width(x) + 1.5 for x in line) for line in rows)
        case Arrow(over=over):
            return 2.5 + 0.7 * width(over)
        case Fence(body=body):
            return 1.2 + width(body)
        case Root(body=body):
            return 1 + width(body)
        case Big():
            return 1.5 + sum(map(width, children(node)))
        case _:
            return sum(map(width, children(node)))
