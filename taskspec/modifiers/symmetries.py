"""The modifier of symmetries: a twin of a task, observed and steered in another way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import TypeAlias

import numpy as np

from taskspec.base.diagnostics import suggest
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Node, Read, Role, children, plain, rewrite, walk
from taskspec.lang.operators import OPERATORS, Elements, entry_of
from taskspec.lang.types import Kind, Type
from taskspec.modifiers.core import (
    MOST,
    apart,
    combinations,
    elements,
    fresh,
    joint,
    meaning,
    names_in,
    observing,
    present,
    shaped,
)
from taskspec.modifiers.entry import Arguments, Inapplicable, ModifierArgument, ModifierEntry, always, as_well
from taskspec.task.bijection import MapPart, Moves, bounds, codes, outside, parts
from taskspec.task.task import FINITE_SPACES, Component, Symmetry, Task

MOST_VALUES = 256
"""Limit on the values of an expression that are listed."""
TRIED = 4096
"""Combinations of arguments that are worked out for one operation."""
Values: TypeAlias = frozenset[Const] | None
"""What the elements of a node may be; None where that is not known, or too much."""


def values(b: Builder, root: Node) -> Values:
    """Return the constants that a number may come to; None where there may be others, or too many."""
    known: dict[int, Values] = {}
    for node in walk([root]):
        found = _values(b, node, [known[id(c)] for c in children(node)])
        known[id(node)] = found if found is not None and len(found) <= MOST_VALUES else None
    return known[id(root)]


def _values(b: Builder, node: Node, args: list[Values]) -> Values:
    match node:
        case Const():
            kind = Type(node.type.kind)
            return frozenset(b.const(v, kind) for v in set(node.flat))
        case Apply(op=op) if entry_of(op).elements is Elements.MOVED:
            indices = entry_of(op).indices
            return _union([a for i, a in enumerate(args) if i not in indices], b, node)
        case Apply(op=op) if op in OPERATORS and OPERATORS[op].elementwise:
            found = _worked_out(b, op, args)
            return _within_bounds(b, node) if found is None else found
        case _:
            return _within_bounds(b, node)


def _union(args: list[Values], b: Builder, node: Node) -> Values:
    if any(a is None for a in args):
        return _within_bounds(b, node)
    kind = node.type.kind
    found = [b.cast(value, kind) for values in args if values is not None for value in values]
    return frozenset(value for value in found if isinstance(value, Const))


def _worked_out(b: Builder, op: str, args: list[Values]) -> Values:
    """Return what an operator gives for all combinations of arguments."""
    if any(a is None for a in args) or math.prod(len(a or ()) for a in args) > TRIED:
        return None
    found = [b.apply(op, *each) for each in product(*(a or () for a in args))]
    return frozenset(v for v in found if isinstance(v, Const))


def _within_bounds(b: Builder, node: Node) -> Values:
    """Return all that an int or a condition may be, by its bounds."""
    if node.type.kind is Kind.REAL:
        return None
    if node.type.kind is Kind.BOOL:
        return frozenset((b.const(False, Type(Kind.BOOL)), b.const(True, Type(Kind.BOOL))))
    low, high = b.bounds(node)
    if not (math.isfinite(low) and math.isfinite(high) and high - low < MOST_VALUES):
        return None
    return frozenset(b.const(v, Type(Kind.INT)) for v in range(int(low), int(high) + 1))


def floats(b: Builder, root: Node) -> list[float] | None:
    """Return the values of a number as floats, in order; None where they are not known to be few and finite."""
    found = values(b, root)
    if found is None:
        return None
    numbers = sorted({float(plain(v.value)) + 0.0 for v in found})
    return numbers if all(map(math.isfinite, numbers)) else None


# The modifier of symmetries: a twin of a task, which is seen and steered in another way that its spec declares.


def _twin(b: Builder, task: Task, given: Arguments) -> Task:
    symmetry = _declared(task, given["name"])
    if symmetry.observation:
        task = _seen(b, task, symmetry)
    return _steered(b, task, symmetry) if symmetry.action else task


def _declared(task: Task, name: str) -> Symmetry:
    """Return a symmetry by its name."""
    known = {each.name: each for each in task.unmodified.symmetries}
    if name not in known:
        reason = f"it declares no symmetry '{name}'" if known else "it declares no symmetries"
        raise Inapplicable(reason, suggest(name, known) or (f"it has {', '.join(known)}" if known else None))
    return known[name]


# -- what is seen -------------------------------------------------------------------------------------------------


def _seen(b: Builder, task: Task, symmetry: Symmetry) -> Task:
    """Return the task of which something else is seen; what other modifiers add to the observation stays."""
    now = {c.name: (c, node) for c, node in zip(task.observation.components, task.observation.nodes, strict=True)}
    for c in symmetry.seen:
        if c.name not in now or now[c.name][0].type != c.type:
            hint = "give the symmetry before modifiers of what is observed"
            raise Inapplicable(f"'{c.name}' is no longer observed as the symmetry expects", hint)
    seen = [now.pop(c.name)[0] for c in symmetry.seen]
    found = parts(Role.NEXT, seen, symmetry.observation)
    if any(part.clash() is not None for part in found):
        raise Inapplicable("it is not one-to-one: two observations would look alike", "`taskspec check` shows two")
    components = _bounded(symmetry.components, found)
    _check_space(task, components)
    shown = {c.name: n for c, n in zip(task.observation.components, task.observation.nodes, strict=True)}

    def leaf(node: Node) -> Node | None:
        return shown[node.name] if isinstance(node, Read) and node.role is Role.NEXT else None

    nodes = rewrite(symmetry.observation, leaf, b.remake_late)
    taken = (names_in(task) - set(now)) | {c.name for c in components}
    other_names = fresh(list(now), taken)
    others = [(replace(c, name=name), node) for name, (c, node) in zip(other_names, now.values(), strict=True)]
    return observing(
        b, task, [*components, *(c for c, _ in others)], [*nodes, *(n for _, n in others)], task.observation.space, {}
    )


def _bounded(components: Sequence[Component], found: Sequence[MapPart]) -> list[Component]:
    """Return components with the bounds that parts of a map give them, as far as these are known."""
    made = list(components)
    for part in found:
        ends = list(bounds(part))
        for i in part.outputs if part.is_decided else ():
            own = ends[: made[i].type.size]
            ends = ends[made[i].type.size :]
            made[i] = replace(made[i], low=tuple(a for a, _ in own), high=tuple(b for _, b in own))
    return made


def _check_space(task: Task, components: Sequence[Component]) -> None:
    """Refuse what does not fit into the space that the spec asks for.

    Raises:
        Inapplicable: reals where there are to be none, or several numbers where one is to be.
    """
    space = task.observation.space
    if space in FINITE_SPACES and not all(c.is_finite for c in components):
        raise Inapplicable(f"a `{space}` observation holds no reals")
    if space == "discrete" and not (len(components) == 1 and components[0].type.is_scalar):
        raise Inapplicable("a `discrete` observation is one number")


# -- what is done -------------------------------------------------------------------------------------------------


def _steered(b: Builder, task: Task, symmetry: Symmetry) -> Task:
    """Return the task in which an action does what that one did which it stands for."""
    found = parts(Role.ACTION, task.action, symmetry.action, is_tied=True)
    executed: dict[str, Node] = {}
    for part in found:
        own = [symmetry.action[i] for i in part.outputs]
        if all(isinstance(n, Read) and n.name == c.name for n, c in zip(own, part.inputs, strict=True)):
            continue
        if not part.is_decided:
            raise Inapplicable(
                "it could not be shown to be one-to-one on the actions: there are too many, and it does more than permute them"
            )
        if part.clash() is not None or outside(part) is not None:
            raise Inapplicable("it is not one-to-one in the actions", "`taskspec check` shows where")
        executed |= zip((c.name for c in part.inputs), _undone(b, part), strict=True)
    expert = task.expert
    if isinstance(expert, tuple):
        expert = _put(b, symmetry.action, dict(zip((c.name for c in task.action), expert, strict=True)))
    every = {c.name: executed.get(c.name) or present(b, c, Role.ACTION) for c in task.action}
    plain = tuple(replace(c, domain=None) if c.name in executed else c for c in task.action)
    return meaning(b, replace(task, action=plain, expert=expert), every)


def _put(b: Builder, nodes: Sequence[Node], actions: dict[str, Node]) -> tuple[Node, ...]:
    """Return a map of the action, of an action that is given."""

    def leaf(node: Node) -> Node | None:
        return actions[node.name] if isinstance(node, Read) and node.role is Role.ACTION else None

    return rewrite(nodes, leaf, b.remake_late)


def _undone(b: Builder, part: MapPart) -> list[Node]:
    """Return the action that a part of an action stands for, by component."""
    given = [present(b, c, Role.ACTION) for c in part.inputs]
    if part.moves is not None:
        return _moved_back(b, part.inputs, given, part.moves)
    combinations(part.inputs, "the actions of a symmetry", MOST)
    back = np.argsort(codes(part)).tolist()
    return apart(b, part.inputs, back, joint(b, part.inputs, given))


def _moved_back(b: Builder, components: Sequence[Component], given: Sequence[Node], moves: Moves) -> list[Node]:
    flat = [element for node in given for element in elements(b, node)]
    own: dict[int, Node] = {}
    for node, source, sign, shift in zip(flat, moves.source, moves.sign, moves.shift, strict=True):
        moved = b.apply("sub", node, b.scalar(int(shift))) if shift else node
        own[int(source)] = b.apply("neg", moved) if sign < 0 else moved
    found = []
    at = 0
    for c in components:
        values = [own[at + i] for i in range(c.type.size)]
        if c.type.kind is Kind.INT:
            values = [b.within(v, low, high) for v, low, high in zip(values, c.low, c.high, strict=True)]
        found.append(shaped(b, values, c.type))
        at += c.type.size
    return found


def _says(task: Task, given: Arguments) -> str:
    symmetry = _declared(task, given["name"])
    maps = {"what is observed": symmetry.observation, "what actions do": symmetry.action}
    said = " and ".join(what for what, nodes in maps.items() if nodes)
    return f"{said} {'are' if ' and ' in said else 'is'} changed by the symmetry `{symmetry.name}`" + (
        f": {symmetry.doc}" if symmetry.doc else ""
    )


TABLE = (
    ModifierEntry(
        "symmetry", (
            ModifierArgument("name", "word", "which symmetry of the spec",
                             sample=lambda task: task.symmetries[0].name if task.symmetries else "none"),
        ),
        "Observations or actions are transformed as the spec declares under `symmetries`.",
        _twin, _says, keeps="all returns", observed=always, abstraction=as_well, needs="a spec that declares it",
    ),
)  # fmt: skip
