"""Find the place of a counterexample: the smallest part of a section that gives the wrong value.

The build records the meaning of each part of a section (`Surface.meanings`), so that conditions and rows of tables can be
evaluated at the counterexample. Parts of comprehensions and of definitions have no meaning recorded: those of comprehensions
are checked for each element, and of definitions those that do not depend on their surroundings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from taskspec.base.diagnostics import Collector
from taskspec.exact.model.space import Reads
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.dists import is_distribution
from taskspec.language.expressions.ir import Node, draws
from taskspec.language.expressions.scope import Poisoned, Scope, Value
from taskspec.language.expressions.sets import unroll
from taskspec.language.expressions.types import Domain, Kind, Refused
from taskspec.language.task.task import Task


@dataclass(frozen=True)
class SectionScope:
    """A section's scope, in which parts of its expressions can be checked again; or that of an element of a comprehension."""

    task: Task
    name: str
    element: Scope | None = None
    outer: SectionScope | None = None

    @cached_property
    def builder(self) -> Builder:
        if self.outer is not None:
            return self.outer.builder
        return self.task.new_builder()

    @property
    def scope(self) -> Scope | None:
        return self.element or self.task.source.surface.scopes.get(self.name)

    def value(self, expr: s.Expr, want: Domain | None = None) -> Value | None:
        """Return the meaning of a part, or None if it has none of its own."""
        known = None
        if self.element is None:
            known = self.task.source.surface.meaning(self.name, expr)
        if known is not None or self.scope is None:
            return known
        try:
            return Checker(self.builder, Collector()).check(expr, self.scope, want)
        except Refused:
            return None

    def elements(self, comprehension: s.Comprehension) -> list[SectionScope]:
        """Return the scope of each element of a vector's comprehension that draws."""
        if self.scope is None or comprehension.is_set or not any(map(_is_drawn, s.below(comprehension.element))):
            return []
        checker = Checker(self.builder, Collector())
        try:
            scopes = unroll(checker, comprehension, self.scope, lambda scope: scope)
        except Poisoned:
            return []
        return [SectionScope(self.task, self.name, scope, self) for scope in scopes]

    def number(self, expr: s.Expr) -> Node | None:
        """Return the meaning of a part as a number; the value of the label for a choice."""
        value = self.value(expr)
        if value is None:
            return None
        if value.domain is None:
            return value.node
        return Checker(self.builder, Collector()).number_of(value)

    def row(self, by: s.Expr, key: s.Expr) -> Node | None:
        """Condition that the value of a column equals the key of a row."""
        column = self.value(by)
        if column is None:
            return None
        label = self.value(key, column.domain)
        if label is None or (column.node.type != label.node.type and column.node.type.kind is Kind.REAL):
            return None
        b = self.builder
        try:
            return b.apply("eq", column.node, label.node)
        except Refused:
            return None

    def negated(self, condition: Node | None) -> Node | None:
        return condition and self.builder.apply("not", condition)


def narrow(expr: s.Expr, section: SectionScope, reads: Reads) -> s.Expr:
    """Return the branch or row of an expression that gives its value at a point."""
    for part, conditions in _alternatives(expr, section):
        known = [c for c in conditions if c is not None and not draws([c])]
        if all(value.reshape(-1)[0] for value in evaluate(known, reads)):
            if len(known) == len(conditions):
                return narrow(part, section, reads)
            return expr
    return expr


Alternative = tuple[s.Expr, tuple[Node | None, ...]]
"""A part of an expression, and the conditions under which it gives the value; None for one without a meaning of its own."""


def _alternatives(expr: s.Expr, section: SectionScope) -> Iterator[Alternative]:
    """Yield the branches of an expression, or the cells of a table; nothing for other expressions."""
    match expr:
        case s.Table(by=by, rows=rows):
            yield from _cells(by, rows, section)
            return
        case s.IfElse(condition=condition, then=then):
            pieces: Sequence[tuple[s.Expr, s.Expr]] = [(condition, then)]
        case s.Piecewise(branches=branches):
            pieces = branches
        case _:
            return
    before: tuple[Node | None, ...] = ()
    for condition, then in pieces:
        node = section.number(condition)
        yield then, (*before, node)
        before = (*before, section.negated(node))
    yield expr.otherwise, before


def _cells(by: tuple[s.Expr, ...], rows: tuple[s.TableRow, ...], section: SectionScope) -> Iterator[Alternative]:
    others: tuple[Node | None, ...] = ()
    for row in sorted(rows, key=lambda row: row.key is None):  # `else` comes last
        node = None
        if row.key is not None:
            node = section.row(by[0], row.key)
        if row.key is None:
            conditions = others
        else:
            conditions = (node,)
        others = (*others, section.negated(node))
        if not isinstance(row.body, tuple):
            yield row.body, conditions
            continue
        for part, inner in _cells(by[1:], row.body, section):
            yield part, (*conditions, *inner)


@dataclass(frozen=True)
class Written:
    """A distribution as written, with the conditions under which it is drawn from."""

    expr: s.Call | s.Weights
    section: SectionScope
    guards: tuple[Node, ...]


def distributions(  # noqa: C901
    expr: s.Expr | s.Slice, section: SectionScope, guards: tuple[Node, ...] = ()
) -> Iterator[Written]:
    """Yield the distributions in an expression whose parameters have a meaning of their own, once for each element."""
    match expr:
        case s.IfElse() | s.Piecewise() | s.Table():
            for part, conditions in _alternatives(expr, section):
                known = (condition for condition in conditions if condition is not None)
                yield from distributions(part, section, (*guards, *known))
        case s.Comprehension():
            for element in section.elements(expr):
                yield from distributions(expr.element, element, guards)
        case s.SetOf() | s.Slice():
            return  # they are constants
        case s.Weights(pairs=pairs):
            yield Written(expr, section, guards)
            for value, _ in pairs:
                yield from distributions(value, section, guards)
        case s.Call(function=name, args=args, keywords=keywords):
            parts = [*args, *(value for _, value in keywords)]
            if is_distribution(name):
                yield Written(expr, section, guards)
                parts = [part for part in parts if not isinstance(part, s.Weights)]
            for part in parts:
                yield from distributions(part, section, guards)
        case _:
            for inner in s.parts(expr):
                yield from distributions(inner, section, guards)


def _is_drawn(part: s.Expr) -> bool:
    return isinstance(part, s.Weights) or (isinstance(part, s.Call) and is_distribution(part.function))
