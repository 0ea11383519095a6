"""Draws with merged outcomes, and counts that are capped, where a task cannot tell the difference."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.batch import array, evaluate
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, children, draws, rewrite, walk
from taskspec.lang.operators import OPERATORS, entry_of
from taskspec.lang.types import INT, Kind, Type
from taskspec.lang.variates.quantities import poisson_terms

# Counts that nothing tells apart from some count on: where `min`, a comparison, or several of them, are all that they meet.

Users = dict[int, list[Node]]
"""The nodes that use a node, by its id."""


def users_of(roots: Sequence[Node]) -> Users:
    """Return who uses each node; a root is used by what is not below the roots, for which the root itself stands."""
    users: Users = defaultdict(list)
    for node in walk(roots):
        for child in dict.fromkeys(children(node)):
            users[id(child)].append(node)
    for root in roots:
        users[id(root)].append(root)
    return users


def capped(roots: Sequence[Node], builder: Builder) -> dict[int, Node]:
    """Poisson draws, by id, as draws of fewer outcomes: all counts from some on are one."""
    users = users_of(roots)
    made = {}
    for draw in draws(roots):
        if draw.base == "poisson":
            most = max(0, _enough(draw, 1, users, builder))
            if most + 1 < poisson_terms(draw.args[-1]):
                args = (*draw.args, builder.const(math.ceil(most), INT))
                made[id(draw)] = builder.remake(Draw("capped", (), draw.type, draw.site), args)
    return made


def _enough(node: Node, sign: int, users: Users, builder: Builder) -> float:
    """Return where a whole number times the sign has reached this, all that is made of it stays the same; infinite where
    it may not.
    """
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


# Draws with fewer outcomes in place of those whose outcomes nothing tells apart.
#
# Conditions that are only counted are one draw of the count, so that a sum of n of them has n + 1 outcomes and not 2**n; of a
# permutation, places that nothing looks at and values that everything treats alike are left open; counts of events beyond what
# anything can tell apart, as in `min(Poisson(3), 5)`, are one. The distribution of
# the roots is the same, and every place that lists outcomes lists those of the lumped roots.


def lumped(roots: Iterable[Node], builder: Builder) -> tuple[Node, ...]:
    """Roots of the same joint distribution, whose draws have fewer outcomes where that is plain to see."""
    roots = tuple(roots)
    if not any(d.base in ("bernoulli", "permutation", "poisson") for d in draws(roots)):
        return roots
    roots = _replaced(roots, capped(roots, builder), builder)
    while made := _counted(roots, builder):
        roots = _replaced(roots, made, builder)
    return _replaced(roots, _permuted(roots, builder), builder)


def _replaced(roots: tuple[Node, ...], made: dict[int, Node], builder: Builder) -> tuple[Node, ...]:
    return rewrite(roots, lambda node: made.get(id(node)), builder.remake) if made else roots


# -- conditions that are counted ----------------------------------------------------------------------------------


def _counted(roots: Sequence[Node], builder: Builder) -> dict[int, Node]:
    """Reductions of conditions, by id, as functions of one draw of how many hold; one within another waits for the next time."""
    users = users_of(roots)
    made: dict[int, Node] = {}
    for node in walk(roots):
        if node.type.kind is not Kind.BOOL or len(node.type.shape) != 1 or node.type.size < 2:
            continue
        reductions = _reductions(node, users)
        if reductions is None or any(id(n) in made for n in walk([node])):
            continue
        total = _total(node, users, builder)
        if total is not None:
            made.update((id(r), _reduced(r, total, node.type.size, builder)) for r in reductions)
    return made


def _reductions(flags: Node, users: Users) -> list[Apply] | None:
    """Return what makes one value of a vector of conditions, if nothing else uses it."""
    found = []
    for user in users[id(flags)]:
        if not isinstance(user, Apply) or user is flags:
            return None
        if user.op in ("to_int", "to_real"):
            below = _reductions(user, users)
            if below is None:
                return None
            found += below
        elif entry_of(user.op).from_count is not None:
            found.append(user)
        else:
            return None
    return found or None


def _total(flags: Node, users: Users, builder: Builder) -> Node | None:
    """Return a draw of how many of some conditions hold, if some have a draw each that nothing else uses.

    Its arguments are the chances of these draws, and the conditions with all of them true, and with all of them false. It has the
    last of their sites, so that whatever else decides the conditions is drawn before.
    """
    single = isinstance(flags, Apply) and flags.op == "vector"
    parts = flags.args if isinstance(flags, Apply) and single else (flags,)
    above = {id(flags)} if single else {id(u) for u in users[id(flags)]}
    own = [_only(part, above, users) for part in parts]
    found = {id(d): d for d in own if d is not None}
    if not found or len(found) < sum(d is not None for d in own) or (single and len(found) < 2):
        return None
    if not single and not _is_elementwise(flags, *found.values()):
        return None
    arranged = (lambda nodes: builder.structure("vector", nodes)) if single else (lambda nodes: nodes[0])
    never = builder.const(0, Type(Kind.REAL))
    chances = builder.stretch(arranged([never if d is None else d.args[0] for d in own]), flags.type.shape)
    ends = [arranged([_given(p, d, v, builder) for p, d in zip(parts, own, strict=True)]) for v in (True, False)]
    site = max(d.site for d in found.values())
    if any(d.site >= site for d in draws((chances, *ends))):
        return None
    return builder.remake(Draw("total", (), INT, site), (chances, *ends))


def _only(root: Node, above: set[int], users: Users) -> Draw | None:
    """Return the one Bernoulli draw of its own shape that nothing but a root uses, which nothing but what is above it
    uses.
    """
    if {id(u) for u in users[id(root)]} != above:
        return None
    below = {id(n) for n in walk([root])}
    found = [d for d in draws([root]) if d.base == "bernoulli" and d.type.shape == root.type.shape]
    own = [d for d in found if _is_inside(d, root, below, users)]
    return own[0] if len(own) == 1 else None


def _is_inside(draw: Draw, root: Node, below: set[int], users: Users) -> bool:
    """Return whether every use of a draw is one by the root."""
    waiting = [draw]
    seen = set()
    while waiting:
        node: Node = waiting.pop()
        if node is root or id(node) in seen:
            continue
        seen.add(id(node))
        if any(id(u) not in below or u is node for u in users[id(node)]):
            return False
        waiting += users[id(node)]  # type: ignore[arg-type]
    return True


def _is_elementwise(root: Node, draw: Draw) -> bool:
    """Return whether element i of the root depends on element i of the draw alone."""
    depends = {id(draw)}
    for node in walk([root]):
        if any(id(c) in depends for c in children(node)):
            if not isinstance(node, Apply) or node.op not in OPERATORS or not OPERATORS[node.op].elementwise:
                return False
            depends.add(id(node))
    return True


def _given(root: Node, draw: Draw | None, value: bool, builder: Builder) -> Node:
    """Return the root where a draw came out like this everywhere."""
    if draw is None:
        return root
    known = builder.stretch(builder.scalar(value), draw.type.shape)
    return rewrite([root], lambda node: known if node is draw else None, builder.remake)[0]


def _reduced(reduction: Apply, total: Node, size: int, builder: Builder) -> Node:
    """Return a reduction of conditions from how many of them hold."""
    from_count = entry_of(reduction.op).from_count
    assert from_count is not None
    return builder.cast(from_count(builder, total, size), reduction.type.kind)


# -- permutations of which little matters -------------------------------------------------------------------------


def _permuted(roots: Sequence[Node], builder: Builder) -> dict[int, Node]:
    """Permutations, by id, as arrangements of what is told apart in the places that are looked at."""
    users = users_of(roots)
    made = {}
    for draw in draws(roots):
        if draw.base == "permutation" and len(draw.type.shape) == 1:
            n = draw.type.size
            looks = list(_looks(draw, np.arange(n), users))
            places = np.unique(np.concatenate([place.ravel() for _, place in looks]))
            alike = _alike(draw, [node for node, _ in looks])
            if len(places) < n - 1 or len(set(alike)) < n:
                args = (builder.const(alike, draw.type), builder.const(places.tolist(), Type(Kind.INT, places.shape)))
                made[id(draw)] = builder.remake(Draw("arrangement", (), draw.type, draw.site), args)
    return made


def _looks(node: Node, places: Array, users: Users) -> Iterator[tuple[Node, Array]]:
    """Yield the functions of single elements of a permutation that the rest is made of, with the places that each is of."""
    onwards = [_onwards(node, user, places) for user in users[id(node)]]
    if any(found is None for found in onwards):
        yield node, places
        return
    for found in onwards:
        assert found is not None
        yield from _looks(*found, users)


def _onwards(node: Node, user: Node, places: Array) -> tuple[Node, Array] | None:
    """Return a user that is made of the same elements, or of some of them, each by itself; with their places."""
    if not isinstance(user, Apply) or user is node:
        return None
    if user.op in OPERATORS and OPERATORS[user.op].elementwise:
        others = [a for a in user.args if a is not node]
        alone = all(isinstance(a, Const) and a.type.is_scalar for a in others)
        return (user, places) if alone and user.type.shape == node.type.shape else None
    match user.op, user.static:
        case "element", (i,):
            return user, places[i]
        case "slice", (start, count, step):
            return user, places[start + step * np.arange(count)]
        case "index", _ if user.args[0] is node and isinstance(user.args[1], Const):
            return user, places[array(user.args[1])[..., 0]]
        case _:
            return None


def _alike(draw: Draw, looks: Sequence[Node]) -> list[int]:
    """For each value, the least one that comes out the same wherever it is looked at."""
    n = draw.type.size
    everywhere = np.broadcast_to(np.arange(n), (n, n))  # in point j, each element is j
    found = evaluate(looks, {}, lambda _, __: everywhere)
    columns = np.stack([v.reshape(-1, n)[0].astype(np.float64) for v in found])
    first: dict[bytes, int] = {}
    return [first.setdefault(column.tobytes(), i) for i, column in enumerate(np.ascontiguousarray(columns.T))]
