"""From a counterexample back to what the author wrote: the smallest part of a section that is to blame.

The build records what each part of a section came to (`Surface.meanings`), so that conditions and rows of tables can be
decided at the counterexample. Parts of comprehensions and of definitions have no meaning of their own there: those that do
not depend on what surrounds them are checked here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from taskspec.base.diagnostics import Collector
from taskspec.lang import syntax as s
from taskspec.lang.batch import evaluate
from taskspec.lang.check import Checker
from taskspec.lang.dists import is_distribution
from taskspec.lang.ir import Const, Node, draws
from taskspec.lang.scope import Scope, Value
from taskspec.lang.types import Domain, Kind, Refused
from taskspec.model.space import Reads
from taskspec.task.task import Task


@dataclass(frozen=True)
class SectionScope:
    """A section's scope, in which parts of its expressions can be given a meaning again."""

    task: Task
    name: str

    @property
    def scope(self) -> Scope | None:
        return self.task.surface.scopes.get(self.name)

    def value(self, expr: s.Expr, want: Domain | None = None) -> Value | None:
        """The meaning of a part, or None where it has none on its own."""
        known = self.task.surface.meaning(self.name, expr)
        if known is not None:
            return known
        scope = self.scope
        if scope is None:
            return None
        checker = Checker(self.task.builder, Collector())
        try:
            return checker.check(expr, scope, want)
        except Refused:
            return None

    def number(self, expr: s.Expr) -> Node | None:
        """The meaning of a part as a number; a choice gives what its label stands for."""
        value = self.value(expr)
        if value is None or value.domain is None:
            return None if value is None else value.node
        return Checker(self.task.builder, Collector()).number_of(value)

    def row(self, by: s.Expr, key: s.Expr) -> Node | None:
        """Whether the present value of a column is that of a row, as a condition."""
        column = self.value(by)
        if column is None:
            return None
        label = self.value(key, column.domain)
        if label is None or (column.node.type != label.node.type and column.node.type.kind is Kind.REAL):
            return None
        b = self.task.builder
        try:
            return b.apply("eq", column.node, label.node)
        except Refused:
            return None


def holds(condition: Node | None, reads: Reads) -> bool | None:
    """Whether a condition holds at the first of some points; None where that cannot be told."""
    if condition is None or draws([condition]):
        return None
    if isinstance(condition, Const):
        return bool(condition.value)
    (value,) = evaluate([condition], reads)
    return bool(np.asarray(value).reshape(-1)[0])


def narrow(expr: s.Expr, section: SectionScope, reads: Reads) -> s.Expr:
    """The branch or row of an expression that gives its value at a point."""
    while True:
        smaller = _smaller(expr, section, reads)
        if smaller is None:
            return expr
        expr = smaller


def _smaller(expr: s.Expr, section: SectionScope, reads: Reads) -> s.Expr | None:
    match expr:
        case s.IfElse(condition=condition, then=then, otherwise=otherwise):
            return _branch([(condition, then)], otherwise, section, reads)
        case s.Piecewise(branches=pieces, otherwise=otherwise):
            return _branch(list(pieces), otherwise, section, reads)
        case s.Table(by=by, rows=rows):
            return _cell(by, rows, section, reads)
        case _:
            return None


def _branch(
    pieces: list[tuple[s.Expr, s.Expr]], otherwise: s.Expr, section: SectionScope, reads: Reads
) -> s.Expr | None:
    for condition, then in pieces:
        found = holds(section.number(condition), reads)
        if found is None:
            return None
        if found:
            return then
    return otherwise


def _cell(by: tuple[s.Expr, ...], rows: tuple[s.TableRow, ...], section: SectionScope, reads: Reads) -> s.Expr | None:
    """The cell of a table; the named row goes before `else`."""
    other: s.TableRow | None = None
    for row in rows:
        if row.key is None:
            other = row
            continue
        found = holds(section.row(by[0], row.key), reads)
        if found is None:
            return None
        if found:
            return _inside(row, by, section, reads)
    return None if other is None else _inside(other, by, section, reads)


def _inside(row: s.TableRow, by: tuple[s.Expr, ...], section: SectionScope, reads: Reads) -> s.Expr | None:
    if isinstance(row.body, tuple):
        return _cell(by[1:], row.body, section, reads)
    return row.body


# -- draws as they are written --------------------------------------------------------------------


@dataclass(frozen=True)
class Written:
    """A distribution as written, with the conditions under which it is drawn from."""

    expr: s.Call | s.Weights
    guards: tuple[Node, ...]


def distributions(expr: s.Expr, section: SectionScope) -> Iterator[Written]:
    """The distributions in an expression whose parameters can be looked at on their own."""
    yield from _distributions(expr, section, ())


def _distributions(expr: s.Expr, section: SectionScope, guards: tuple[Node, ...]) -> Iterator[Written]:
    match expr:
        case s.IfElse(condition=condition, then=then, otherwise=otherwise):
            yield from _pieces([(condition, then)], otherwise, section, guards)
        case s.Piecewise(branches=pieces, otherwise=otherwise):
            yield from _pieces(list(pieces), otherwise, section, guards)
        case s.Table(by=by, rows=rows):
            yield from _rows(by, rows, section, guards)
        case s.Comprehension():
            return  # its parameters depend on the comprehension's own variables
        case s.Weights(pairs=pairs):
            yield Written(expr, guards)
            for value, _ in pairs:
                yield from _distributions(value, section, guards)
        case s.Call(function=name, args=args, keywords=keywords):
            if is_distribution(name):
                yield Written(expr, guards)
            for part in (*args, *(value for _, value in keywords)):
                if not (is_distribution(name) and isinstance(part, s.Weights)):
                    yield from _distributions(part, section, guards)
        case _:
            for part in parts(expr):
                yield from _distributions(part, section, guards)


def parts(expr: s.Expr) -> Iterator[s.Expr]:
    """The expressions directly inside one that always has the value of all its parts."""
    match expr:
        case s.Unary(operand=operand):
            yield operand
        case s.Binary(left=left, right=right):
            yield from (left, right)
        case s.Logical(operands=operands):
            yield from operands
        case s.Compare(first=first, rest=rest):
            yield first
            yield from (side for _, side in rest if not isinstance(side, s.SetOf | s.Comprehension))
        case s.Subscript(value=value, indices=indices):
            yield value
            yield from (i for i in indices if not isinstance(i, s.Slice))
        case s.Vector(items=items):
            yield from items
        case _:
            return


def _pieces(
    pieces: list[tuple[s.Expr, s.Expr]], otherwise: s.Expr, section: SectionScope, guards: tuple[Node, ...]
) -> Iterator[Written]:
    b = section.task.builder
    for condition, then in pieces:
        node = section.number(condition)
        yield from _distributions(then, section, guards if node is None else (*guards, node))
        guards = guards if node is None else (*guards, b.apply("not", node))
    yield from _distributions(otherwise, section, guards)


def _rows(
    by: tuple[s.Expr, ...], rows: tuple[s.TableRow, ...], section: SectionScope, guards: tuple[Node, ...]
) -> Iterator[Written]:
    b = section.task.builder
    others: tuple[Node, ...] = ()
    for row in rows:
        node = None if row.key is None else section.row(by[0], row.key)
        here = (*guards, *others) if row.key is None else guards if node is None else (*guards, node)
        if node is not None:
            others = (*others, b.apply("not", node))
        if isinstance(row.body, tuple):
            yield from _rows(by[1:], row.body, section, here)
        elif not _has_draws(row.body):
            continue
        else:
            yield from _distributions(row.body, section, here)


def _has_draws(expr: s.Expr) -> bool:
    return (
        isinstance(expr, s.Weights)
        or any(isinstance(n, s.Call) and is_distribution(n.function) for n in s.names(expr))
        or _weighted(expr)
    )


def _weighted(root: object) -> bool:
    """Whether a row of probabilities stands anywhere below."""
    if isinstance(root, tuple):
        return any(_weighted(part) for part in root)
    if isinstance(root, s.Weights):
        return True
    if not hasattr(root, "__dataclass_fields__") or isinstance(root, s.Place):
        return False
    return any(_weighted(getattr(root, name)) for name in root.__dataclass_fields__)
