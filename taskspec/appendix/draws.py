"""Expressions that draw, taken apart the way people write them: `g = p + ξ, ξ ~ Unif{...}`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from taskspec.lang import syntax as s
from taskspec.lang.dists import is_distribution


@dataclass(frozen=True, slots=True)
class Drawn:
    """An expression whose inner draws have names, and those draws."""

    expr: s.Expr
    draws: tuple[tuple[str, s.Expr], ...]


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
    found: list[tuple[str, s.Expr]] = []

    def go(node: Any) -> Any:
        if isinstance(node, tuple):
            return tuple(go(x) for x in node)
        if isinstance(node, s.Place) or not dataclasses.is_dataclass(node) or isinstance(node, type):
            return node
        if isinstance(node, s.Call) and is_distribution(node.function) and not shows_chances(node):
            name = f"{prefix}_{len(found) + 1}"
            found.append((name, node))
            return s.Name(name, False, node.place)
        return dataclasses.replace(node, **{f.name: go(getattr(node, f.name)) for f in dataclasses.fields(node)})

    inner = go(expr)
    if len(found) == 1:  # one draw needs no number
        alone = found[0][1]
        found.clear()
        return Drawn(_rename(inner, f"{prefix}_1", prefix), ((prefix, alone),))
    return Drawn(inner, tuple(found))


def _rename(node: Any, old: str, new: str) -> Any:
    match node:
        case tuple():
            return tuple(_rename(x, old, new) for x in node)
        case s.Name(id=name) if name == old:
            return dataclasses.replace(node, id=new)
        case s.Place():
            return node
        case _ if dataclasses.is_dataclass(node) and not isinstance(node, type):
            changes = {f.name: _rename(getattr(node, f.name), old, new) for f in dataclasses.fields(node)}
            return dataclasses.replace(node, **changes)
        case _:
            return node
