"""The observation section: components with their expressions and the bounds of their spaces.

Bounds are the declared ones (`{value: ..., low: ..., high: ...}`, or those of an observed state component). Where none are
declared they follow from the expression by interval reasoning, over the states that can be reached within the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from taskspec.lang.builder import Builder
from taskspec.lang.interval import bounds, single
from taskspec.lang.ir import Apply, Node, Read, Role
from taskspec.lang.ranges import Interval
from taskspec.lang.scope import Value
from taskspec.lang.types import Kind
from taskspec.task.reach import over
from taskspec.task.task import Component

Edges = list[Interval]
FAR = 1e9


class Observed:
    """Makes observation components, given the state components and how far each gets."""

    def __init__(self, builder: Builder, state: Sequence[Component], reached: dict[str, Interval]) -> None:
        self.builder, self.reached = builder, reached
        self.components = {c.name: c for c in state}

    def state(self, c: Component) -> Component:
        """A state component that is observed as it is."""
        edges = self._tight(list(zip(c.low, c.high, strict=True)), self.reached.get(c.name))
        return _bounded(c, edges)

    def expression(
        self, name: str, value: Value, low: Sequence[float] | None, high: Sequence[float] | None
    ) -> Component:
        """An observed expression; `low` and `high` are declared bounds, one for each element."""
        node = value.node
        edges = self.edges(node)
        lows = [a for a, _ in edges] if low is None else list(low)
        highs = [b for _, b in edges] if high is None else list(high)
        original = self._original(node)
        symbol = original.symbol if original is not None and original.name == name else None
        doc = original.doc if original is not None else None
        return Component(name, node.type, tuple(lows), tuple(highs), value.domain, symbol, doc)

    def _original(self, node: Node) -> Component | None:
        if isinstance(node, Read) and node.role is Role.STATE:
            return self.components[node.name]
        return None

    def edges(self, node: Node) -> Edges:
        """Bounds of every element: of a state component as declared, of a vector part by part."""
        original = self._original(node)
        if original is not None:
            return self._tight(list(zip(original.low, original.high, strict=True)), self.reached.get(original.name))
        match node:
            case Apply(op="vector" | "concat", args=args):
                return [edge for arg in args for edge in self.edges(arg)]
            case _:
                # An int may come from reals, and JAX has others: the space has room for what any backend shows.
                edge = single(node) if node.type.kind is Kind.INT else self.builder.bounds(node)
                return self._tight(
                    [edge] * node.type.size,
                    bounds(node, over([node], self.reached)),
                )

    def _tight(self, edges: Edges, reached: Interval | None) -> Edges:
        """Infinite bounds replaced by those of what can be reached, unless these are so far away that they say nothing."""
        if reached is None:
            return edges
        low, high = reached[0] if reached[0] >= -FAR else -math.inf, reached[1] if reached[1] <= FAR else math.inf
        ends = ((a if math.isfinite(a) else low, b if math.isfinite(b) else high) for a, b in edges)
        return [(min(pair), max(pair)) for pair in ends]  # a real that starts outside its range is an error of `check`


def _bounded(c: Component, edges: Edges) -> Component:
    return replace(c, low=tuple(a for a, _ in edges), high=tuple(b for _, b in edges))
