"""The sections that annotate a task: figure, examples, symmetries, and what the expert remembers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

from taskspec.base.diagnostics import suggest
from taskspec.base.limits import how_to_raise, limits
from taskspec.base.named import all_names
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Const, Node, reads
from taskspec.language.expressions.scope import Scope, Value
from taskspec.language.expressions.types import INT_MAX, Kind, Role
from taskspec.language.source import Path
from taskspec.language.task import parts as parameters
from taskspec.language.task.context import Context
from taskspec.language.task.names import Names
from taskspec.language.task.parts import (
    FIGURE_KINDS,
    Component,
    Example,
    ExpertMemory,
    Figure,
    Followed,
    Observation,
    Symmetry,
)
from taskspec.language.task.reach import kept, too_wide, what_is_seen, widest
from taskspec.language.task.sections import by_component


def figure(context: Context, scope: Scope) -> Figure | None:
    """Read the section `figure`; None without one.

    Reported are keys that the kind of figure lacks (E203), and expressions that mean nothing or have the wrong shape.
    """
    written: dict[str, Any] | None = context.data.get("figure")
    if not written:
        return None
    for key in FIGURE_KINDS[written["kind"]].keys:
        if written.get(key) is None:
            context.report_key("E203", ("figure",), f"a figure of kind `{written['kind']}` needs `{key}`")
    shown: dict[str, Node] = {}
    for path in (("curve",), ("values",), *(("highlight", name) for name in written.get("highlight") or {})):
        node = _number_of(context, context.forms.optional(("figure", *path)), scope)
        if node is not None:
            shown[path[-1]] = node
    sizes = (2, 4) if written["kind"] == "grid" else (2,)
    objects: dict[str, tuple[Node, ...]] = {}
    for name, at in (written.get("objects") or {}).items():
        place = _place(context, ("figure", "objects", name), at, scope, (2, 4))
        if place:
            objects[name] = place
    return Figure(
        kind=written["kind"], at=_place(context, ("figure", "at"), written.get("at"), scope, sizes),
        curve=shown.pop("curve", None), values=shown.pop("values", None), highlight=shown,
        map=_map(context, written.get("map")), objects=objects,
    )  # fmt: skip


def _place(context: Context, path: Path, at: Any, scope: Scope, sizes: tuple[int, ...]) -> tuple[Node, ...]:
    """Read a column and a row, and maybe a way, or one vector of all; nothing without one, or for a broken one."""
    if at is None:
        return ()
    whole = None
    if not isinstance(at, list):
        whole = context.forms.expr(path)
    parts: Sequence[s.Expr | None] = [whole]
    if isinstance(at, list):
        parts = [context.forms.expr((*path, i)) for i in range(len(at))]
    elif isinstance(whole, s.Vector):
        parts = whole.items  # `at: "[x, y]"` is the same as `at: [x, y]`
    nodes = [_number_of(context, expr, scope) for expr in parts]
    place = tuple(node for node in nodes if node is not None)
    if len(place) < len(nodes):
        return ()
    inner = next((node.type.shape for node in place if node.type.shape), ())
    if parts == [whole]:
        shape = inner
    else:
        shape = (len(place), *inner)
    if shape not in [(n,) for n in sizes]:
        more = ""
        if 4 in sizes:
            more = ", or four with the way that it faces"
        context.report("E307", path, f"a place is two numbers{more}, but this has shape {list(shape)}")
    return place


def _number_of(context: Context, expr: s.Expr | None, scope: Scope) -> Node | None:
    """Convert an expression to a node, a choice to its number; None for a broken one (reported)."""
    value = context.checker.check(expr, scope)
    if value is None:
        return None
    return context.checker.number_of(value)


def _map(context: Context, name: str | None) -> tuple[str, ...]:
    constants = context.data.get("constants") or {}
    if name is None:
        return ()
    grid = isinstance(constants.get(name), dict) and constants[name].get("grid")
    if name not in constants:
        context.report("E302", ("figure", "map"), f"there is no constant '{name}'", suggest(name, constants))
    elif not grid:
        value = context.constant(name)
        rows = _digits(value)
        if rows is None and value is not None:
            message = f"the constant '{name}' is neither a grid of letters nor a matrix of conditions or digits"
            context.report("E204", ("figure", "map"), message, f"{name}: {{grid: [...], legend: {{...}}}}")
        return rows or ()
    return tuple(grid.splitlines() if isinstance(grid, str) else grid or ())


def _digits(value: Value | None) -> tuple[str, ...] | None:
    """Write a matrix as rows of characters, `#` for a condition that holds; None for other numbers, or no matrix."""
    node = value and value.node
    if not isinstance(node, Const) or len(node.type.shape) != 2 or not node.type.size:
        return None
    if node.type.kind is Kind.BOOL:
        letters = ["#" if v else " " for v in node.flat]
    elif node.type.kind is Kind.INT and all(0 <= v <= 9 for v in node.flat):
        letters = list(map(str, node.flat))
    else:
        return None
    width = node.type.shape[1]
    rows = ["".join(letters[i : i + width]) for i in range(0, len(letters), width)]
    return tuple(rows)


# Worked examples as surface syntax: names are checked when a task is built, values when the example is.

SCOPE = "examples"
_GIVEN = {"state": (Role.STATE, "given state"), "action": (Role.ACTION, "action")}
"""Keys that say what is given, with the owners of the names: names of a state are names of the expert's memory as well."""
_BY_NAME = {"initial": "state", "next": "state", "observation": "observation", "expert": "action"}
"""Keys that say what follows name by name, and the section that has the names."""
_SINGLE = ("reward", "terminal", "truncated")


def read_examples(context: Context) -> Iterator[Example]:
    """Yield the examples of a spec; mistakes go to the collector."""
    context.named_scopes[SCOPE] = context.constant_scope()
    for i, entry in enumerate(context.data.get("examples") or ()):
        yield _example(context, entry, ("examples", i))


def _example(context: Context, entry: Mapping[str, Any], path: Path) -> Example:
    given: dict[tuple[Role, str], s.Expr] = {}
    for key, (role, section) in _GIVEN.items():
        for name, expr in _named(context, entry, key, section, path):
            given[role, name] = expr
    follows: list[Followed] = []
    for key, section in _BY_NAME.items():
        for name, expr in _named(context, entry, key, section, path):
            follows.append(Followed(key, name, expr))
    for key in _SINGLE:
        single = context.forms.optional((*path, key))
        if single is not None:
            follows.append(Followed(key, None, single))
    chance = context.forms.optional((*path, "probability"))
    most = limits().claims
    if (number := parameters.size(entry.get("for"))) > most:
        message = f"{number:,} choices of parameter values are too many; the limit is {most:,}"
        context.report_key("E314", (*path, "for"), message, how_to_raise("claims", number))
    cases = tuple(islice(parameters.cases(entry.get("for")), most))
    return Example(context.forms.place(path), given, tuple(follows), int(entry.get("t") or 0), chance, cases)


def _named(
    context: Context, entry: Mapping[str, Any], key: str, section: str, path: Path
) -> Iterator[tuple[str, s.Expr]]:
    known = _names(context, section)
    for name in entry.get(key) or {}:
        here = (*path, key, name)
        if name not in known:
            what = {"observation": "observation", "action": "action component"}.get(section, "state component")
            hint = suggest(name, known) or f"there are: {', '.join(known)}"
            context.report_key("E216", here, f"there is no {what} '{name}'", hint)
        elif (expr := context.forms.expr(here)) is not None:
            yield name, expr


def _names(context: Context, section: str) -> Sequence[str]:
    if section == "observation" and context.data.get("observation"):
        names = []
        for name in context.data["observation"]:
            if name != "space":
                names.append(name)
        return names
    if section == "given state":
        return all_names((*context.state, *context.memory))
    return all_names(context.action if section == "action" else context.state)


# The section `symmetries`: maps of what is seen and of what is done, as nodes.

SEEN = "observation"
DONE = "action"
"""The maps that a symmetry may have."""


def symmetries(context: Context, names: Names, observation: Observation) -> tuple[Symmetry, ...]:
    """Read the symmetries of a spec; broken ones are reported and left out."""
    written: Mapping[str, Any] = context.data.get("symmetries") or {}
    if not written:
        return ()
    seen = what_is_seen(context.builder, observation)
    scope_of = {SEEN: names.map_scope("seen", seen)}
    scope_of[DONE] = names.map_scope("done", {c.name: context.bound(c, Role.ACTION) for c in context.action})
    exprs: dict[str, dict[str, dict[str, s.Expr | None]]] = {}
    for name, entry in written.items():
        exprs[name] = {}
        for key in (SEEN, DONE):
            if entry.get(key):
                exprs[name][key] = {n: context.forms.expr(("symmetries", name, key, n)) for n in entry[key]}
    context.exprs["symmetries"] = exprs
    declared = []
    for name, maps in exprs.items():
        values = {}
        for n, e in maps.get(SEEN, {}).items():
            values[n] = context.checker.check(e, scope_of[SEEN])
        lines = maps.get(DONE, {})
        action: tuple[Node, ...] | None = ()
        if lines:
            action = by_component(context, ("symmetries", name, DONE), lines, scope_of[DONE], is_whole=False)
        if action is None or any(v is None for v in values.values()):
            continue
        shown = dict(_shown(context, observation, seen, {n: v for n, v in values.items() if v is not None}))
        doc = written[name].get("doc")
        declared.append(Symmetry(name, doc, observation.components, tuple(shown), tuple(shown.values()), action))
        most = widest(declared[-1].nodes)
        if most:
            too_wide(context.collector, context.merged.key_span(("symmetries", name)), most)
    return tuple(declared)


def _shown(
    context: Context, observation: Observation, seen: Mapping[str, Value], values: Mapping[str, Value]
) -> Iterator[tuple[Component, Node]]:
    """Yield the image of each observation: lines, components that no line names or uses, and new names."""
    if not values:
        return
    used = set()
    for _, name in reads(v.node for v in values.values()):
        used.add(name)
    for c in observation.components:
        if c.name in values:
            yield _component(context, c, values[c.name])
        elif c.name not in used:
            yield c, seen[c.name].node
    known = set(all_names(observation.components))
    for name, value in values.items():
        if name not in known:
            yield _component(context, Component(name, value.node.type, (), ()), value)


def _component(context: Context, c: Component, value: Value) -> tuple[Component, Node]:
    low, high = context.builder.bounds(value.node)
    size = value.node.type.size
    made = replace(c, type=value.node.type, low=(low,) * size, high=(high,) * size, domain=value.domain)
    return made, value.node


# The expert's memory, which is declared and no part of the task's state.
#
# It begins with what is first seen, and changes with each action and what is seen after it; so whoever sees observations alone
# can keep it, and the state together with it is the state of a larger task, in which the expert remembers nothing
# (`Task.remembering`). Observations that the expert itself reads are remembered until the next ones.

FIRST = "first memory"
LATER = "memory"
"""Scopes of first values and of next values."""


def remembered(context: Context, names: Names, observation: Observation) -> ExpertMemory | None:
    """Read the memory of a spec's expert; None without one, or for a broken one (reported)."""
    for c in context.memory:  # its prime would mean both
        if c.name in all_names(observation.components) and c.name not in all_names(context.state):
            hint = "every name has one meaning in a spec"
            context.report_key("E309", ("memory", c.name), f"'{c.name}' is an observation already", hint)
    names.seen = what_is_seen(context.builder, observation, Role.STATE)
    seen = what_is_seen(context.builder, observation)
    scopes = {"initial": names.memory_scope(FIRST, seen), "next": names.memory_scope(LATER, seen)}
    lines: dict[str, list[Node]] = {"initial": [], "next": []}
    for c in context.memory:
        for key, nodes in lines.items():
            expr = context.forms.expr(("memory", c.name, key))
            context.exprs.setdefault("memory", {})[c.name + "'" * (key == "next")] = expr
            node = context.assign(expr, scopes[key], c)
            if node is not None:
                nodes.append(node)
    if not context.memory or any(len(nodes) < len(context.memory) for nodes in lines.values()):
        return None
    raw_initial, raw_next = map(tuple, lines.values())
    initial = _fitting(context.builder, context.memory, raw_initial)
    following = _fitting(context.builder, context.memory, raw_next)
    return ExpertMemory(context.memory, initial, following, raw_initial, raw_next)


def looking(context: Context, memory: ExpertMemory, observation: Observation, expert: tuple[Node, ...]) -> ExpertMemory:
    """Add the observations that the expert reads to a memory."""
    read = reads(expert)
    known = set()
    for c in (*context.state, *context.memory):
        known.add(c.read)
    seen = []
    for c in observation.components:
        if c.read in read and c.read not in known:
            seen.append(c)
    shown = what_is_seen(context.builder, observation)
    nodes = tuple(shown[c.name].node for c in seen)
    context.memory = (*context.memory, *seen)
    return ExpertMemory(
        context.memory, (*memory.initial, *nodes), (*memory.next, *nodes), (*memory.raw_initial, *nodes),
        (*memory.raw_next, *nodes), len(seen),
    )  # fmt: skip


def _fitting(builder: Builder, components: tuple[Component, ...], nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    fitting = []
    for c, node in zip(components, nodes, strict=True):
        node = kept(builder, c, node)
        if c.type.kind is Kind.INT:
            node = builder.within(node, -INT_MAX, INT_MAX)
        fitting.append(node)
    return tuple(fitting)
