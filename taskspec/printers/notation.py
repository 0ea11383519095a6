"""What names look like, and the two readings of an expression, as a value and as a condition."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from taskspec.lang import syntax as s
from taskspec.printers import tree as m
from taskspec.printers.pieces import Piece, indicator
from taskspec.printers.symbols import symbol


@dataclass(frozen=True)
class Notation:
    """What the names of one task look like."""

    symbols: Mapping[str, m.Math] = field(default_factory=dict)
    labels: Mapping[str, Mapping[str, m.Math]] = field(default_factory=dict)  # component -> label
    conditions: frozenset[str] = frozenset()  # names of conditions without a value of their own
    singles: frozenset[str] = frozenset()  # vectors of one element, written like a number
    lengths: Mapping[str, s.Expr] = field(default_factory=dict)  # of vectors, symbolic
    axes: Mapping[str, int] = field(default_factory=dict)  # how many a name has: 0 for a single value
    bodies: Mapping[str, tuple[tuple[str, ...], s.Expr]] = field(default_factory=dict)  # definitions with arguments
    events: Mapping[str, str] = field(
        default_factory=dict
    )  # functions of a condition `under` a policy, and which by default

    def symbol(self, name: str) -> m.Math:
        return self.symbols.get(name) or symbol(name)

    def label(self, name: str, of: str | None) -> m.Math | None:
        """The symbol of a label, of the given component or of whichever has it."""
        if of is not None and name in self.labels.get(of, {}):
            return self.labels[of][name]
        if name in self.symbols:
            return None
        return next((labels[name] for labels in self.labels.values() if name in labels), None)

    def with_symbols(self, more: Mapping[str, m.Math]) -> Notation:
        return replace(self, symbols={**self.symbols, **more})

    def with_axes(self, more: Mapping[str, int]) -> Notation:
        return replace(self, axes={**self.axes, **more})


@dataclass(frozen=True)
class Writer(ABC):
    """Writes expressions in one notation; `of` is the component whose labels are meant."""

    notation: Notation
    of: str | None = None

    @abstractmethod
    def piece(self, expr: s.Expr) -> Piece:
        """An expression by its form."""

    def number(self, expr: s.Expr) -> Piece:
        """An expression used as a value: conditions count as 0 and 1."""
        if isinstance(expr, s.Boolean):
            return Piece(m.Num(str(int(expr.value))))
        if self.is_condition(expr):
            return Piece(indicator(self.truth(expr).tree))
        return self.piece(expr)

    def truth(self, expr: s.Expr) -> Piece:
        """An expression used as a condition."""
        if isinstance(expr, s.Boolean):
            return Piece(m.upright("true" if expr.value else "false"))
        return self.piece(expr)

    def is_condition(self, expr: s.Expr) -> bool:
        """Whether an expression is a condition by its form (a bool component is a number, 0 or 1)."""
        match expr:
            case s.Compare() | s.Logical() | s.Unary(op="not"):
                return True
            case s.Call(function=name):
                return name in ("any", "all") or name in self.notation.conditions
            case s.Name(id=name):
                return name in self.notation.conditions
            case _:
                return False

    def numbers(self, exprs: Iterable[s.Expr]) -> list[m.Math]:
        return [self.number(e).tree for e in exprs]
