"""Random decision tables: over labels, conditions and ints, with rows that end early, `else`, and cells that draw."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.verification.oracle.generator import draws
from tests.verification.oracle.generator.terms import Context, Term

Cell = Callable[[], Any]
"""A random cell: an expression or a label."""


def table(c: Context, cell: Cell) -> Any:
    """A table over one or two columns; without anything to ask about, a single cell."""
    asked = columns(c)
    if not asked:
        return cell()
    by = c.rng.sample(asked, min(len(asked), c.rng.choice((1, 1, 2))))
    made = rows(c, by, cell, top=True)
    return {"by": by[0].text if len(by) == 1 and c.chance(0.5) else [b.text for b in by], "rows": made}


def columns(c: Context) -> list[Term]:
    """What a table may ask about."""
    kinds = [n for n in c.names if n.kind in ("label", "bool") or (n.kind == "int" and n.rows)]
    return [n for n in kinds if n.shape == () and len(n.text.rstrip("'")) == 1]


def rows(c: Context, by: list[Term], cell: Cell, *, top: bool = False) -> Any:
    if not by:
        return drawn_cell(c, cell)
    if not top and c.chance(0.15):
        return cell()
    values = values_of(by[0])
    keys = c.rng.sample(values, c.rng.randint(1, len(values)))
    made = {k: rows(c, by[1:], cell) for k in keys}
    if by[0].kind == "int" or len(keys) < len(values) or c.chance(0.1):
        made["else"] = rows(c, by[1:], cell)
    return made


def values_of(column: Term) -> list[Any]:
    if column.kind == "label":
        return list(column.labels)
    return [True, False] if column.kind == "bool" else list(column.rows)


def drawn_cell(c: Context, cell: Cell) -> Any:
    """A cell, or two values with their probabilities."""
    first = cell()
    second = cell()
    if not c.may_draw or first == second or not c.chance(0.25):
        return first
    p = draws.probability(c.without_draws(), 0)
    return {first: p.text, second: f"1 - ({p.text})"}
