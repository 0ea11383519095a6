"""Values by cases: conditions, decision tables, probabilities; and tables that read as transitions, with arrows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

from taskspec.language.expressions import syntax as s
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import Writer
from taskspec.show.printers.pieces import operands
from taskspec.show.printers.text import text

Keys = tuple[s.Expr | None, ...]
_OTHERWISE = m.Words("otherwise")
IF = m.Words("if ")  # what a condition of a case begins with


def cases(w: Writer, expr: s.Expr) -> m.Math:
    if not isinstance(expr, s.Weights):
        return m.Cases(tuple(_rows(w, expr)))
    rows = []
    for value, p in expr.pairs:
        rows.append((w.number(value).tree, m.Row((m.Words("with probability "), w.number(p).tree))))
    return m.Cases(tuple(rows))


def _rows(w: Writer, expr: s.Expr) -> Iterator[tuple[m.Math, m.Math]]:
    match expr:
        case s.IfElse(condition=condition, then=then, otherwise=otherwise):
            branches: tuple[tuple[s.Expr, s.Expr], ...] = ((condition, then),)
        case s.Piecewise(branches=branches, otherwise=otherwise):
            pass
        case s.Table():
            yield from _table(w, expr)
            return
        case _:
            yield w.number(expr).tree, _OTHERWISE
            return
    for condition, then in branches:
        yield w.number(then).tree, m.Row((IF, w.truth(condition).tree))
    yield from _rows(w, otherwise)


def _table(w: Writer, table: s.Table) -> Iterator[tuple[m.Math, m.Math]]:
    """Yield the cells of a decision table with their conditions; neighbours with equal cells are one."""
    for _, group in groupby(_flat(table.rows), key=lambda row: text(row[1])):
        rows = list(group)
        tree = w.number(rows[0][1]).tree
        keys = [key for key, _ in rows]
        if not all(map(any, keys)):
            yield tree, _OTHERWISE
        else:
            yield tree, m.Row((IF, _keys(w, table.by, keys)))


def _flat(rows: Iterable[s.TableRow], before: Keys = ()) -> Iterator[tuple[Keys, s.Expr]]:
    for row in sorted(rows, key=lambda row: row.key is None):
        keys = (*before, row.key)
        if isinstance(row.body, tuple):
            yield from _flat(row.body, keys)
        else:
            yield keys, row.body


def _keys(w: Writer, by: Sequence[s.Expr], rows: list[Keys]) -> m.Math:
    if max(map(len, rows)) == 1:
        return _equal(w, by[0], [key for (key,) in rows if key is not None])
    conjunctions = []
    for keys in rows:
        equal = []
        for column, key in zip(by, keys, strict=False):
            if key is not None:
                equal.append(_equal(w, column, [key]))
        conjunctions.append(m.joined(equal, "∧"))
    if len(conjunctions) == 1:
        return conjunctions[0]
    return m.joined(map(m.brackets, conjunctions), "∨")


def _equal(w: Writer, column: s.Expr, keys: list[s.Expr]) -> m.Math:
    inner = w
    if isinstance(column, s.Name):
        inner = replace(w, of=column.id)
    left, *trees = operands("compare", map(inner.number, [column, *keys]))
    if len(trees) == 1:
        return m.equal(left, trees[0])
    return m.Row((left, m.Sym("∈"), m.braces(m.joined(trees))))


def has_arrows(table: s.Expr, state: str, actions: Sequence[str]) -> bool:
    """Test whether a table of a state component's next value reads as transitions: by the state, maybe by the action."""
    if not isinstance(table, s.Table):
        return False
    plain = []
    for c in table.by:
        if not isinstance(c, s.Name) or c.primed:
            return False
        plain.append(c.id)
    return plain == [state] or (len(actions) == 1 and plain == [state, actions[0]])


def arrows(w: Writer, table: s.Table, state: str, action: m.Math, actions: str) -> list[m.Math]:
    """Write one line for each state: `s --a--> s'` for every action."""
    target = replace(w, of=state)
    lines: list[m.Math] = []
    for row in table.rows:
        origin = w.notation.symbol(state)
        every: tuple[m.Math, ...] = (m.Words(" for every other "), origin)
        if row.key is not None:
            origin = target.number(row.key).tree
            every = ()
        parts: list[m.Math] = []
        rows = row.body
        if not isinstance(rows, tuple):
            forall = m.Row((m.Words(" for all "), action, m.Sym("∈"), m.Ident("A", "calligraphic")))
            parts = [origin, m.Arrow(action), target.number(rows).tree, forall]
            rows = ()
        for inner in rows:
            assert not isinstance(inner.body, tuple)
            if parts:
                parts += [m.Sym(","), m.Gap("wide")]
            over = action
            if inner.key is not None:
                over = replace(w, of=actions).number(inner.key).tree
            parts += [origin, m.Arrow(over), target.number(inner.body).tree]
            if inner.key is None:
                parts.append(m.Words(" otherwise"))
        lines.append(m.Row((*parts, *every)))
    return lines
