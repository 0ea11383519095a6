"""Expressions for a terminal: in the notation of specs, coloured, tables and cases set as rows."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.table import Table

from taskspec.cli.terminal import VisibleText
from taskspec.lang import syntax as s
from taskspec.printers import text as written

if TYPE_CHECKING:
    from rich.console import RenderableType

_TOKENS = re.compile(
    r"(?P<word>\b(?:and|or|not|in|if|else|for|otherwise)\b)|(?P<call>\b[^\W\d]\w*(?=\())|(?P<number>\b\d[\d_]*(?:\.\d+)?(?:e[+-]?\d+)?\b)"
)
_STYLES = {"word": "bright_blue", "call": "magenta", "number": "green"}


def colored(text: str) -> VisibleText:
    """An expression with its words, functions and numbers in colour."""
    line = VisibleText(text)
    for found in _TOKENS.finditer(text):
        assert found.lastgroup is not None
        line.stylize(_STYLES[found.lastgroup], *found.span())
    return line


def body(expr: s.Expr) -> RenderableType:
    """The right-hand side of an equation: a line, or rows for what is decided case by case."""
    match expr:
        case s.Piecewise(branches=branches, otherwise=otherwise):
            cases = [(value, f"if {written(condition)}") for condition, value in branches]
            return _rows([[written(value), condition] for value, condition in [*cases, (otherwise, "otherwise")]])
        case s.Table(by=by, rows=rows):
            return _rows([*_table_rows(rows, len(by))], [written(column) for column in by])
        case _:
            return colored(written(expr))


def _table_rows(rows: tuple[s.TableRow, ...], depth: int) -> Iterator[list[str]]:
    """Rows of a decision table: the keys, blank where one cell is for all of them, and the cell."""
    for row in rows:
        key = "else" if row.key is None else written(row.key)
        if isinstance(row.body, tuple):
            for i, deeper in enumerate(_table_rows(row.body, depth - 1)):
                yield [key if i == 0 else "", *deeper]
        else:
            yield [key, *([""] * (depth - 1)), written(row.body)]


def _rows(rows: list[list[str]], headers: list[str] | None = None) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=headers is not None, header_style="quiet")
    for header in [*(headers or []), *([""] * (len(rows[0]) - len(headers or [])))]:
        table.add_column(header)
    for row in rows:
        table.add_row(*map(colored, row))
    return table
