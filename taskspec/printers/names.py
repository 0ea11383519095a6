"""The notation of a task: what its names look like, and an expression read as a value or a condition."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from taskspec.lang import syntax as s
from taskspec.lang.parse import literal, parse
from taskspec.lang.types import shape
from taskspec.printers import tree as m
from taskspec.printers.pieces import Piece, indicator
from taskspec.printers.symbols import label, symbol
from taskspec.task.names import signature
from taskspec.task.task import Component, Task


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
        """Return the symbol of a label, of the given component or of whichever has it."""
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
        """Return an expression by its form."""

    def number(self, expr: s.Expr) -> Piece:
        """Return an expression used as a value: conditions count as 0 and 1."""
        if isinstance(expr, s.Boolean):
            return Piece(m.Num(str(int(expr.value))))
        if self.is_condition(expr):
            return Piece(indicator(self.truth(expr).tree))
        return self.piece(expr)

    def truth(self, expr: s.Expr) -> Piece:
        """Return an expression used as a condition."""
        if isinstance(expr, s.Boolean):
            return Piece(m.upright("true" if expr.value else "false"))
        return self.piece(expr)

    def is_condition(self, expr: s.Expr) -> bool:
        """Return whether an expression is a condition by its form (a bool component is a number, 0 or 1)."""
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


# -- the notation of a task


def of_task(task: Task) -> Notation:
    """Return the notation that every part of a task's printed form shares."""
    components = (*task.state, *task.action, *(() if task.memory is None else task.memory.components))
    return Notation(
        symbols=dict(_symbols(task)),
        labels={c.name: dict(_labels(c)) for c in components if c.domain is not None},
        singles=frozenset(c.name for c in components if c.type.shape == (1,)),
        lengths={
            name: expr
            for name, entry in (task.spec.state | task.spec.action | task.spec.memory).items()
            if (expr := _length(entry.shape)) is not None
        },
        axes=_axes(task),
        bodies={
            name: (arguments, expr)
            for written, expr in (task.surface.sections.get("definitions") or {}).items()
            for name, arguments in [signature(written)]
            if arguments is not None and expr is not None
        },
    )


def _axes(task: Task) -> dict[str, int]:
    """Return how many axes every name of a task has; a vector of one element is written like a number."""
    components = (*task.state, *task.action, *(() if task.memory is None else task.memory.components))
    return {
        **dict.fromkeys((p.name for p in task.parameters), 0),
        **{name: len(value.type.shape) for name, value in task.fixed.items()},
        **{name: len(found) for name, found in task.surface.shapes.items()},
        **{c.name: len(found) * (found != (1,)) for c in components for found in [shape(c.type, c.domain)]},
        "t": 0,
        "T": 0,
    }


def _symbols(task: Task) -> Iterator[tuple[str, m.Math]]:
    spec = task.spec
    for declared in (spec.parameters.entries, spec.state, spec.action, spec.memory):
        for name, entry in declared.items():
            yield name, symbol(name, entry.symbol)
    for name in (*spec.constants, *spec.noise):
        yield name, symbol(name)
    for written in spec.definitions:
        name = signature(written)[0]
        yield name, symbol(name)
    yield "t", m.Ident("t")
    yield "T", m.Ident("T")


def _labels(component: Component) -> Iterator[tuple[str, m.Math]]:
    domain = component.domain
    assert domain is not None
    for i, name in enumerate(domain.labels):
        yield name, label(name, domain.symbols[i] if domain.symbols else None)


def _length(shape: Any) -> s.Expr | None:
    """Return the length of a component along its first axis, as the author wrote it."""
    first = shape[0] if isinstance(shape, list) and shape else shape
    return None if first in (None, []) else expression(first)


def expression(value: Any) -> s.Expr:
    """Return a value of a declaration (a bound, a length) as surface syntax; it has been checked, so it parses."""
    if isinstance(value, list):
        place = s.Place(nowhere(""), 0, 0)
        return s.Vector(tuple(expression(v) for v in value), place)
    written = nowhere(str(value))
    if isinstance(value, bool | int | float):
        return literal(value, written)
    return parse(written)


def nowhere(text: str) -> s.SourceText:
    """Return a text that no file holds."""

    def locate(start: int, end: int) -> Any:
        return None

    return s.SourceText(text, locate)
