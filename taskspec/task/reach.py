"""How far each state component can get within the horizon, by interval reasoning step after step.

A space such as Z^2 is endless, but thirty steps from a bounded start do not leave a box; observation spaces use that box.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence

from taskspec.lang import interval
from taskspec.lang.interval import bounds
from taskspec.lang.ir import Node, Read, Role, children, walk
from taskspec.lang.ranges import INF, Interval, Range
from taskspec.task.task import Component

MAX_STEPS = 256


def reach(
    state: Sequence[Component],
    initial: Sequence[Node],
    following: Sequence[Node],
    horizon: int | None,
) -> dict[str, Interval]:
    """An interval for every component that holds all its elements at every time of an episode.

    Components that are declared with bounds keep them. Without a horizon, or with one of more than MAX_STEPS steps, what
    has not settled by then may be anything.
    """
    declared = {c.name: (c.least, c.most) for c in state}
    if all(map(math.isfinite, (v for edge in declared.values() for v in edge))):
        return declared
    return reached(state, initial, following, horizon)


def reached(
    state: Sequence[Component],
    initial: Sequence[Node],
    following: Sequence[Node],
    horizon: int | None,
) -> dict[str, Interval]:
    """As `reach`, with what is known of components that are declared with bounds too: never wider than declared."""
    declared = {c.name: (c.least, c.most) for c in state}
    first: dict[int, Range] = {}
    found = {c.name: _within(bounds(n, first), declared[c.name]) for c, n in zip(state, initial, strict=True)}
    widening = _Widening(following, declared)

    def step(reached: dict[str, Interval]) -> dict[str, Interval]:
        known = widening.from_(reached)
        nexts = (_within(known[id(node)][:2], declared[c.name]) for c, node in zip(state, following, strict=True))
        return {c.name: _union(reached[c.name], edge) for c, edge in zip(state, nexts, strict=True)}

    for _ in range(MAX_STEPS if horizon is None else min(horizon, MAX_STEPS)):
        wider = step(found)
        if wider == found:
            return found
        found = wider
    if horizon is not None and horizon <= MAX_STEPS:
        return found
    while (wider := step(found)) != found:  # what still moves may go anywhere
        found = {name: edge if wider[name] == edge else declared[name] for name, edge in found.items()}
    return found


class _Widening:
    """What is known of nodes while what is known of the state changes: only what has changed is worked out again."""

    def __init__(self, roots: Sequence[Node], state: Container[str]) -> None:
        self.known: dict[int, Range] = {}
        self.moving: list[tuple[Node, tuple[int, ...]]] = []
        """The nodes that depend on the state, arguments first, with the ids of their arguments."""
        moving: set[int] = set()
        for node in walk(roots):
            args = tuple(id(c) for c in children(node))
            of_state = isinstance(node, Read) and node.role is Role.STATE and node.name in state
            if of_state or not moving.isdisjoint(args):
                moving.add(id(node))
                self.moving.append((node, args))
            else:
                self.known[id(node)] = _range(node, self.known)

    def from_(self, reached: Mapping[str, Interval]) -> Mapping[int, Range]:
        """What is known of the nodes, by id, where components are within these intervals."""
        known, changed = self.known, set[int]()
        for node, args in self.moving:
            if isinstance(node, Read):
                found = Range(*reached[node.name])
            elif id(node) in known and changed.isdisjoint(args):
                continue
            else:
                found = _range(node, known)
            if known.get(id(node)) != found:
                known[id(node)] = found
                changed.add(id(node))
        return known


def _range(node: Node, known: dict[int, Range]) -> Range:
    return interval.step(node, [known[id(c)] for c in children(node)])


def over(roots: Sequence[Node], reached: dict[str, Interval]) -> dict[int, Range]:
    """What is known of the state reads below some nodes, for `interval.bounds`."""
    reads = (n for n in walk(roots) if isinstance(n, Read) and n.role is Role.STATE)
    return {id(n): Range(*reached[n.name]) for n in reads if n.name in reached}


def _within(edge: Interval, declared: Interval) -> Interval:
    return max(edge[0], declared[0]), min(edge[1], declared[1])


def _union(a: Interval, b: Interval) -> Interval:
    return min(a[0], b[0]), max(a[1], b[1])


def finite(edge: Interval) -> bool:
    return edge[0] > -INF and edge[1] < INF
