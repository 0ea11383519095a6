"""Ints that fit: a state int keeps to its range, and an expression that may leave 64 bits is refused.

Python's ints are endless and those of array backends are not; without this, the same task would mean different things. And
what reads a state may rely on its range: indices that it keeps in a vector are not looked at again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from taskspec.diagnostics import Collector, Placed
from taskspec.lang import interval
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Draw, Node, Read, Role, children, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.ranges import INF, Args, Interval, Range
from taskspec.lang.types import INT_MAX, INT_WIDEST, Kind
from taskspec.task.reach import reach
from taskspec.task.task import Component

Rule = Callable[[Node, Args], Range]


def kept(builder: Builder, c: Component, node: Node) -> Node:
    """A value of a state component, moved to the nearest end of its range if it might leave it. Of ints only."""
    if c.type.kind is not Kind.INT or not c.type.size or (isinstance(node, Read) and (node.role, node.name) == c.read):
        return node
    if len(set(c.low)) == len(set(c.high)) == 1:
        return builder.within(node, c.low[0], c.high[0])
    least, most = builder.certain(node)
    if least < max(c.low):
        node = builder.apply("max2", node, _each(builder, c.low, c))
    return builder.apply("min2", node, _each(builder, c.high, c)) if most > min(c.high) else node


def _each(builder: Builder, ends: Sequence[float], c: Component) -> Node:
    return builder.const([int(min(max(v, -INT_WIDEST), INT_WIDEST)) for v in ends], c.type)


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
        builder.within(node, -INT_MAX, INT_MAX) if _may_grow(c, reached[c.name]) else node
        for c, node in zip(state, following, strict=True)
    ]


def _may_grow(c: Component, edge: Interval) -> bool:
    endless = c.least == -INF or c.most == INF
    return c.type.kind is Kind.INT and endless and not (edge[0] >= -INT_MAX and edge[1] <= INT_MAX)


def widest(
    roots: Iterable[Node], limit: int = INT_WIDEST, reads: Mapping[int, Range] | None = None, step: Rule = interval.step
) -> float:
    """The largest magnitude that some int below the roots may have, where it is beyond a limit; else 0.

    `reads` says more of some reads, by id, than their declarations do; `step` is the arithmetic, such as that of single floats.
    """
    known: dict[int, Range] = {}
    for node in walk(roots):
        low, high, finite = (reads or {}).get(id(node)) or step(node, [known[id(c)] for c in children(node)])
        if node.type.kind is Kind.INT:
            if isinstance(node, Read | Draw) or (
                isinstance(node, Apply) and node.op in OPERATORS and OPERATORS[node.op].rounds
            ):
                low = max(low, -INT_MAX) if low == -INF else low
                is_time = isinstance(node, Read) and node.role is Role.TIME  # of which one more is observed
                high = INT_MAX - is_time if high == INF else high
            most = max(-low, high)
            if limit < most < INF:
                return float(most)
        known[id(node)] = Range(low, high, finite)
    return 0.0


def too_wide(collector: Collector, place: Placed, most: float) -> None:
    """Report (E318) an int that may not fit in 64 bits."""
    message = f"ints have 64 bits, but one that this computes may reach {most:.3g}"
    hint = "compute with reals (`1.0 * x`), or keep the values small: bounds, `clip`, `%`"
    collector.add("E318", place, message, hint)
