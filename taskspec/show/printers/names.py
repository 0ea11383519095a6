"""The notation of a task: the symbols of its names and labels, and an expression read as a value or a condition."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from taskspec.base.named import all_names
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import literal, parse
from taskspec.language.expressions.types import shape
from taskspec.language.task import questions
from taskspec.language.task.names import signature
from taskspec.language.task.schema.typed import ComponentEntry
from taskspec.language.task.task import Task
from taskspec.show.printers import tree as m
from taskspec.show.printers.pieces import Piece, indicator
from taskspec.show.printers.tex import GREEK, read

_NUMBERED = re.compile(r"([^\W\d_]+?)_?(\d+)")
_LETTERS = GREEK | {"inf": "∞", "nan": "NaN"}


def symbol(name: str, given: str | None = None) -> m.Math:
    if given is not None:
        return _given(given)
    letter = _letter(name)
    if letter is not None:
        return letter
    numbered = _NUMBERED.fullmatch(name)
    if numbered:
        return m.Script(_letter(numbered[1]) or m.upright(numbered[1]), m.Num(numbered[2]))
    head, _, rest = name.partition("_")
    base = _letter(head)
    if base is not None and rest:
        return m.Script(base, _letter(rest) or m.upright(rest.replace("_", "-")))
    return m.upright(name.replace("_", "-"))


def _given(text: str) -> m.Math:
    if text.isalnum() and len(text) > 1 and not text.isdigit():
        return m.Ident(text)
    return read(text)


def _letter(name: str) -> m.Math | None:
    if len(name) == 1 and name.isalpha():
        return m.Ident(name)
    if name in _LETTERS:
        return m.Ident(_LETTERS[name])
    return None


def label(name: str, given: str | None = None) -> m.Math:
    if given is not None:
        symbols = _given(given)
        if isinstance(symbols, m.Sym):
            return m.Ident(symbols.text)
        return symbols
    if re.fullmatch(r"-?\d+(\.\d+)?", name):
        return m.Num(name.replace("-", "−"))
    return m.Words(name.replace("_", " "))


@dataclass(frozen=True)
class Notation:
    """Symbols of the names of one task."""

    symbols: Mapping[str, m.Math] = field(default_factory=dict)
    labels: Mapping[str, Mapping[str, m.Math]] = field(default_factory=dict)  # component -> label
    conditions: frozenset[str] = frozenset()  # names of conditions without a value of their own
    singles: frozenset[str] = frozenset()  # vectors of one element, written like a number
    lengths: Mapping[str, s.Expr] = field(default_factory=dict)  # of vectors, symbolic
    axes: Mapping[str, int] = field(default_factory=dict)  # how many a name has: 0 for a single value
    bodies: Mapping[str, tuple[tuple[str, ...], s.Expr]] = field(default_factory=dict)  # definitions with arguments
    events: Mapping[str, str] = field(default_factory=dict)  # functions of a condition -> default of `under`

    def symbol(self, name: str) -> m.Math:
        return self.symbols.get(name) or symbol(name)

    def label(self, name: str, of: str | None) -> m.Math | None:
        if of is not None and name in self.labels.get(of, {}):
            return self.labels[of][name]
        if name in self.symbols:
            return None
        for labels in self.labels.values():
            if name in labels:
                return labels[name]
        return None

    def with_symbols(self, more: Mapping[str, m.Math]) -> Notation:
        return replace(self, symbols={**self.symbols, **more})


@dataclass(frozen=True)
class Writer(ABC):
    """Writes expressions in one notation; `of` is the component whose labels are meant."""

    notation: Notation
    of: str | None = None

    @abstractmethod
    def piece(self, expr: s.Expr) -> Piece:
        """Return an expression by its form."""

    def number(self, expr: s.Expr) -> Piece:
        """Print an expression as a value: conditions count as 0 and 1."""
        if self.is_condition(expr):
            return Piece(indicator(self.truth(expr).tree))
        return self.piece(expr)

    def truth(self, expr: s.Expr) -> Piece:
        if isinstance(expr, s.Boolean):
            return Piece(m.upright(str(expr.value).lower()))
        return self.piece(expr)

    def is_condition(self, expr: s.Expr) -> bool:
        """Test whether an expression is a condition by its form (a bool component is a number, 0 or 1)."""
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

    def joined_names(self, names: Iterable[s.Name]) -> m.Math:
        return m.joined(self.notation.symbol(name.id) for name in names)

    def with_axes(self, more: Mapping[str, int]) -> Writer:
        return replace(self, notation=replace(self.notation, axes={**self.notation.axes, **more}))


def of_task(task: Task) -> Notation:
    """Notation that every part of a task's printed form shares."""
    spec = task.spec
    symbols = {name: symbol(name) for name in (*spec.constants, *spec.noise, "t", "T")}
    bodies = {}
    for written, expr in (questions.written_in(task, "definitions") or {}).items():
        name, arguments = signature(written)
        symbols[name] = symbol(name)
        if arguments is not None and expr is not None:
            bodies[name] = (arguments, expr)
    lengths = {}
    declared = spec.state | spec.action | spec.memory
    for name, entry in declared.items():
        symbols[name] = symbol(name, entry.symbol)
        first = _first_length(entry)
        if first is not None:
            lengths[name] = expression(first)
    for name, parameter in spec.parameters.entries.items():
        symbols[name] = symbol(name, parameter.symbol)
    axes = dict.fromkeys((*all_names(task.parameters), "t", "T"), 0)
    for name, value in task.source.constants.items():
        axes[name] = len(value.type.shape)
    axes |= questions.axes(task)
    memory = () if task.annotations.memory is None else task.annotations.memory.components
    labels: dict[str, dict[str, m.Math]] = {}
    singles = set()
    for c in (*task.state, *task.action, *memory):
        sizes = shape(c.type, c.domain)
        axes[c.name] = 0 if sizes == (1,) else len(sizes)
        if c.type.shape == (1,):
            singles.add(c.name)
        if c.domain is not None:
            given = c.domain.symbols or (None,) * len(c.domain.labels)
            labels[c.name] = dict(zip(c.domain.labels, map(label, c.domain.labels, given), strict=True))
    return Notation(symbols, labels, frozenset(), frozenset(singles), lengths, axes, bodies)


def _first_length(entry: ComponentEntry) -> Any:
    if isinstance(entry.shape, list):
        return next(iter(entry.shape), None)
    return entry.shape


def expression(value: Any) -> s.Expr:
    if isinstance(value, list):
        return s.Vector(tuple(map(expression, value)), s.Place(nowhere(""), 0, 0))
    written = nowhere(str(value))
    if isinstance(value, bool | int | float):
        return literal(value, written)
    return parse(written)


def nowhere(text: str) -> s.SourceText:
    """Make a text that no file contains."""

    def locate(start: int, end: int) -> Any:
        return None

    return s.SourceText(text, locate)
