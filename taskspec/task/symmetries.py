"""The section `symmetries`: maps of what is seen and of what is done, as nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from taskspec.diagnostics import suggest
from taskspec.lang import syntax as s
from taskspec.lang.ir import Node, Role, reads
from taskspec.lang.scope import Value
from taskspec.task.context import Context
from taskspec.task.memory import what_is_seen
from taskspec.task.names import Names
from taskspec.task.parts import Component, Observation, Symmetry
from taskspec.task.widths import too_wide, widest

SEEN, DONE = "observation", "action"
"""The maps that a symmetry may have."""


def symmetries(context: Context, names: Names, observation: Observation) -> tuple[Symmetry, ...]:
    """The symmetries that a spec declares; those that are broken are reported, and left out."""
    written: Mapping[str, Any] = context.data.get("symmetries") or {}
    if not written:
        return ()
    seen = what_is_seen(context.builder, observation)
    scope_of = {SEEN: names.map_scope("seen", seen)}
    scope_of[DONE] = names.map_scope("done", {c.name: context.bound(c, Role.ACTION) for c in context.action})
    exprs = {name: _parsed(context, name, entry) for name, entry in written.items()}
    context.exprs["symmetries"] = exprs
    found = []
    for name, maps in exprs.items():
        values = {
            n: None if e is None else context.checker.check(e, scope_of[SEEN]) for n, e in maps.get(SEEN, {}).items()
        }
        action = _steered(context, name, maps.get(DONE, {}))
        if action is None or any(v is None for v in values.values()):
            continue
        shown = list(_shown(context, observation, seen, {n: v for n, v in values.items() if v is not None}))
        found.append(
            Symmetry(
                name, written[name].get("doc"), observation.components, tuple(c for c, _ in shown),
                tuple(n for _, n in shown), action,
            )
        )  # fmt: skip
    for each in found:
        most = widest(each.nodes)
        if most:
            too_wide(context.collector, context.merged.key_span(("symmetries", each.name)), most)
    return tuple(found)


def _parsed(context: Context, name: str, entry: Mapping[str, Any]) -> dict[str, dict[str, s.Expr | None]]:
    return {
        key: {n: context.forms.expr(("symmetries", name, key, n)) for n in entry[key]}
        for key in (SEEN, DONE)
        if entry.get(key)
    }


def _shown(
    context: Context, observation: Observation, seen: Mapping[str, Value], values: Mapping[str, Value]
) -> Iterator[tuple[Component, Node]]:
    """What is seen then: lines in the place of what they are named after, what no line names or uses as it is, and new names."""
    if not values:
        return
    used = {name for _, name in reads(v.node for v in values.values())}
    for c in observation.components:
        if c.name in values:
            yield _component(context, c, values[c.name])
        elif c.name not in used:
            yield c, seen[c.name].node
    known = {c.name for c in observation.components}
    for name, value in values.items():
        if name not in known:
            yield _component(context, Component(name, value.node.type, (), ()), value)


def _component(context: Context, c: Component, value: Value) -> tuple[Component, Node]:
    """A component that is seen, within bounds that follow from its expression."""
    low, high = context.builder.bounds(value.node)
    size = value.node.type.size
    made = replace(c, type=value.node.type, low=(low,) * size, high=(high,) * size, domain=value.domain)
    return made, value.node


def _steered(context: Context, name: str, lines: Mapping[str, s.Expr | None]) -> tuple[Node, ...] | None:
    """The map of the action, whole; empty without one, None for one that is broken (and reported)."""
    known = [c.name for c in context.action]
    for each in (n for n in lines if n not in known):
        span = context.merged.key_span(("symmetries", name, DONE, each))
        context.collector.add("E216", span, f"there is no action component '{each}'", suggest(each, known))
    if not lines:
        return ()
    nodes = []
    for c in context.action:
        expr = lines.get(c.name)
        if c.name not in lines:
            nodes.append(context.read(c, Role.ACTION).node)
        elif expr is not None and (node := context.assign(expr, context.named_scopes["done"], c)) is not None:
            nodes.append(node)
    return tuple(nodes) if len(nodes) == len(known) else None
