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
IF = m.Words("if ")
"""What a condition of a case begins with."""


def cases(w: Writer, expr: s.Expr) -> m.Math:
    """Return a value by cases."""
    if isinstance(expr, s.Weights):
        return m.Cases(tuple(_chance(w, value, p) for value, p in expr.pairs))
    return m.Cases(tuple(_rows(w, expr)))


def _rows(w: Writer, expr: s.Expr) -> Iterator[tuple[m.Math, m.Math]]:
    match expr:
        case s.IfElse(condition=condition, then=then, otherwise=otherwise):
            yield w.number(then).tree, _if(w.truth(condition).tree)
            yield from _rows(w, otherwise)
        case s.Piecewise(branches=branches, otherwise=otherwise):
            for condition, then in branches:
                yield w.number(then).tree, _if(w.truth(condition).tree)
            yield from _rows(w, otherwise)
        case s.Table():
            yield from _table(w, expr)
        case _:
            yield w.number(expr).tree, _OTHERWISE


def _if(condition: m.Math) -> m.Math:
    return m.Row((IF, condition))


def _chance(w: Writer, value: s.Expr, p: s.Expr) -> tuple[m.Math, m.Math]:
    return w.number(value).tree, m.Row((m.Words("with probability "), w.number(p).tree))


# -- decision tables --------------------------------------------------------------------------------------------------


def _table(w: Writer, table: s.Table) -> Iterator[tuple[m.Math, m.Math]]:
    """Return lines, the first of which that applies gives the value."""
    for group in _groups(table.rows):
        tree = w.number(group.cell).tree
        if any(all(key is None for key in keys) for keys in group.rows):
            yield tree, _OTHERWISE
        else:
            yield tree, _if(_keys(w, table.by, group.rows))


@dataclass
class _Group:
    """Rows of one cell; `written` is its text."""

    written: str
    cell: s.Expr
    rows: list[Keys]


def _groups(rows: Iterable[s.TableRow]) -> list[_Group]:
    """Return rows with equal cells together, unless a row between them applies to some of the same values."""
    groups: list[_Group] = []
    latest: dict[str, int] = {}
    partial: list[tuple[int, Keys]] = []  # rows with an `else`, and where they stand: any two others are disjoint
    for keys, cell in _flat(rows):
        written = text(cell)
        at = latest.get(written, -1)
        between = (
            (k for g in groups[at + 1 :] for k in g.rows) if None in keys else (k for i, k in partial if i > at)
        )  # fmt: skip
        if at < 0 or any(_overlap(keys, other) for other in between):
            at = latest[written] = len(groups)
            groups.append(_Group(written, cell, []))
        groups[at].rows.append(keys)
        if None in keys:
            partial.append((at, keys))
    return _without_rest(groups)


def _without_rest(groups: list[_Group]) -> list[_Group]:
    """Return the groups less the rows that `else`, at the end, is there for."""
    *some, last = groups
    if any(key is not None for key in last.rows[-1]):
        return groups
    kept: list[_Group] = []
    for group in reversed(some):
        if group.written == last.written:
            group.rows = [k for k in group.rows if any(_overlap(k, other) for g in kept for other in g.rows)]
        kept += [group] if group.rows else []
    return [*reversed(kept), last]


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


def _keys(w: Writer, by: Sequence[s.Expr], rows: list[tuple[s.Expr | None, ...]]) -> m.Math:
    """Return the condition that one of the rows applies."""
    if all(len(keys) == 1 for keys in rows):
        return _equal(w, by[0], [keys[0] for keys in rows if keys[0] is not None])
    conjunctions = [
        m.joined([_equal(w, column, [key]) for column, key in zip(by, keys, strict=False) if key is not None], "∧")
        for keys in rows
    ]
    return m.joined(conjunctions, "∨") if len(conjunctions) == 1 else m.joined(map(m.brackets, conjunctions), "∨")


def _equal(w: Writer, column: s.Expr, keys: list[s.Expr]) -> m.Math:
    inner = replace(w, of=column.id if isinstance(column, s.Name) else w.of)
    left, *trees = operands("compare", map(inner.number, [column, *keys]))
    if len(trees) == 1:
        return m.Row((left, m.Sym("="), trees[0]))
    return m.Row((left, m.Sym("∈"), m.braces(m.joined(trees))))


# -- transition arrows ------------------------------------------------------------------------------------------------


def has_arrows(table: s.Expr, state: str, actions: Sequence[str]) -> bool:
    """Return whether a table of a state component's next value reads as transitions: by the state, maybe by the action."""
    if not isinstance(table, s.Table) or len(table.by) > 2:
        return False
    plain = [c.id if isinstance(c, s.Name) and not c.primed else None for c in table.by]
    return plain[0] == state and (len(plain) == 1 or (len(actions) == 1 and plain[1] == actions[0]))


def arrows(w: Writer, table: s.Table, state: str, action: m.Math, actions: str) -> list[m.Math]:
    """Return one line for each state: `s --a--> s'` for every action.

    Args:
        w: writes the labels of the state.
        table: by the state, and maybe by the action.
        state: name of the state component.
        action: what stands for any action.
        actions: name of the action component.
    """
    lines = []
    for row in table.rows:
        origin = w.notation.symbol(state) if row.key is None else replace(w, of=state).number(row.key).tree
        lines.append(_line(w, row, origin, state, action, actions))
    return lines


def _line(w: Writer, row: s.TableRow, origin: m.Math, state: str, action: m.Math, actions: str) -> m.Math:
    every: tuple[m.Math, ...] = () if row.key is not None else (m.Words(" for every other "), w.notation.symbol(state))
    target = replace(w, of=state)
    if not isinstance(row.body, tuple):
        forall = m.Row((m.Words(" for all "), action, m.Sym("∈"), m.Ident("A", "calligraphic")))
        return m.Row((origin, m.Arrow(action), target.number(row.body).tree, forall, *every))
    parts: list[m.Math] = []
    for inner in row.body:
        over = action if inner.key is None else replace(w, of=actions).number(inner.key).tree
        assert not isinstance(inner.body, tuple)
        rest: tuple[m.Math, ...] = (m.Words(" otherwise"),) if inner.key is None else ()
        parts += [m.Sym(","), m.Gap("wide")] if parts else []
        parts += [origin, m.Arrow(over), target.number(inner.body).tree, *rest]
    return m.Row((*parts, *every))
