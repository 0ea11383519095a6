"""Parameters -> their values inside surface syntax, with the arithmetic that this makes possible done."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, TypeVar

from taskspec.lang import syntax as s

T = TypeVar("T")
MAX_POWER = 64
_EXACT: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "//": operator.floordiv, "%": operator.mod,
}  # fmt: skip


def substitute(node: T, values: Mapping[str, Any]) -> T:
    """Return the same tree with names replaced by numbers and constant arithmetic folded."""
    return _go(node, values)  # type: ignore[no-any-return]


def _go(node: Any, values: Mapping[str, Any]) -> Any:
    match node:
        case tuple():
            return tuple(_go(x, values) for x in node)
        case s.Name(id=name, primed=False) if name in values:
            return _literal(values[name], node.place) or node
        case s.Comprehension():
            bound = {t for c in node.clauses for t in c.targets}
            return _rebuild(node, {k: v for k, v in values.items() if k not in bound})
        case s.Place() | s.Number() | s.Boolean() | s.Quoted() | s.Name():
            return node
        case _ if dataclasses.is_dataclass(node) and not isinstance(node, type):
            return _fold(_rebuild(node, values))
        case _:
            return node


def _rebuild(node: Any, values: Mapping[str, Any]) -> Any:
    changes = {f.name: _go(getattr(node, f.name), values) for f in dataclasses.fields(node)}
    return dataclasses.replace(node, **changes)


def _literal(value: Any, place: s.Place) -> s.Expr | None:
    if isinstance(value, bool):
        return s.Boolean(value, place)
    if not isinstance(value, int | float) or value != value:
        return None
    if value < 0:
        return s.Unary("-", s.Number(-value, _digits(-value), place), place)
    return s.Number(value, _digits(value), place)


def _digits(value: int | float) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _fold(node: Any) -> Any:
    """Return arithmetic of two integers, done; anything else stays as written."""
    match node:
        case s.Binary(op=op, left=left, right=right, place=place):
            a = _integer(left)
            b = _integer(right)
            if a is None or b is None:
                return _unit(node)
            value = _compute(op, a, b)
            return node if value is None else _literal(value, place)
        case _:
            return node


def _unit(node: s.Binary) -> s.Expr:
    """Simplify x * 1, 1 * x and x + 0."""
    a = _integer(node.left)
    b = _integer(node.right)
    if node.op == "*" and a == 1:
        return node.right
    if (node.op == "*" and b == 1) or (node.op in "+-" and b == 0):
        return node.left
    return node.right if node.op == "+" and a == 0 else node


def _integer(expr: s.Expr) -> int | None:
    match expr:
        case s.Number(value=int(value)):
            return value
        case s.Unary(op="-", operand=s.Number(value=int(value))):
            return -value
        case _:
            return None


def _compute(op: str, a: int, b: int) -> int | None:
    if op in ("//", "%") and b == 0:
        return 0
    if op == "**":
        return a**b if 0 <= b <= MAX_POWER and abs(a) <= 1000 else None
    if op == "/":
        ratio = Fraction(a, b) if b else None
        return int(ratio) if ratio is not None and ratio.denominator == 1 else None
    return int(_EXACT[op](a, b))
