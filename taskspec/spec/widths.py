"""Ints that fit: a state int without bounds saturates, and an expression that may leave 64 bits is refused.

Python's ints are endless and those of array backends are not; without this, the same task would mean different things.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from taskspec.lang import interval
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Draw, Node, Read, children, walk
from taskspec.lang.types import INT_MAX, INT_WIDEST, Kind
from taskspec.spec.reach import reach
from taskspec.spec.task import Component

_SATURATING = ("floor", "ceil", "round")


def saturated(
    builder: Builder,
    state: Sequence[Component],
    initial: Sequence[Node],
    following: Sequence[Node],
    horizon: int | None,
) -> list[Node]:
    """Next states in which ints without bounds stop at +-(2**31 - 1), where they could get further within the horizon."""
    reached = reach(state, initial, following, horizon)
    return [
        _stopped(builder, node) if _may_grow(c, reached[c.name]) else node
        for c, node in zip(state, following, strict=True)
    ]


def _may_grow(c: Component, edge: interval.Interval) -> bool:
    endless = min(c.low) == -interval.INF or max(c.high) == interval.INF
    return c.type.kind is Kind.INT and endless and not (edge[0] >= -INT_MAX and edge[1] <= INT_MAX)


def _stopped(builder: Builder, node: Node) -> Node:
    least, most = builder.scalar(-INT_MAX), builder.scalar(INT_MAX)
    return builder.apply("min2", builder.apply("max2", node, least), most)


def widest(
    roots: Iterable[Node], limit: int = INT_WIDEST, reads: Mapping[int, interval.Interval] | None = None
) -> float:
    """The largest magnitude that some int below the roots may have, where it is beyond a limit; else 0.

    `reads` says more of some reads, by id, than their declarations do.
    """
    known: dict[int, interval.Interval] = {}
    for node in walk(roots):
        low, high = (reads or {}).get(id(node)) or interval.step(node, [known[id(c)] for c in children(node)])
        if node.type.kind is Kind.INT:
            if isinstance(node, Read | Draw) or (isinstance(node, Apply) and node.op in _SATURATING):
                low = max(low, -INT_MAX) if low == -interval.INF else low
                high = min(high, INT_MAX) if high == interval.INF else high
            most = max(-low, high)
            if limit < most < interval.INF:
                return float(most)
        known[id(node)] = (low, high)
    return 0.0
