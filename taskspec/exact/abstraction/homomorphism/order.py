"""What depends on the order of a vector's elements alone, shown from the form of expressions.

Let h be any increasing function, applied to every element of a vector of reals. An expression is *invariant* when it has
the same value for x and for h(x), and a *selection* when its value for h(x) is h of its value for x: elements of x,
chosen by their order. A selection that has every element of x once is a *rearrangement*. Ranks are such an h, as long
as no two elements are equal; so what is invariant depends on the ranks alone.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence

from taskspec.lang.ir import Apply, Draw, Node, Read, Role, children, walk
from taskspec.lang.types import Kind


class How(enum.IntEnum):
    """How an expression depends on the order of the elements; the larger, the closer to the vector itself."""

    INVARIANT = 0
    SELECTION = 1
    REARRANGEMENT = 2


_CHOOSING = frozenset({"sort", "swap", "put", "index", "element", "slice", "concat", "vector", "reshape", "fill",
                       "min", "max", "min2", "max2", "where"})  # fmt: skip
_RANKING = frozenset({"argsort", "argmin", "argmax", "eq", "ne", "lt", "le"})
_INDICES = {"swap": (1, 2), "put": (1,), "index": (1,), "where": (0,)}
"""Arguments that choose, and are no elements themselves."""


def dependence(roots: Sequence[Node], name: str) -> list[How | None]:
    """How expressions depend on a state component, a vector of reals; None where it is none of these ways."""
    found: dict[int, How | None] = {}
    for node in walk(roots):
        found[id(node)] = _of(node, [found[id(c)] for c in children(node)], name)
    return [found[id(root)] for root in roots]


def _of(node: Node, args: list[How | None], name: str) -> How | None:
    match node:
        case Read(role=Role.STATE, name=read):
            return How.REARRANGEMENT if read == name else How.INVARIANT
        case Draw() if any(a is not How.INVARIANT for a in args):
            return None
        case Apply(op=op) if any(a is not How.INVARIANT for a in args):
            return None if None in args else _chosen(node, op, [a for a in args if a is not None])
        case _:
            return How.INVARIANT


def _chosen(node: Apply, op: str, args: list[How]) -> How | None:
    """Of an operator with some argument that is a selection."""
    indices = _INDICES.get(op, ())
    elements = [a for i, a in enumerate(args) if i not in indices]
    if any(args[i] is not How.INVARIANT for i in indices) or How.INVARIANT in elements:
        return None  # an element compared with, or mixed with, something that is none
    if op in _RANKING:
        return How.INVARIANT
    if op not in _CHOOSING or node.type.kind is not Kind.REAL:
        return None
    whole = min(elements) is How.REARRANGEMENT
    return How.REARRANGEMENT if whole and _keeps_all(node) else How.SELECTION


def _keeps_all(node: Apply) -> bool:
    """Whether the operator keeps every element of its arguments, which have them all."""
    match node:
        case Apply(op="sort" | "swap"):
            return True
        case Apply(op="slice", static=(start, count, -1)):
            return start == count - 1 and count == node.args[0].type.shape[0]
        case Apply(op="where", args=(condition, *_)):
            return condition.type.is_scalar
        case _:
            return False
