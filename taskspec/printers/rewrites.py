"""Rewriting of surface syntax: other names, parameters replaced by their values, and draws taken out of expressions."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

from taskspec.lang import syntax as s
from taskspec.lang.dists import is_distribution
from taskspec.printers.tree import mapped

MAX_POWER = 64
_EXACT: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "//": operator.floordiv, "%": operator.mod,
}  # fmt: skip


def renamed(node: Any, old: str, new: str) -> Any:
    """Return the same tree with another name in the place of a name."""
    if isinstance(node, s.Name) and node.id == old:
        return s.Name(new, node.primed, node.place)
    return mapped(node, partial(renamed, old=old, new=new))


def substitute(node: Any, values: Mapping[str, Any]) -> Any:
    """Return the same tree with names replaced by numbers and constant arithmetic folded."""
    if isinstance(node, s.Name):
        known = not node.primed and node.id in values
        return (_literal(values[node.id], node.place) if known else None) or node
    if isinstance(node, s.Comprehension):
        bound = {target for clause in node.clauses for target in clause.targets}
        values = {name: value for name, value in values.items() if name not in bound}
    return _fold(mapped(node, partial(substitute, values=values)))


def _literal(value: Any, place: s.Place) -> s.Expr | None:
    if isinstance(value, bool):
        return s.Boolean(value, place)
    if not isinstance(value, int | float) or value != value:
        return None
    digits = f"{abs(value):.10g}" if isinstance(value, float) else str(abs(value))
    number = s.Number(abs(value), digits, place)
    return s.Unary("-", number, place) if value < 0 else number


def _fold(node: Any) -> Any:
    """Return arithmetic of two integers, done, and x for x * 1 and x + 0; anything else stays as written."""
    if not isinstance(node, s.Binary):
        return node
    a = _integer(node.left)
    b = _integer(node.right)
    if a is not None and b is not None:
        value = _compute(node.op, a, b)
        return node if value is None else _literal(value, node.place)
    if (node.op, a) in (("*", 1), ("+", 0)):
        return node.right
    if (node.op, b) in (("*", 1), ("+", 0), ("-", 0)):
        return node.left
    return node


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
        return a // b if b and Fraction(a, b).denominator == 1 else None
    return int(_EXACT[op](a, b))


@dataclass(frozen=True, slots=True)
class Drawn:
    """An expression whose inner draws have names, and those draws: the name of each, and its distribution.

    A draw in a comprehension is made for each of its elements, and has their index: `xi[i]`.
    """

    expr: s.Expr
    draws: tuple[tuple[s.Name | s.Subscript, s.Expr], ...]


def is_draw(expr: s.Expr) -> bool:
    """Return whether an expression is a distribution as a whole."""
    return isinstance(expr, s.Weights) or (isinstance(expr, s.Call) and is_distribution(expr.function))


def shows_probabilities(expr: s.Expr) -> bool:
    """Return whether an expression is printed as cases with probabilities, which need no name."""
    if isinstance(expr, s.Call) and expr.function == "Categorical":
        return any(isinstance(a, s.Weights) for a in expr.args)
    return isinstance(expr, s.Weights)


def take_apart(expr: s.Expr, prefix: str = "xi") -> Drawn:
    """Return names for the draws inside an expression, in written order."""
    found: list[tuple[s.Name | s.Subscript, s.Expr]] = []

    def go(node: Any, indices: tuple[str, ...] = ()) -> Any:
        if isinstance(node, s.Call) and is_distribution(node.function) and not shows_probabilities(node):
            name = s.Name(f"{prefix}_{len(found) + 1}", False, node.place)
            below = tuple(s.Name(i, False, node.place) for i in indices)
            found.append((s.Subscript(name, below, node.place) if below else name, node))
            return found[-1][0]
        if isinstance(node, s.Comprehension):
            indices += tuple(name for clause in node.clauses for name in clause.targets)
        return mapped(node, partial(go, indices=indices))

    inner = go(expr)
    if len(found) == 1:  # one draw needs no number
        name, draw = found[0]
        return Drawn(renamed(inner, f"{prefix}_1", prefix), ((renamed(name, f"{prefix}_1", prefix), draw),))
    return Drawn(inner, tuple(found))
