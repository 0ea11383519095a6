"""Counts that nothing tells apart from some count on: where `min`, a comparison, or several of them, are all that they meet."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Draw, Node, children, draws, walk
from taskspec.lang.types import INT, Kind
from taskspec.lang.variates.counts import poisson_terms

Users = dict[int, list[Node]]
"""The nodes that use a node, by its id."""


def users_of(roots: Sequence[Node]) -> Users:
    """Who uses each node; a root is used by what is not below the roots, for which the root itself stands."""
    users: Users = defaultdict(list)
    for node in walk(roots):
        for child in dict.fromkeys(children(node)):
            users[id(child)].append(node)
    for root in roots:
        users[id(root)].append(root)
    return users


def capped(roots: Sequence[Node], builder: Builder) -> dict[int, Node]:
    """Poisson draws, by id, as draws of fewer outcomes: all counts from some on are one."""
    users, made = users_of(roots), {}
    for draw in draws(roots):
        if draw.base == "poisson":
            most = max(0, _enough(draw, 1, users, builder))
            if most + 1 < poisson_terms(draw.args[-1]):
                args = (*draw.args, builder.const(math.ceil(most), INT))
                made[id(draw)] = builder.remake(Draw("capped", (), draw.type, draw.site), args)
    return made


def _enough(node: Node, sign: int, users: Users, builder: Builder) -> float:
    """Where a whole number times the sign has reached this, all that is made of it stays the same; infinite where it may not."""
    return max(_enough_for(node, sign, user, users, builder) for user in users[id(node)])


def _enough_for(node: Node, sign: int, user: Node, users: Users, builder: Builder) -> float:
    if not isinstance(user, Apply) or user is node or Kind.REAL in {a.type.kind for a in (user, *user.args)}:
        return math.inf
    first = user.args[0] is node
    ends = builder.bounds(user.args[-1] if first else user.args[0])
    far = ends[1] if sign > 0 else -ends[0]  # how far the other argument gets the same way
    match user.op:
        case "min2" | "max2" if (user.op == "min2") == (sign > 0):
            return far
        case "min2" | "max2" | "element" | "slice":
            return _enough(user, sign, users, builder)
        case "add":
            return _enough(user, sign, users, builder) + (-ends[0] if sign > 0 else ends[1])
        case "sub" if first:
            return _enough(user, sign, users, builder) + far
        case "sub":
            return _enough(user, -sign, users, builder) + far
        case "lt" | "le" | "eq" | "ne":
            return far + 1
        case _:
            return math.inf
