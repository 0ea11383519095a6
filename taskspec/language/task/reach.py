"""Bounds of each state component within the horizon, and ints that fit their range.

A space such as Z^2 is endless, but thirty steps from a bounded start do not leave a box; observation spaces use that box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain

from taskspec.base.diagnostics import Collector, Placed
from taskspec.base.named import entries_by_name
from taskspec.language.expressions import interval
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.interval import bounds, single
from taskspec.language.expressions.ir import Apply, Draw, Node, Read, children, walk
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.scope import Value
from taskspec.language.expressions.types import INF, INT_MAX, INT_WIDEST, Args, Interval, Kind, Range, Role
from taskspec.language.task.parts import Component, Observation

MAX_STEPS = 256


def reach(
    state: Sequence[Component], initial: Sequence[Node], following: Sequence[Node], horizon: int | None, tight: bool = False
) -> dict[str, Interval]:  # fmt: skip
    """Bound every component by an interval that holds all its elements at every time of an episode.

    Where all components are declared with bounds these are kept, unless `tight` ones are asked for. Without a horizon, or with
    one of more than MAX_STEPS steps, what has not settled by then may be anything.
    """
    declared = {c.name: (c.least, c.most) for c in state}
    if not tight and all(map(math.isfinite, chain.from_iterable(declared.values()))):
        return declared
    first: dict[int, Range] = {}
    intervals = {c.name: _within(bounds(n, first), declared[c.name]) for c, n in zip(state, initial, strict=True)}

    nodes = [(node, tuple(map(id, children(node)))) for node in walk(following)]
    known: dict[int, Range] = {}

    def step(reached: dict[str, Interval]) -> dict[str, Interval]:
        _move(nodes, known, reached)
        wider = {}
        for c, node in zip(state, following, strict=True):
            low, high = _within(known[id(node)][:2], declared[c.name])
            wider[c.name] = (min(reached[c.name][0], low), max(reached[c.name][1], high))
        return wider

    for _ in range(MAX_STEPS if horizon is None else min(horizon, MAX_STEPS)):
        wider = step(intervals)
        if wider == intervals:
            return intervals
        intervals = wider
    if horizon is not None and horizon <= MAX_STEPS:
        return intervals
    while (wider := step(intervals)) != intervals:  # what still moves may go anywhere
        for name, edge in wider.items():
            if edge != intervals[name]:
                intervals[name] = declared[name]
    return intervals


def _move(nodes: Iterable[tuple[Node, tuple[int, ...]]], known: dict[int, Range], reached: dict[str, Interval]) -> None:
    """Update what is known of nodes, arguments first, for other bounds of the state; work out again what these change."""
    changed: set[int] = set()
    for node, args in nodes:
        if isinstance(node, Read) and node.role is Role.STATE:
            now = Range(*reached[node.name])
        elif id(node) in known and changed.isdisjoint(args):
            continue
        else:
            now = interval.step(node, [known[arg] for arg in args])
        if known.get(id(node)) != now:
            known[id(node)] = now
            changed.add(id(node))


def over(roots: Sequence[Node], reached: dict[str, Interval]) -> dict[int, Range]:
    """Ranges of the state reads below some nodes, for `interval.bounds`."""
    known = {}
    for n in walk(roots):
        if isinstance(n, Read) and n.role is Role.STATE and n.name in reached:
            known[id(n)] = Range(*reached[n.name])
    return known


def _within(edge: Interval, declared: Interval) -> Interval:
    return max(edge[0], declared[0]), min(edge[1], declared[1])


# Ints that fit: a state int keeps to its range, and an expression that may leave 64 bits is refused.
#
# Python's ints are endless and ints of array backends are not; without this, the same task would mean different things. And
# what reads a state may rely on its range: indices that it keeps in a vector are not looked at again.

Rule = Callable[[Node, Args], Range]


def kept(builder: Builder, c: Component, node: Node) -> Node:
    """Clamp the value of a state component to its range if it might leave it. Of ints only."""
    if c.type.kind is not Kind.INT or not c.type.size or (isinstance(node, Read) and (node.role, node.name) == c.read):
        return node
    if len(set(c.low)) == len(set(c.high)) == 1:
        return builder.within(node, c.low[0], c.high[0])
    least, most = builder.certain(node)
    if least < max(c.low):
        node = builder.apply("max2", node, _each(builder, c.low, c))
    if most > min(c.high):
        return builder.apply("min2", node, _each(builder, c.high, c))
    return node


def _each(builder: Builder, ends: Sequence[float], c: Component) -> Node:
    return builder.const([int(min(max(v, -INT_WIDEST), INT_WIDEST)) for v in ends], c.type)


def saturated(
    builder: Builder,
    state: Sequence[Component],
    initial: Sequence[Node],
    following: Sequence[Node],
    horizon: int | None,
) -> list[Node]:
    """Stop ints of next states at +-(2**31 - 1) that have no bounds and could get further within the horizon."""
    reached = reach(state, initial, following, horizon)
    nexts = []
    for c, node in zip(state, following, strict=True):
        low, high = reached[c.name]
        is_endless = c.type.kind is Kind.INT and not (c.least > -INF and c.most < INF)
        if is_endless and not (low >= -INT_MAX and high <= INT_MAX):
            node = builder.within(node, -INT_MAX, INT_MAX)
        nexts.append(node)
    return nexts


def widest(
    roots: Iterable[Node], limit: int = INT_WIDEST, reads: Mapping[int, Range] | None = None, step: Rule = interval.step
) -> float:
    """Largest magnitude that some int below the roots may have, where it is beyond a limit; else 0.

    `reads` says more of some reads, by id, than their declarations do; `step` is the arithmetic, such as single floats.
    """
    known: dict[int, Range] = {}
    for node in walk(roots):
        low, high, finite = (reads or {}).get(id(node)) or step(node, [known[id(c)] for c in children(node)])
        if node.type.kind is Kind.INT:
            if isinstance(node, Read | Draw) or (
                isinstance(node, Apply) and node.op in OPERATORS and OPERATORS[node.op].rounds
            ):
                if low == -INF:
                    low = max(low, -INT_MAX)
                is_time = isinstance(node, Read) and node.role is Role.TIME  # one more step is observed
                if high == INF:
                    high = INT_MAX - is_time
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


# Bounds of observations: the declared ones, or the bounds of an observed state component. Where none are declared they follow
# from the expression by interval reasoning, over the states that can be reached within the horizon.

Edges = list[Interval]
FAR = 1e9


class Observed:
    """Makes observation components, given the state components and how far each gets."""

    def __init__(self, builder: Builder, state: Sequence[Component], reached: dict[str, Interval]) -> None:
        self.builder = builder
        self.reached = reached
        self.components = entries_by_name(state)

    def expression(
        self, name: str, value: Value, low: Sequence[float] | None = None, high: Sequence[float] | None = None
    ) -> Component:
        """Read an observed expression; `low` and `high` are declared bounds, one for each element."""
        if value.node.type.size:
            lows, highs = zip(*self.edges(value.node), strict=True)
        else:
            lows, highs = ((), ())
        symbol = None
        doc = None
        if isinstance(value.node, Read) and value.node.role is Role.STATE:
            original = self.components[value.node.name]
            doc = original.doc
            symbol = None
            if original.name == name:
                symbol = original.symbol
        return Component(name, value.node.type, tuple(low or lows), tuple(high or highs), value.domain, symbol, doc)

    def edges(self, node: Node) -> Edges:
        """Bounds of every element: of a state component as declared, of a vector part by part."""
        match node:
            case Read(role=Role.STATE, name=name):
                c = self.components[name]
                return self._tight(list(zip(c.low, c.high, strict=True)), self.reached.get(name))
            case Apply(op="vector" | "concat", args=args):
                return [edge for arg in args for edge in self.edges(arg)]
            case _:
                # An int may come from reals, and JAX has others: the space has room for what any backend shows.
                edge = self.builder.bounds(node)
                if node.type.kind is Kind.INT:
                    edge = single(node)
                return self._tight([edge] * node.type.size, bounds(node, over([node], self.reached)))

    def _tight(self, edges: Edges, reached: Interval | None) -> Edges:
        """Replace infinite bounds by reachable ones, unless these are so far away that they say nothing."""
        if reached is None:
            return edges
        low = -math.inf
        if reached[0] >= -FAR:
            low = reached[0]
        high = math.inf
        if reached[1] <= FAR:
            high = reached[1]
        ends = []
        for a, b in edges:
            if not math.isfinite(a):
                a = low
            if not math.isfinite(b):
                b = high
            ends.append((min(a, b), max(a, b)))  # a real that starts outside its range is an error of `check`
        return ends


def what_is_seen(builder: Builder, observation: Observation, role: Role = Role.NEXT) -> Mapping[str, Value]:
    """Bind observations by name, as the memory and symmetries read them (NEXT), or the expert (STATE)."""
    seen = {}
    for c, node in zip(observation.components, observation.nodes, strict=True):
        read = builder.read(role, c.name, c.type, *builder.certain(node))
        seen[c.name] = Value(read, c.domain, late=True)
    return seen
