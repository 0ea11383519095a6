"""How far each state component can get within the horizon, by interval reasoning step after step.

A space such as Z^2 is endless, but thirty steps from a bounded start do not leave a box; observation spaces use that box.
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence

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
    still, moving = _apart(following, declared)

    def step(reached: dict[str, Interval]) -> dict[str, Interval]:
        known = still.copy()
        for node in moving:
            known[id(node)] = Range(*reached[node.name]) if isinstance(node, Read) else _range(node, known)
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


def _apart(roots: Sequence[Node], state: Container[str]) -> tuple[dict[int, Range], list[Node]]:
    """What is known, by id, of the nodes that do not depend on the state; and the others, in order, which change."""
    still: dict[int, Range] = {}
    moving: list[Node] = []
    for node in walk(roots):
        of_state = isinstance(node, Read) and node.role is Role.STATE and node.name in state
        if of_state or any(id(c) not in still for c in children(node)):
            moving.append(node)
        else:
            still[id(node)] = _range(node, still)
    return still, moving


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
