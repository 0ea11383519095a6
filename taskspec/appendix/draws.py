"""Expressions that draw, taken apart the way people write them: `g = p + ξ, ξ ~ Unif{...}`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from taskspec.lang import syntax as s
from taskspec.lang.dists import is_distribution
from taskspec.printers.elements import renamed


@dataclass(frozen=True, slots=True)
class Drawn:
    """An expression whose inner draws have names, and those draws: what stands for each, and what it is drawn from.

    A draw in a comprehension is made for each of its elements, and has their index: `xi[i]`.
    """

    expr: s.Expr
    draws: tuple[tuple[s.Name | s.Subscript, s.Expr], ...]


def is_draw(expr: s.Expr) -> bool:
    """Whether an expression is a distribution as a whole."""
    return isinstance(expr, s.Weights) or (isinstance(expr, s.Call) and is_distribution(expr.function))


def shows_chances(expr: s.Expr) -> bool:
    """Whether an expression is printed as cases with probabilities, which need no name."""
    return isinstance(expr, s.Weights) or (
        isinstance(expr, s.Call) and expr.function == "Categorical" and any(isinstance(a, s.Weights) for a in expr.args)
    )


def take_apart(expr: s.Expr, prefix: str = "xi") -> Drawn:
    """Names for the draws inside an expression, in written order."""
    found: list[tuple[s.Name | s.Subscript, s.Expr]] = []

    def go(node: Any, indices: tuple[str, ...] = ()) -> Any:
        if isinstance(node, tuple):
            return tuple(go(x, indices) for x in node)
        if isinstance(node, s.Place) or not dataclasses.is_dataclass(node) or isinstance(node, type):
            return node
        if isinstance(node, s.Call) and is_distribution(node.function) and not shows_chances(node):
            name = s.Name(f"{prefix}_{len(found) + 1}", False, node.place)
            below = tuple(s.Name(i, False, node.place) for i in indices)
            found.append((s.Subscript(name, below, node.place) if below else name, node))
            return found[-1][0]
        if isinstance(node, s.Comprehension):
            indices = (*indices, *(name for clause in node.clauses for name in clause.targets))
        return dataclasses.replace(
            node, **{f.name: go(getattr(node, f.name), indices) for f in dataclasses.fields(node)}
        )

    inner = go(expr)
    if len(found) == 1:  # one draw needs no number
        ((name, alone),) = found
        return Drawn(renamed(inner, f"{prefix}_1", prefix), ((renamed(name, f"{prefix}_1", prefix), alone),))
    return Drawn(inner, tuple(found))
