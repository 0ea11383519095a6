"""Surface syntax -> text that parses to the same tree, with the fewest brackets."""

from __future__ import annotations

from typing import Any, assert_never

from taskspec.lang import syntax as s

_TERNARY, _OR, _AND, _NOT, _COMPARE, _SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(10)
_BINARY = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT, "//": _PRODUCT, "%": _PRODUCT, "**": _POWER}
_LOGICAL = {"or": _OR, "and": _AND}


def text(expr: s.Expr) -> str:
    """An expression as text.

    What only YAML can write (`if:`/`then:` lists, `by:`/`rows:` tables) comes out as conditionals of the same
    meaning; `data` keeps their form.
    """
    return _write(expr)[0]


def data(expr: s.Expr) -> Any:
    """An expression as YAML data that reads as the same tree."""
    match expr:
        case s.Piecewise(branches=branches, otherwise=otherwise):
            pieces = [{"if": data(c), "then": data(v)} for c, v in branches]
            return [*pieces, {"else": data(otherwise)}]
        case s.Table(by=by, rows=rows):
            columns = [data(c) for c in by]
            return {"by": columns[0] if len(columns) == 1 else columns, "rows": _rows(rows)}
        case s.Weights(pairs=pairs):
            return {_key(value): data(p) for value, p in pairs}
        case s.Vector(items=items):
            return [data(i) for i in items]
        case s.Boolean(value=value):
            return value
        case _:
            return text(expr)


def _key(expr: s.Expr) -> str:
    return expr.value if isinstance(expr, s.Quoted) else text(expr)


def _rows(rows: tuple[s.Row, ...]) -> dict[str, Any]:
    return {
        "else" if row.key is None else _key(row.key): _rows(row.body) if isinstance(row.body, tuple) else data(row.body)
        for row in rows
    }


def _at(expr: s.Expr, precedence: int) -> str:
    """An operand that must bind at least this tightly."""
    written, own = _write(expr)
    return written if own >= precedence else f"({written})"


def _write(expr: s.Expr) -> tuple[str, int]:
    match expr:
        case s.Number(text=written):
            return written, _ATOM
        case s.Boolean(value=value):
            return str(value), _ATOM
        case s.Quoted(value=value):
            return (f'"{value}"' if '"' not in value else f"'{value}'"), _ATOM
        case s.Name():
            return expr.written, _ATOM
        case s.Unary(op="not", operand=operand):
            return f"not {_at(operand, _NOT)}", _NOT
        case s.Unary(op=op, operand=operand):
            return f"{op}{_at(operand, _SIGN)}", _SIGN
        case s.Binary():
            return _binary(expr)
        case s.Logical(op=op, operands=operands):
            own = _LOGICAL[op]
            return f" {op} ".join(_at(o, own + 1) for o in operands), own
        case s.Compare(first=first, rest=rest):
            links = "".join(f" {op} {_at(side, _SUM)}" for op, side in rest)
            return _at(first, _SUM) + links, _COMPARE
        case s.IfElse(condition=c, then=then, otherwise=otherwise):
            return f"{_at(then, _OR)} if {_at(c, _OR)} else {text(otherwise)}", _TERNARY
        case s.Call():
            return _call(expr), _ATOM
        case s.Subscript(value=value, indices=indices):
            base = f"({text(value)})" if isinstance(value, s.Number) else _at(value, _ATOM)
            return f"{base}[{', '.join(map(_index, indices))}]", _ATOM
        case s.Vector() | s.SetOf() | s.Weights() | s.Comprehension():
            return _display(expr), _ATOM
        case s.Piecewise(branches=branches, otherwise=otherwise):
            return _write(_conditional(branches, otherwise, expr.place))
        case s.Table():
            return _write(_as_conditional(expr.by, expr.rows, expr.place))
        case _:
            assert_never(expr)


def _binary(expr: s.Binary) -> tuple[str, int]:
    own = _BINARY[expr.op]
    if expr.op == "**":
        return f"{_at(expr.left, _ATOM)}**{_at(expr.right, _SIGN)}", own
    return f"{_at(expr.left, own)} {expr.op} {_at(expr.right, own + 1)}", own


def _call(expr: s.Call) -> str:
    arguments = [text(a) for a in expr.args] + [f"{name}={text(value)}" for name, value in expr.keywords]
    return f"{expr.function}({', '.join(arguments)})"


def _index(index: s.Expr | s.Slice) -> str:
    if isinstance(index, s.Vector):  # round brackets would make it several indices
        return f"[{', '.join(map(text, index.items))}]"
    if not isinstance(index, s.Slice):
        return text(index)
    start, stop, step = ("" if x is None else text(x) for x in (index.start, index.stop, index.step))
    return f"{start}:{stop}:{step}" if index.step is not None else f"{start}:{stop}"


def _display(expr: s.Vector | s.SetOf | s.Weights | s.Comprehension) -> str:
    match expr:
        case s.Vector(items=items):
            inner = ", ".join(map(text, items))
            return f"[{inner}]" if len(items) < 2 else f"({inner})"
        case s.SetOf(items=items):
            return f"{{{', '.join(map(text, items))}}}"
        case s.Weights(pairs=pairs):
            return f"{{{', '.join(f'{text(v)}: {text(p)}' for v, p in pairs)}}}"
        case s.Comprehension(element=element, clauses=clauses, is_set=is_set):
            inner = " ".join([text(element), *map(_clause, clauses)])
            return f"{{{inner}}}" if is_set else f"[{inner}]"


def _clause(clause: s.Clause) -> str:
    conditions = "".join(f" if {_at(c, _OR)}" for c in clause.conditions)
    return f"for {', '.join(clause.targets)} in {_at(clause.domain, _OR)}{conditions}"


def _conditional(branches: tuple[tuple[s.Expr, s.Expr], ...], otherwise: s.Expr, place: s.Place) -> s.Expr:
    result = otherwise
    for condition, value in reversed(branches):
        result = s.IfElse(condition, value, result, place)
    return result


def _as_conditional(by: tuple[s.Expr, ...], rows: tuple[s.Row, ...], place: s.Place) -> s.Expr:
    """A table as nested conditionals; where no row is for everything else, the last row is."""
    pairs = [
        (row.key, _as_conditional(by[1:], row.body, place) if isinstance(row.body, tuple) else row.body) for row in rows
    ]
    last = next((body for key, body in pairs if key is None), pairs[-1][1])
    keyed = [(key, body) for key, body in pairs if key is not None]
    if all(key is not None for key, _ in pairs):
        keyed = keyed[:-1]
    branches = tuple((s.Compare(by[0], (("==", key),), place), body) for key, body in keyed)
    return _conditional(branches, last, place)
