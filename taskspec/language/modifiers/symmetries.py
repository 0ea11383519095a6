"""The modifier of symmetries: a twin of a task, observed and steered in another way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from taskspec.base.diagnostics import suggest
from taskspec.base.named import all_names, entries_by_name
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node, Read
from taskspec.language.expressions.types import Kind, Role
from taskspec.language.modifiers import core
from taskspec.language.modifiers.entry import Arguments, Inapplicable, ModifierArgument, ModifierEntry, always, as_well
from taskspec.language.task.bijection import MapPart, Moves, bounds, codes, outside, parts
from taskspec.language.task.parts import FINITE_SPACES, Component, Symmetry, are_finite, by_read
from taskspec.language.task.task import Task


def _twin(b: Builder, task: Task, given: Arguments) -> Task:
    symmetry = _declared(task, given["name"])
    if symmetry.observation:
        task = _seen(b, task, symmetry)
    if symmetry.action:
        return _steered(b, task, symmetry)
    return task


def _declared(task: Task, name: str) -> Symmetry:
    known = entries_by_name(task.unmodified.annotations.symmetries)
    if name not in known:
        reason = "it declares no symmetries"
        if known:
            reason = f"it declares no symmetry '{name}'"
        raise Inapplicable(reason, suggest(name, known) or (f"it has {', '.join(known)}" if known else None))
    return known[name]


# -- what is seen -------------------------------------------------------------------------------------------------


def _seen(b: Builder, task: Task, symmetry: Symmetry) -> Task:
    now = {}
    for c, node in zip(task.observation.components, task.observation.nodes, strict=True):
        now[c.name] = (c, node)
    for c in symmetry.seen:
        if c.name not in now or now[c.name][0].type != c.type:
            hint = "give the symmetry before modifiers of what is observed"
            raise Inapplicable(f"'{c.name}' is no longer observed as the symmetry expects", hint)
    seen = [now.pop(c.name)[0] for c in symmetry.seen]
    moves = parts(Role.NEXT, seen, symmetry.observation)
    if any(part.clash() is not None for part in moves):
        raise Inapplicable("it is not one-to-one: two observations would look alike", "`taskspec check` shows two")
    components = _bounded(symmetry.components, moves)
    _check_space(task, components)
    shown = by_read(Role.NEXT, task.observation.components, task.observation.nodes)
    nodes = b.substitute(symmetry.observation, shown)
    taken = (core.names_in(task) - set(now)) | set(all_names(components))
    other_names = core.fresh(list(now), taken)
    every = list(components)
    values = list(nodes)
    for name, (c, node) in zip(other_names, now.values(), strict=True):
        every.append(replace(c, name=name))
        values.append(node)
    return core.observing(b, task, every, values, task.observation.space, {})


def _bounded(components: Sequence[Component], moves: Sequence[MapPart]) -> list[Component]:
    made = list(components)
    for part in moves:
        ends = list(bounds(part))
        for i in part.outputs if part.is_decided else ():
            own = ends[: made[i].type.size]
            ends = ends[made[i].type.size :]
            if own:
                low, high = zip(*own, strict=True)
            else:
                low, high = ((), ())
            made[i] = replace(made[i], low=low, high=high)
    return made


def _check_space(task: Task, components: Sequence[Component]) -> None:
    """Refuse (Inapplicable) reals where the spec's space has none, and several numbers where it has one."""
    space = task.observation.space
    if space in FINITE_SPACES and not are_finite(components):
        raise Inapplicable(f"a `{space}` observation holds no reals")
    if space == "discrete" and not (len(components) == 1 and components[0].type.is_scalar):
        raise Inapplicable("a `discrete` observation is one number")


# -- what is done -------------------------------------------------------------------------------------------------


def _steered(b: Builder, task: Task, symmetry: Symmetry) -> Task:
    moves = parts(Role.ACTION, task.action, symmetry.action, is_tied=True)
    executed: dict[str, Node] = {}
    for part in moves:
        own = [symmetry.action[i] for i in part.outputs]
        if all(isinstance(n, Read) and n.name == c.name for n, c in zip(own, part.inputs, strict=True)):
            continue
        if not part.is_decided:
            raise Inapplicable(
                "it could not be shown to be one-to-one on the actions: there are too many, and it does more than permute them"
            )
        if part.clash() is not None or outside(part) is not None:
            raise Inapplicable("it is not one-to-one in the actions", "`taskspec check` shows where")
        executed |= zip(all_names(part.inputs), _undone(b, part), strict=True)
    expert = task.annotations.expert
    if isinstance(expert, tuple):
        expert = b.substitute(symmetry.action, by_read(Role.ACTION, task.action, expert))
    every = {}
    for c in task.action:
        every[c.name] = executed.get(c.name) or core.present(b, c, Role.ACTION)
    plain = tuple(replace(c, domain=None) if c.name in executed else c for c in task.action)
    changed = replace(task, action=plain).with_annotations(expert=expert)
    return core.meaning(b, changed, every)


def _undone(b: Builder, part: MapPart) -> list[Node]:
    given = [core.present(b, c, Role.ACTION) for c in part.inputs]
    if part.moves is not None:
        return _moved_back(b, part.inputs, given, part.moves)
    core.combinations(part.inputs, "the actions of a symmetry", core.MOST)
    back = np.argsort(codes(part)).tolist()
    return core.apart(b, part.inputs, back, core.joint(b, part.inputs, given))


def _moved_back(b: Builder, components: Sequence[Component], given: Sequence[Node], moves: Moves) -> list[Node]:
    flat = []
    for node in given:
        flat += core.elements(b, node)
    own: dict[int, Node] = {}
    for node, source, sign, shift in zip(flat, moves.source, moves.sign, moves.shift, strict=True):
        moved = node
        if shift:
            moved = b.apply("sub", node, b.scalar(int(shift)))
        if sign < 0:
            own[int(source)] = b.apply("neg", moved)
        else:
            own[int(source)] = moved
    original = []
    at = 0
    for c in components:
        values = [own[at + i] for i in range(c.type.size)]
        if c.type.kind is Kind.INT:
            for i in range(c.type.size):
                values[i] = b.within(values[i], c.low[i], c.high[i])
        original.append(core.shaped(b, values, c.type))
        at += c.type.size
    return original


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
                             sample=lambda task: task.annotations.symmetries[0].name if task.annotations.symmetries else "none"),
        ),
        "Observations or actions are transformed as the spec declares under `symmetries`.",
        _twin, _says, keeps="all returns", observed=always, abstraction=as_well, needs="a spec that declares it",
    ),
)  # fmt: skip
