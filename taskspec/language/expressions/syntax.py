"""Surface syntax: expressions as the author wrote them, every node with its place in the file.

A closed set of nodes, in the notation of the language (parameters by name, primes, labels, piecewise values). The
checker turns them into the typed core of `ir`; the printers turn them back into text and mathematics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.base.diagnostics import Span


@dataclass(frozen=True, slots=True)
class SourceText:
    """The text of one expression, and how to find a range of its characters in the file it came from."""

    value: str
    locate: Callable[[int, int], Span]


@dataclass(frozen=True, slots=True)
class Place:
    """A range of characters of a text; its span in the file is looked up only when a message needs it."""

    text: SourceText
    start: int
    end: int

    @property
    def span(self) -> Span:
        return self.text.locate(self.start, self.end)

    @property
    def written(self) -> str:
        """The characters themselves, in one line."""
        return " ".join(self.text.value[self.start : self.end].split())


@dataclass(frozen=True, slots=True)
class Number:
    """A number as written: an int or a float (`text` keeps the spelling, for printing)."""

    value: int | float
    text: str
    place: Place


@dataclass(frozen=True, slots=True)
class Boolean:
    value: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Quoted:
    """A quoted word: a label that is not an identifier."""

    value: str
    place: Place


@dataclass(frozen=True, slots=True)
class Name:
    id: str
    primed: bool
    place: Place

    @property
    def written(self) -> str:
        return self.id + "'" * self.primed


@dataclass(frozen=True, slots=True)
class Unary:
    """`-x`, `+x`, `not x`."""

    op: str
    operand: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Binary:
    """Arithmetic: `+ - * / // % **`."""

    op: str
    left: Expr
    right: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Logical:
    """`and`, `or` over two or more operands."""

    op: str
    operands: tuple[Expr, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Compare:
    """A chain `first op1 x1 op2 x2 ...` with `== != < <= > >= in not in`."""

    first: Expr
    rest: tuple[tuple[str, Expr], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class IfElse:
    condition: Expr
    then: Expr
    otherwise: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Call:
    function: str
    args: tuple[Expr, ...]
    keywords: tuple[tuple[str, Expr], ...]
    place: Place
    name_place: Place

    @property
    def written(self) -> str:
        return self.function


@dataclass(frozen=True, slots=True)
class Slice:
    start: Expr | None
    stop: Expr | None
    step: Expr | None
    place: Place


@dataclass(frozen=True, slots=True)
class Subscript:
    """`x[i]`, `x[i, j]`, `x[a:b]`."""

    value: Expr
    indices: tuple[Expr | Slice, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Vector:
    items: tuple[Expr, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class SetOf:
    """A finite set written out: `{a, b, c}`."""

    items: tuple[Expr, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Weights:
    """Values with probabilities: `{value: p, ...}`."""

    pairs: tuple[tuple[Expr, Expr], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Clause:
    """`for targets in domain if conditions` of a comprehension."""

    targets: tuple[str, ...]
    domain: Expr
    conditions: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Comprehension:
    """`{e for x in d if c}` (a set), or `[e for x in d]` (a vector)."""

    element: Expr
    clauses: tuple[Clause, ...]
    is_set: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Piecewise:
    """The YAML list of `if:`/`then:` entries with a last `else:`."""

    branches: tuple[tuple[Expr, Expr], ...]
    otherwise: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class TableRow:
    """A row of a decision table: its key (None for `else`), and a cell or the rows of the next column."""

    key: Expr | None
    body: Expr | tuple[TableRow, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Table:
    """The YAML mapping with `by:` and `rows:`."""

    by: tuple[Expr, ...]
    rows: tuple[TableRow, ...]
    place: Place


Expr = (
    Number | Boolean | Quoted | Name | Unary | Binary | Logical | Compare | IfElse | Call | Subscript | Vector
    | SetOf | Weights | Comprehension | Piecewise | Table
)  # fmt: skip


def alternatives(expr: Expr) -> Iterator[Expr]:
    """Yield the branches, cells or weighted values of an expression; else the expression itself."""
    match expr:
        case IfElse(then=then, otherwise=otherwise):
            parts: tuple[Expr, ...] = (then, otherwise)
        case Piecewise(branches=branches, otherwise=otherwise):
            parts = (*(then for _, then in branches), otherwise)
        case Weights(pairs=pairs) | Call(function="Categorical", args=(Weights(pairs=pairs),)):
            parts = tuple(value for value, _ in pairs)
        case Table(rows=rows):
            parts = tuple(cells(rows))
        case _:
            yield expr
            return
    for part in parts:
        yield from alternatives(part)


def cells(rows: Sequence[TableRow]) -> Iterator[Expr]:
    for row in rows:
        if isinstance(row.body, tuple):
            yield from cells(row.body)
        else:
            yield row.body


def names(root: Any) -> Iterator[Name | Call]:
    """List names and calls anywhere below a node, in written order."""
    return (node for node in below(root) if isinstance(node, Name | Call))


def targets(root: Any) -> Iterator[str]:
    for node in below(root):
        if isinstance(node, Clause):
            yield from node.targets


def below(root: Any) -> Iterator[Any]:
    """Yield a node (or each of a tuple) and all nodes below, in written order."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, tuple):
            stack.extend(reversed(node))
        elif hasattr(node, "__match_args__") and not isinstance(node, Place):
            yield node
            stack.extend(getattr(node, name) for name in reversed(node.__match_args__))


def parts(expr: Expr | Slice) -> Iterator[Expr | Slice]:
    rest: list[Any] = [getattr(expr, name) for name in reversed(expr.__match_args__)]
    while rest:
        part = rest.pop()
        if isinstance(part, tuple):
            rest.extend(reversed(part))
        elif isinstance(part, Expr | Slice):
            yield part
