"""What may stand in the place of an expression: numbers, vectors, cases, decision tables, and draws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tests.verification.oracle.reference.distributions import DISTRIBUTIONS, Call
from tests.verification.oracle.reference.expressions import Scope, alternatives, choice_of, evaluate, of_label
from tests.verification.oracle.reference.late import form_names_late
from tests.verification.oracle.reference.syntax import parse
from tests.verification.oracle.reference.values import (
    Choice,
    Value,
    Wrong,
    common_shape,
    joint_kind,
    number,
    same,
    scalar,
    settled,
    spread,
    vector,
)

ELSE = "else"


def form(data: Any, scope: Scope, expected: Choice | None = None) -> Value:
    """The value of what stands in the place of an expression."""
    match data:
        case str() if expected is not None and data in expected.labels and not data.isidentifier():
            return of_label(data, expected)
        case str():
            return evaluate(data, scope, expected)
        case bool() | int() | float():
            return scalar(data)
        case list() if data and all(isinstance(x, dict) and ("if" in x or ELSE in x) for x in data):
            return cases(data, scope, expected)
        case list():
            return vector([form(x, scope) for x in data])
        case {"by": by, "rows": rows}:
            return table(by if isinstance(by, list) else [by], rows, scope, expected)
        case dict():
            return listed_draw(data, scope, expected)
    raise Wrong(f"this is no expression: {data!r}")


def cases(entries: Sequence[dict[str, Any]], scope: Scope, expected: Choice | None) -> Value:
    """The first case whose condition holds."""
    expected = beside([e.get("then", e.get(ELSE)) for e in entries], scope, expected)
    conditions = [form(e["if"], scope) for e in entries if "if" in e]
    values = [(lambda e=e: form(e.get("then", e.get(ELSE)), scope, expected)) for e in entries]
    return alternatives(conditions, values, lambda: form_names_late(list(entries), scope))


def beside(parts: Sequence[Any], scope: Scope, expected: Choice | None) -> Choice | None:
    """The choice that labels among alternatives are of: that of the first that is named, if none is expected."""
    named = (parse(p) for p in parts if isinstance(p, str) and p.removesuffix("'").isidentifier())
    return expected or next((c for c in (choice_of(n, scope) for n in named) if c is not None), None)


def listed_draw(data: dict[Any, Any], scope: Scope, expected: Choice | None) -> Value:
    """`{value: probability}`."""
    return drawn(cell(data, scope, expected), scope)


@dataclass(frozen=True)
class Cell:
    """What a cell of a table holds: values with their probabilities; a single value for certain."""

    outcomes: list[Value]
    shares: list[Value]


def cell(data: Any, scope: Scope, expected: Choice | None) -> Cell:
    """All values of a cell, then all their probabilities; a draw that is written as a call is a value."""
    if isinstance(data, dict) and not set(data) & {"by", "rows"}:
        expected = beside(list(data), scope, expected)
        return Cell([key(k, scope, expected) for k in data], [form(p, scope) for p in data.values()])
    return Cell([form(data, scope, expected)], [scalar(1)])


def drawn(cell: Cell, scope: Scope) -> Value:
    if scope.chance is None:
        raise Wrong("no draw may stand here")
    call = Call([], {}, outcomes=cell.outcomes, shares=cell.shares)
    return DISTRIBUTIONS["Categorical"](call, scope.chance, scope.key())


def key(text: Any, scope: Scope, expected: Choice | None) -> Value:
    """A key is a label where labels are expected, and an expression anywhere."""
    if isinstance(text, str) and expected is not None and text in expected.labels:
        return of_label(text, expected)
    return form(text, scope, expected)


# ------------------------------------------------------------------------------ decision tables

Row = tuple[list[Value | None], Cell]
"""The values that a row holds for, None for all, and its cell."""


def table(by: Sequence[Any], rows: Any, scope: Scope, expected: Choice | None) -> Value:
    """A decision table: the row that holds is found, and one draw made for all rows if some of them draws."""
    asked = [form(b, scope) for b in by]
    expected = beside(list(values_in(rows, len(by))), scope, expected)
    written = list(listed(asked, rows, scope, expected))
    matches = [(holds(asked, keys), c) for keys, c in written]
    fixed = all(v.fixed for v in asked)
    if all(len(c.outcomes) == 1 for _, c in written):
        return certain(matches, fixed)
    return drawn_from(matches, scope)


def listed(asked: Sequence[Value], rows: Any, scope: Scope, expected: Choice | None) -> Iterator[Row]:
    """All rows in the order in which they stand; a mapping is rows as long as there is something left to ask."""
    if not asked or not isinstance(rows, dict):
        yield [], cell(rows, scope, expected)
        return
    for k, deeper in rows.items():
        first = None if k == ELSE else row_key(k, asked[0], scope)
        for rest, c in listed(asked[1:], deeper, scope, expected):
            yield [first, *rest], c


def values_in(rows: Any, depth: int) -> Iterator[Any]:
    """The values in the cells of a table."""
    if isinstance(rows, dict) and not set(rows) & {"by", "rows"}:
        for k, deeper in rows.items():
            yield from values_in(deeper, depth - 1) if depth > 0 else [k]
    else:
        yield rows


def row_key(k: Any, asked: Value, scope: Scope) -> Value:
    if isinstance(k, str) and asked.choice is not None and k in asked.choice.labels:
        return of_label(k, asked.choice)
    return form(k, scope)


def holds(asked: Sequence[Value], keys: Sequence[Value | None]) -> tuple[int, ...] | None:
    """How closely a row fits: 1 where its value is the one asked about, 0 where it holds for the rest; None: not at all."""
    fits = []
    for value, k in zip(asked, keys, strict=False):
        if k is not None and not same(value, k):
            return None
        fits.append(0 if k is None else 1)
    return tuple(fits)


def closest(matches: Sequence[tuple[tuple[int, ...] | None, Cell]]) -> Cell:
    """The cell of the row that holds: a value goes before `else`, from the outermost column inwards."""
    found = [(fit, c) for fit, c in matches if fit is not None]
    if not found:
        raise Wrong("no row")
    return max(found, key=lambda match: match[0])[1]


def certain(matches: Sequence[tuple[tuple[int, ...] | None, Cell]], fixed: bool) -> Value:
    cells = [c.outcomes[0] for _, c in matches]
    chosen = closest(matches).outcomes[0]
    if chosen.choice is not None:
        return Value("choice", chosen.shape, chosen.data, fixed and chosen.fixed, choice=chosen.choice)
    picked = number(chosen)
    kind = joint_kind(map(number, cells))
    shape = common_shape(list(map(number, cells)))
    known = fixed and all(c.fixed for c in cells)
    return settled(kind, shape, spread(picked, shape), fixed=known, rough=picked.rough)


def drawn_from(matches: Sequence[tuple[tuple[int, ...] | None, Cell]], scope: Scope) -> Value:
    """One draw for the table, with the probabilities of the row that holds."""
    chosen = closest(matches)
    shares = [share for _, c in matches for share in c.shares]
    exact = all(share.fixed for share in shares)
    kind = None if chosen.outcomes[0].choice else joint_kind(number(v) for _, c in matches for v in c.outcomes)
    outcomes = [v if kind is None else cast(v, kind) for v in chosen.outcomes]
    return drawn(Cell(outcomes, [replace(number(s), fixed=exact) for s in chosen.shares]), scope)


def cast(value: Value, kind: str) -> Value:
    plain = number(value)
    return settled(kind, plain.shape, plain.data, fixed=plain.fixed, rough=plain.rough)
