"""Values by cases: conditionals, `if:`/`then:` lists, decision tables, probabilities; and tables as transition arrows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from taskspec.lang import syntax as s
from taskspec.printers import tree as m
from taskspec.printers.names import Writer
from taskspec.printers.pieces import operands
from taskspec.printers.text import text

Keys = tuple[s.Expr | None, ...]
_OTHERWISE = m.Words("otherwise")
IF = m.Words("if ")  # what a condition of a case begins with


def cases(w: Writer, expr: s.Expr) -> m.Math:
    """Return a value by cases."""
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


@dataclass
class _Group:
    """Rows of a decision table with one cell; `written` is its text."""

    written: str
    cell: s.Expr
    rows: list[Keys]


def _table(w: Writer, table: s.Table) -> Iterator[tuple[m.Math, m.Math]]:
    """Yield lines, the first of which that applies gives the value."""
    for group in _groups(table.rows):
        tree = w.number(group.cell).tree
        if any(not any(keys) for keys in group.rows):
            yield tree, _OTHERWISE
        else:
            yield tree, m.Row((IF, _keys(w, table.by, group.rows)))


def _groups(rows: Iterable[s.TableRow]) -> list[_Group]:
    """Return rows with equal cells together, unless a row between them applies to some of the same values."""
    groups: list[_Group] = []
    latest: dict[str, int] = {}
    partial: list[tuple[int, Keys]] = []  # rows with an `else`, and where they stand: any two others are disjoint
    for keys, cell in _flat(rows):
        written = text(cell)
        at = latest.get(written, -1)
        between = [other for i, other in partial if i > at]
        if None in keys:
            between = [other for group in groups[at + 1 :] for other in group.rows]
        if at < 0 or any(_overlap(keys, other) for other in between):
            at = len(groups)
            latest[written] = at
            groups.append(_Group(written, cell, []))
        groups[at].rows.append(keys)
        if None in keys:
            partial.append((at, keys))
    return _without_rest(groups)


def _without_rest(groups: list[_Group]) -> list[_Group]:
    """Return the groups less the rows that `else`, at the end, is there for."""
    *some, last = groups
    if any(last.rows[-1]):
        return groups
    kept = [last]
    for group in reversed(some):
        if group.written == last.written:
            later = [other for g in kept[:-1] for other in g.rows]
            group.rows = [keys for keys in group.rows if any(_overlap(keys, other) for other in later)]
        if group.rows:
            kept.insert(0, group)
    return kept


def _overlap(one: Keys, other: Keys) -> bool:
    """Return whether some values fit two rows; what a row does not look at, or has `else` for, fits all."""
    return all(a is None or b is None or text(a) == text(b) for a, b in zip(one, other, strict=False))


def _flat(rows: Iterable[s.TableRow], before: Keys = ()) -> Iterator[tuple[Keys, s.Expr]]:
    """Yield the cells with their keys, `else` after the others."""
    for row in sorted(rows, key=lambda row: row.key is None):
        keys = (*before, row.key)
        if isinstance(row.body, tuple):
            yield from _flat(row.body, keys)
        else:
            yield keys, row.body


def _keys(w: Writer, by: Sequence[s.Expr], rows: list[Keys]) -> m.Math:
    """Return the condition that one of the rows applies."""
    if all(len(keys) == 1 for keys in rows):
        return _equal(w, by[0], [keys[0] for keys in rows if keys[0] is not None])
    conjunctions = []
    for keys in rows:
        equal = (_equal(w, column, [key]) for column, key in zip(by, keys, strict=False) if key is not None)
        conjunctions.append(m.joined(equal, "∧"))
    if len(conjunctions) == 1:
        return conjunctions[0]
    return m.joined(map(m.brackets, conjunctions), "∨")


def _equal(w: Writer, column: s.Expr, keys: list[s.Expr]) -> m.Math:
    inner = replace(w, of=column.id) if isinstance(column, s.Name) else w
    left, *trees = operands("compare", map(inner.number, [column, *keys]))
    if len(trees) == 1:
        return m.Row((left, m.Sym("="), trees[0]))
    return m.Row((left, m.Sym("∈"), m.braces(m.joined(trees))))


def has_arrows(table: s.Expr, state: str, actions: Sequence[str]) -> bool:
    """Return whether a table of a state component's next value reads as transitions: by the state, maybe by the action."""
    if not isinstance(table, s.Table):
        return False
    plain = [c.id if isinstance(c, s.Name) and not c.primed else None for c in table.by]
    return plain == [state] or (len(actions) == 1 and plain == [state, actions[0]])


def arrows(w: Writer, table: s.Table, state: str, action: m.Math, actions: str) -> list[m.Math]:
    """Return one line for each state: `s --a--> s'` for every action.

    Args:
        w: writes the labels of the state.
        table: by the state, and maybe by the action.
        state: name of the state component.
        action: what stands for any action.
        actions: name of the action component.
    """
    target = replace(w, of=state)
    lines: list[m.Math] = []
    for row in table.rows:
        origin = w.notation.symbol(state)
        every: tuple[m.Math, ...] = (m.Words(" for every other "), origin)
        if row.key is not None:
            origin = target.number(row.key).tree
            every = ()
        parts: list[m.Math] = []
        if not isinstance(row.body, tuple):
            forall = m.Row((m.Words(" for all "), action, m.Sym("∈"), m.Ident("A", "calligraphic")))
            parts = [origin, m.Arrow(action), target.number(row.body).tree, forall]
        for inner in row.body if isinstance(row.body, tuple) else ():
            assert not isinstance(inner.body, tuple)
            if parts:
                parts += [m.Sym(","), m.Gap("wide")]
            over = action if inner.key is None else replace(w, of=actions).number(inner.key).tree
            parts += [origin, m.Arrow(over), target.number(inner.body).tree]
            if inner.key is None:
                parts.append(m.Words(" otherwise"))
        lines.append(m.Row((*parts, *every)))
    return lines
