"""The observation section, and what an expert remembers beside the state.

Bounds are the declared ones (`{value: ..., low: ..., high: ...}`, or those of an observed state component). Where none are
declared they follow from the expression by interval reasoning, over the states that can be reached within the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from taskspec.lang.builder import Builder
from taskspec.lang.evaluate import evaluate
from taskspec.lang.interval import bounds, single
from taskspec.lang.ir import Apply, Node, Read, Role
from taskspec.lang.scope import Value
from taskspec.lang.types import INT_MAX, Interval, Kind
from taskspec.task.context import Context
from taskspec.task.names import Names
from taskspec.task.parts import Component, ExpertMemory, Observation
from taskspec.task.reach import kept, over
from taskspec.task.task import Task

Edges = list[Interval]
FAR = 1e9


class Observed:
    """Makes observation components, given the state components and how far each gets."""

    def __init__(self, builder: Builder, state: Sequence[Component], reached: dict[str, Interval]) -> None:
        self.builder = builder
        self.reached = reached
        self.components = {c.name: c for c in state}

    def state(self, c: Component) -> Component:
        """Return a state component that is observed as it is."""
        edges = self._tight(list(zip(c.low, c.high, strict=True)), self.reached.get(c.name))
        return _bounded(c, edges)

    def expression(
        self, name: str, value: Value, low: Sequence[float] | None, high: Sequence[float] | None
    ) -> Component:
        """Return an observed expression; `low` and `high` are declared bounds, one for each element."""
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
        """Return bounds of every element: of a state component as declared, of a vector part by part."""
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
        low = reached[0] if reached[0] >= -FAR else -math.inf
        high = reached[1] if reached[1] <= FAR else math.inf
        ends = ((a if math.isfinite(a) else low, b if math.isfinite(b) else high) for a, b in edges)
        return [(min(pair), max(pair)) for pair in ends]  # a real that starts outside its range is an error of `check`


def _bounded(c: Component, edges: Edges) -> Component:
    return replace(c, low=tuple(a for a, _ in edges), high=tuple(b for _, b in edges))


# What an expert remembers: declared memory that is no part of the task's state.
#
# It begins with what is first seen, and changes with each action and what is seen after it; so whoever sees observations alone
# can keep it, and the state together with it is the state of a larger task, in which the expert remembers nothing
# (`Task.remembering`).

Flats = Sequence[tuple[Any, ...]]
FIRST = "first memory"
LATER = "memory"
"""Scopes of first values and of next values."""


def remembered(context: Context, names: Names, observation: Observation) -> ExpertMemory | None:
    """Return the memory that the expert of a spec keeps; None for none, or for one that is broken (and reported)."""
    _check_names(context, observation)
    seen = what_is_seen(context.builder, observation)
    scopes = {"initial": names.memory_scope(FIRST, seen), "next": names.memory_scope(LATER, seen)}
    found: dict[str, list[Node]] = {"initial": [], "next": []}
    for c in context.memory:
        for key, nodes in found.items():
            expr = context.forms.expr(("memory", c.name, key))
            context.exprs.setdefault("memory", {})[c.name + "'" * (key == "next")] = expr
            node = None if expr is None else context.assign(expr, scopes[key], c)
            nodes += [] if node is None else [node]
    if not context.memory or any(len(nodes) < len(context.memory) for nodes in found.values()):
        return None
    raw_initial, raw_next = map(tuple, found.values())
    initial, following = (_fitting(context.builder, context.memory, nodes) for nodes in (raw_initial, raw_next))
    return ExpertMemory(context.memory, initial, following, raw_initial, raw_next)


def what_is_seen(builder: Builder, observation: Observation) -> Mapping[str, Value]:
    """Return what is observed, by name, as the memory and symmetries read it."""
    pairs = zip(observation.components, observation.nodes, strict=True)
    reads = {c.name: builder.read(Role.NEXT, c.name, c.type, *builder.certain(node)) for c, node in pairs}
    return {c.name: Value(reads[c.name], c.domain, late=True) for c in observation.components}


def _fitting(builder: Builder, components: tuple[Component, ...], nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    """Return values with ints that keep to their ranges, and to 32 bits where these have no end."""
    pairs = [(c, kept(builder, c, node)) for c, node in zip(components, nodes, strict=True)]
    return tuple(builder.within(n, -INT_MAX, INT_MAX) if c.type.kind is Kind.INT else n for c, n in pairs)


def _check_names(context: Context, observation: Observation) -> None:
    """Report (E309) what is remembered under the name of something that is seen: its prime would mean both."""
    seen = {c.name for c in observation.components}
    for c in context.memory:
        if c.name in seen and c.name not in {s.name for s in context.state}:
            place = context.merged.key_span(("memory", c.name))
            hint = "every name has one meaning in a spec"
            context.collector.add("E309", place, f"'{c.name}' is an observation already", hint)


def recall(
    task: Task, memory: ExpertMemory, seen: Flats, before: Flats, action: Flats, t: int
) -> list[tuple[Any, ...]]:
    """Return what is remembered once something is seen, as flat values by component.

    Args:
        seen: what is now observed, by component.
        before, action: the memory and the action before that; not looked at when `t` is 0.
        t: steps taken.
    """
    reads: dict[tuple[Role, str], Any] = {
        (Role.NEXT, c.name): flat for c, flat in zip(task.observation.components, seen, strict=True)
    }
    if t == 0:
        return evaluate(memory.initial, reads)
    reads |= {c.read: flat for c, flat in zip(memory.components, before, strict=True)}
    reads |= {(Role.ACTION, c.name): flat for c, flat in zip(task.action, action, strict=True)}
    reads[Role.TIME, "t"] = (t - 1,)
    return evaluate(memory.next, reads)
