"""Draws with merged outcomes, and counts that are capped, where a task cannot tell the difference.

Conditions that are only counted are one draw of the count, so that a sum of n of them has n + 1 outcomes and not 2**n; of a
permutation, places that nothing reads and values that everything treats alike are left open; counts of events beyond what
anything can tell apart, as in `min(Poisson(3), 5)`, are one. The joint distribution of the roots is the same.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.expressions.batch import array, evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, children, draws, rewrite, walk
from taskspec.language.expressions.operators import OPERATORS, entry_of
from taskspec.language.expressions.types import INT, Kind, Type
from taskspec.language.expressions.variates.quantities import poisson_terms

Users = dict[int, list[Node]]
"""The nodes that use a node, by its id; a root is used by itself, for what is not below the roots."""


def lumped(roots: Iterable[Node], builder: Builder) -> tuple[Node, ...]:
    """Return roots of the same joint distribution, whose draws have fewer outcomes where that is plain to see."""
    roots = tuple(roots)
    if not any(d.base in ("bernoulli", "permutation", "poisson") for d in draws(roots)):
        return roots
    roots = _replaced(roots, _capped(roots, _users_of(roots), builder), builder)
    while made := _counted(roots, _users_of(roots), builder):
        roots = _replaced(roots, made, builder)
    return _replaced(roots, _permuted(roots, _users_of(roots), builder), builder)


def _replaced(roots: tuple[Node, ...], made: dict[int, Node], builder: Builder) -> tuple[Node, ...]:
    if made:
        return rewrite(roots, made, builder.remake)
    return roots


def _users_of(roots: Sequence[Node]) -> Users:
    users: Users = defaultdict(list)
    for node in walk(roots):
        for child in dict.fromkeys(children(node)):
            users[id(child)].append(node)
    for root in roots:
        users[id(root)].append(root)
    return users


# -- counts, where `min`, comparisons, or several of them, are all that they meet -----------------------------------------


def _capped(roots: Sequence[Node], users: Users, builder: Builder) -> dict[int, Node]:
    """Return Poisson draws, by id, as draws of fewer outcomes: all counts from some on are one."""
    made = {}
    for draw in draws(roots):
        if draw.base == "poisson":
            most = max(0, _enough(draw, 1, users, builder))
            if most + 1 < poisson_terms(draw.args[-1]):
                args = (*draw.args, builder.const(math.ceil(most), INT))
                made[id(draw)] = builder.remake(Draw("capped", (), draw.type, draw.site), args)
    return made


def _enough(node: Node, sign: int, users: Users, builder: Builder) -> float:
    """Return the value of an int times the sign from which on its users' values stay the same; infinite if there is none."""
    return max(_enough_for(node, sign, user, users, builder) for user in users[id(node)])


def _enough_for(node: Node, sign: int, user: Node, users: Users, builder: Builder) -> float:
    if not isinstance(user, Apply) or user is node or Kind.REAL in {a.type.kind for a in (user, *user.args)}:
        return math.inf
    first = user.args[0] is node
    low, high = builder.bounds(user.args[-1] if first else user.args[0])
    if sign > 0:  # how far the other argument gets the same way
        far = high
    else:
        far = -low
    match user.op:
        case "min2" | "max2" if (user.op == "min2") == (sign > 0):
            return far
        case "min2" | "max2" | "element" | "slice":
            return _enough(user, sign, users, builder)
        case "add":
            return _enough(user, sign, users, builder) + (-low if sign > 0 else high)
        case "sub":
            return _enough(user, sign if first else -sign, users, builder) + far
        case "lt" | "le" | "eq" | "ne":
            return far + 1
    return math.inf


# -- conditions that are counted --------------------------------------------------------------------------------------


def _counted(roots: Sequence[Node], users: Users, builder: Builder) -> dict[int, Node]:
    """Return reductions of conditions, by id, as functions of one draw of how many hold; one within another waits."""
    made: dict[int, Node] = {}
    for node in walk(roots):
        if node.type.kind is not Kind.BOOL or len(node.type.shape) != 1 or node.type.size < 2:
            continue
        reductions = _reductions(node, users)
        if not reductions or any(id(n) in made for n in walk([node])):
            continue
        total = _total(node, users, builder)
        if total is None:
            continue
        for reduction in reductions:
            from_count = entry_of(reduction.op).from_count
            assert from_count is not None
            made[id(reduction)] = builder.cast(from_count(builder, total, node.type.size), reduction.type.kind)
    return made


def _reductions(flags: Node, users: Users) -> list[Apply]:
    reductions: list[Apply] = []
    for user in users[id(flags)]:
        if not isinstance(user, Apply) or user is flags:
            return []
        below = [user]
        if user.op in ("to_int", "to_real"):
            below = _reductions(user, users)
        elif entry_of(user.op).from_count is None:
            return []
        if not below:
            return []
        reductions += below
    return reductions


def _total(flags: Node, users: Users, builder: Builder) -> Node | None:
    """Return a draw of how many of some conditions hold, if some have a draw each that nothing else uses.

    Its arguments are the probabilities of these draws, and the conditions with all of them true, and with all of them false. It
    has the last of their sites, so that everything else that decides the conditions is drawn before.
    """
    is_vector = isinstance(flags, Apply) and flags.op == "vector"
    parts: tuple[Node, ...] = (flags,)
    above = set(map(id, users[id(flags)]))
    if isinstance(flags, Apply) and is_vector:
        parts = flags.args
        above = {id(flags)}
    own = [_only(part, above, users) for part in parts]
    counted = [d for d in own if d is not None]
    if not counted or len(set(map(id, counted))) < len(counted) or (is_vector and len(counted) < 2):
        return None
    if not is_vector and not _is_elementwise(flags, counted[0]):
        return None
    never = builder.const(0, Type(Kind.REAL))
    rows = [[never if d is None else d.args[0] for d in own]]
    for value in (True, False):
        rows.append([_given(p, d, value, builder) for p, d in zip(parts, own, strict=True)])
    args = [builder.structure("vector", row) if is_vector else row[0] for row in rows]
    args[0] = builder.stretch(args[0], flags.type.shape)
    site = max(d.site for d in counted)
    if any(d.site >= site for d in draws(args)):
        return None
    return builder.remake(Draw("total", (), INT, site), tuple(args))


def _only(root: Node, above: set[int], users: Users) -> Draw | None:
    """Return the one Bernoulli draw of the root's shape that only the root uses, if only the nodes above use the root."""
    if set(map(id, users[id(root)])) != above:
        return None
    below = set(map(id, walk([root])))
    own = []
    for draw in draws([root]):
        if draw.base == "bernoulli" and draw.type.shape == root.type.shape and _is_inside(draw, root, below, users):
            own.append(draw)
    if len(own) == 1:
        return own[0]
    return None


def _is_inside(node: Node, root: Node, below: set[int], users: Users) -> bool:
    if node is root:
        return True
    return all(id(u) in below and u is not node and _is_inside(u, root, below, users) for u in users[id(node)])


def _is_elementwise(root: Node, draw: Draw) -> bool:
    depends = {id(draw)}
    for node in walk([root]):
        if any(id(c) in depends for c in children(node)):
            if not isinstance(node, Apply) or node.op not in OPERATORS or not OPERATORS[node.op].elementwise:
                return False
            depends.add(id(node))
    return True


def _given(root: Node, draw: Draw | None, value: bool, builder: Builder) -> Node:
    if draw is None:
        return root
    known = builder.stretch(builder.scalar(value), draw.type.shape)
    return rewrite([root], {id(draw): known}, builder.remake)[0]


# -- permutations -----------------------------------------------------------------------------------------------------


def _permuted(roots: Sequence[Node], users: Users, builder: Builder) -> dict[int, Node]:
    made = {}
    for draw in draws(roots):
        if draw.base == "permutation" and len(draw.type.shape) == 1:
            n = draw.type.size
            looks = list(_looks(draw, np.arange(n), users))
            places = np.unique(np.concatenate([place.ravel() for _, place in looks]))
            alike = _alike(n, [node for node, _ in looks])
            if len(places) < n - 1 or len(set(alike)) < n:
                args = (builder.const(alike, draw.type), builder.const(places.tolist(), Type(Kind.INT, places.shape)))
                made[id(draw)] = builder.remake(Draw("arrangement", (), draw.type, draw.site), args)
    return made


def _looks(node: Node, places: Array, users: Users) -> Iterator[tuple[Node, Array]]:
    onwards = []
    for user in users[id(node)]:
        further = _onwards(node, user, places)
        if further is None:
            yield node, places
            return
        onwards.append((user, further))
    for user, further in onwards:
        yield from _looks(user, further, users)


def _onwards(node: Node, user: Node, places: Array) -> Array | None:
    """Return the places of the elements that a user is made of, each by itself; None if it is not."""
    if not isinstance(user, Apply) or user is node:
        return None
    if user.op in OPERATORS and OPERATORS[user.op].elementwise:
        others = [a for a in user.args if a is not node]
        is_alone = all(isinstance(a, Const) and a.type.is_scalar for a in others)
        if is_alone and user.type.shape == node.type.shape:
            return places
        return None
    match user.op, user.static:
        case "element", (i,):
            return np.asarray(places[i])
        case "slice", (start, count, step):
            return places[start + step * np.arange(count)]
        case "index", _ if user.args[0] is node and isinstance(user.args[1], Const):
            return np.asarray(places[array(user.args[1])[..., 0]])
    return None


def _alike(n: int, looks: Sequence[Node]) -> list[int]:
    everywhere = np.broadcast_to(np.arange(n), (n, n))  # in point j, each element is j
    values = evaluate(looks, {}, lambda _, __: everywhere)
    columns = np.stack([v.reshape(-1, n)[0].astype(np.float64) for v in values])
    first: dict[bytes, int] = {}
    return [first.setdefault(column.tobytes(), i) for i, column in enumerate(np.ascontiguousarray(columns.T))]
