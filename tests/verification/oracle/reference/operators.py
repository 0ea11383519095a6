"""The operators, on values."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

from tests.verification.oracle.reference import arithmetic as a
from tests.verification.oracle.reference.functions import numeric, place, places, touched
from tests.verification.oracle.reference.values import Number, Value, Wrong, elementwise, number, settled, vector, watch

BINARY: dict[type[ast.operator], Callable[[Number, Number], Number]] = {
    ast.Add: a.add,
    ast.Sub: a.subtract,
    ast.Mult: a.multiply,
    ast.Div: a.divide,
    ast.FloorDiv: a.floor_divide,
    ast.Mod: a.modulo,
    ast.Pow: a.power,
}
COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


def binary(op: ast.operator, left: Value, right: Value) -> Value:
    kind = numeric(left, right)
    rough = False
    if isinstance(op, ast.Div):
        kind = "real"
    elif isinstance(op, ast.Pow):
        kind, rough = power_kind(kind, left, right)
    elif isinstance(op, ast.FloorDiv | ast.Mod):
        watch_quotient(left, right)
    return elementwise(BINARY[type(op)], kind, left, right, rough=rough)


def power_kind(kind: str, base: Value, exponent: Value) -> tuple[str, bool]:
    """A power of ints is an int where the exponent is known to be a natural number, else a real."""
    if kind == "int" and exponent.fixed and all(e >= 0 for e in number(exponent).data):
        return "int", False
    return "real", kind == "real"


def watch_quotient(left: Value, right: Value) -> None:
    """Quotients of rough numbers near a whole number are too close to call."""
    if number(left).rough or number(right).rough:
        for q in elementwise(a.divide, "real", left, right).data:
            watch(q, round(q) if math.isfinite(q) else q, rough=True)


def negate(value: Value) -> Value:
    return elementwise(a.negate, numeric(value), value)


def plus(value: Value) -> Value:
    return elementwise(lambda x: +x, numeric(value), value)


def invert(value: Value) -> Value:
    return elementwise(operator.not_, "bool", conditions(value))


def conditions(value: Value) -> Value:
    if value.kind != "bool":
        raise Wrong("a condition is needed")
    return value


def both_hold(x: bool, y: bool) -> bool:
    return x and y


def either_holds(x: bool, y: bool) -> bool:
    return x or y


def compare(op: ast.cmpop, left: Value, right: Value) -> Value:
    """One link of a chain of comparisons, element by element; two choices are equal when their labels are."""
    if left.kind == right.kind == "choice" and left.choice == right.choice and isinstance(op, ast.Eq | ast.NotEq):
        left, right = (settled("int", v.shape, v.data, fixed=v.fixed) for v in (left, right))
    x = number(left)
    y = number(right)
    rough = x.rough or y.rough

    def hold(p: Number, q: Number) -> bool:
        watch(p, q, rough=rough)
        return COMPARE[type(op)](*(map(float, (p, q)) if isinstance(p, float) != isinstance(q, float) else (p, q)))

    return elementwise(hold, "bool", x, y)


def element(value: Value, index: Value) -> Value:
    """`x[i]`: an element or a row; with a vector of indices, a vector of them."""
    rows = number(value).rows()
    index = number(index)
    if not rows and index.data:
        raise Wrong("there is no element")
    picked = vector([rows[i] for i in places(index, len(rows))]) if index.shape else rows[place(index, len(rows))]
    return touched(picked, value, index)


def section(value: Value, piece: slice) -> Value:
    rows = number(value).rows()[piece]
    return vector(rows) if rows else settled(value.kind, (0, *value.shape[1:]), (), fixed=value.fixed)
