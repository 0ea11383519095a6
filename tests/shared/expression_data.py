"""Expressions as YAML data, to be read again."""

from typing import Any

from taskspec.language.expressions import syntax as s
from taskspec.show.printers.text import text


def data(expr: s.Expr) -> Any:
    """Return an expression as YAML data that reads as the same tree."""
    match expr:
        case s.Piecewise(branches=branches, otherwise=otherwise):
            pieces = [{"if": data(c), "then": data(v)} for c, v in branches]
            return [*pieces, {"else": data(otherwise)}]
        case s.Table(by=by, rows=rows):
            return {"by": list(map(data, by)), "rows": _rows(rows)}
        case s.Weights(pairs=pairs):
            return {_key(value): data(p) for value, p in pairs}
        case s.Vector(items=items):
            return list(map(data, items))
        case s.Boolean(value=value):
            return value
        case _:
            return text(expr)


def _key(expr: s.Expr) -> str:
    return expr.value if isinstance(expr, s.Quoted) else text(expr)


def _rows(rows: tuple[s.TableRow, ...]) -> dict[str, Any]:
    found = {}
    for row in rows:
        key = "else" if row.key is None else _key(row.key)
        found[key] = _rows(row.body) if isinstance(row.body, tuple) else data(row.body)
    return found
