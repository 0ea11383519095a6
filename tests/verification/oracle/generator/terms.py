"""Expressions as text, with what is known of them: kind, shape, size, and how they bind."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

Shape = tuple[int | str, ...]
"""Lengths; a word is a parameter that decides the length."""

INFINITE = 1 << 40
"""More outcomes than anybody lists."""


@dataclass(frozen=True)
class Term:
    """A written expression.

    level: how tight its outermost operator binds, 0 to 10. size: the largest absolute value that it can have.
    finite: whether a real is never infinite or nan. reads: what it depends on, among "state", "action", "prime",
    "t", "noise" and "draw". fan: how many outcomes its draws have.
    """

    text: str
    kind: str
    shape: Shape = ()
    level: int = 10
    size: float = 1
    finite: bool = True
    reads: frozenset[str] = frozenset()
    fan: int = 1
    labels: tuple[str, ...] = ()
    """Of a label: those of its choice. Then `size` says whether they stand for numbers: 2, or not: 1."""
    rows: tuple[int, ...] = (0, 1, 7)
    """Of an int: values for which a table may have rows."""

    def at(self, level: int) -> str:
        """The text where only what binds at least as tightly as `level` can stand bare."""
        return self.text if self.level >= level else f"({self.text})"


def joined(text: str, kind: str, parts: Iterable[Term], *, shape: Shape = (), level: int = 10, size: float = 1,
           finite: bool | None = None) -> Term:  # fmt: skip
    """A term made of others."""
    terms = list(parts)
    fan = 1
    for t in terms:
        fan = min(INFINITE, fan * t.fan)
    known = all(t.finite for t in terms) if finite is None else finite
    reads = frozenset().union(*(t.reads for t in terms))
    return Term(text, kind, shape, level, size, known, reads, fan)


@dataclass(frozen=True)
class Name:
    """Something that an expression may read."""

    term: Term
    sections: frozenset[str] = frozenset()
    """Where it can be read; empty: everywhere."""


@dataclass(frozen=True)
class Function:
    """A definition with arguments: the terms it takes, by kind and shape, and what it gives."""

    name: str
    takes: tuple[tuple[str, Shape], ...]
    gives: Term


@dataclass
class Context:
    """Where an expression stands: what it may read, whether it may draw, and how long it may grow."""

    rng: random.Random
    names: list[Term] = field(default_factory=list)
    functions: list[Function] = field(default_factory=list)
    may_draw: bool = False
    bounded: bool = True
    """Whether draws must have finitely many outcomes."""
    folds: bool = False
    """Whether a definition `mix` can be taken through vectors of ints."""

    def with_names(self, extra: Sequence[Term]) -> Context:
        return replace(self, names=[*self.names, *extra])

    def without_draws(self) -> Context:
        return replace(self, may_draw=False)

    def readable(self, kinds: Sequence[str], shape: Shape) -> list[Term]:
        return [n for n in self.names if n.kind in kinds and n.shape == shape]

    def chance(self, p: float) -> bool:
        return self.rng.random() < p


def number(x: float | int) -> Term:
    """A literal."""
    kind = "int" if isinstance(x, int) else "real"
    return Term(repr(x), kind, (), 10 if x >= 0 else 7, abs(x))


def boolean(x: bool) -> Term:
    return Term(str(x), "bool")


def infix(left: Term, op: str, right: Term, kind: str, *, size: float, finite: bool | None = None) -> Term:
    """A binary operator, with brackets only where they are needed."""
    level = LEVELS[op]
    tight = (9, 7) if op == "**" else (5, 5) if level == 4 else (level, level + 1)
    text = f"{left.at(tight[0])} {op} {right.at(tight[1])}"
    return joined(text, kind, (left, right), shape=left.shape or right.shape, level=level, size=size, finite=finite)


LEVELS = {"or": 1, "and": 2, "==": 4, "!=": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
          "//": 6, "%": 6, "**": 8}  # fmt: skip


def call(name: str, args: Sequence[Term], kind: str, *, shape: Shape = (), size: float, finite: bool | None = None,
         extra: str = "") -> Term:  # fmt: skip
    text = f"{name}({', '.join([a.text for a in args] + ([extra] if extra else []))})"
    return joined(text, kind, args, shape=shape, size=size, finite=finite)


def conditional(condition: Term, x: Term, y: Term, kind: str) -> Term:
    text = f"{x.at(1)} if {condition.at(1)} else {y.at(0)}"
    return joined(text, kind, (x, condition, y), shape=x.shape or y.shape, level=0, size=max(x.size, y.size))


def drawn(term: Term, outcomes: int) -> Term:
    """A term that is a draw with so many outcomes."""
    return replace(term, fan=min(INFINITE, term.fan * outcomes), reads=term.reads | {"draw"})
