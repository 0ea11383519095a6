"""Changes of the parts of a task by modifiers: state added, actions and observations replaced, draws made."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from taskspec.base.named import all_names
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.ir import Draw, Node, draw_sites, draws, reads
from taskspec.language.expressions.types import INT, TIME, Kind, Role, Type
from taskspec.language.modifiers.entry import Inapplicable
from taskspec.language.task.bijection import parts
from taskspec.language.task.parts import Component, Observation, SpaceKind, counts_of
from taskspec.language.task.task import Task

MOST = 100_000
"""Combinations of values that are numbered in one table, at the most."""


# -- state --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AddedState:
    """A component that the state gets, with its first and its next value."""

    component: Component
    initial: Node
    following: Node


def names_in(task: Task) -> set[str]:
    memory = () if task.annotations.memory is None else task.annotations.memory.components
    names = set(all_names((*task.state, *task.action, *task.observation.components, *memory)))
    return names | set(all_names(task.parameters)) | set(task.source.constants)


def fresh(wanted: Sequence[str], taken: Iterable[str]) -> list[str]:
    """Lengthen the wanted names until none is taken and no two are the same."""
    known = set(taken)
    names = []
    for name in wanted:
        while name in known:
            name += "_"
        known.add(name)
        names.append(name)
    return names


def with_state(task: Task, added: Sequence[AddedState]) -> Task:
    """Add components to the state, which the task does not observe."""
    initial = tuple(a.initial for a in added)
    following = tuple(a.following for a in added)
    changed = task.with_process(
        initial=(*task.process.initial, *initial),
        raw_initial=(*task.process.raw_initial, *initial),
        next=(*task.process.next, *following),
        raw_next=(*task.process.raw_next, *following),
    )
    state = (*task.state, *(a.component for a in added))
    return replace(changed, state=state, observation=replace(task.observation, is_state=False))


def present(b: Builder, c: Component, role: Role = Role.STATE) -> Node:
    return b.read(role, c.name, c.type, c.least, c.most)


def inside(b: Builder, c: Component) -> Node:
    """Choose a fixed value of a component: the one nearest to 0."""
    flat = []
    for low, high in zip(c.low, c.high, strict=True):
        flat.append(min(max(0, low), high))
    return b.constant(flat, c.type)


def noisy(b: Builder, node: Node, std: float) -> Node:
    """Add independent normal noise to each element of a value."""
    noise = DISTS["Normal"].build(b, {"mean": b.scalar(0), "std": b.scalar(std)}, node.type.shape)
    return b.apply("add", b.cast(node, Kind.REAL), noise)


# -- steps --------------------------------------------------------------------------------------------------------


def acting(b: Builder, task: Task, executed: Mapping[str, Node]) -> Task:
    """Execute other actions, by name, than those that are chosen."""
    count = len(task.state)
    roots = (*task.process.raw_next, *task.process.step_roots)
    changed = b.substitute(roots, {(Role.ACTION, name): node for name, node in executed.items()}, late=False)
    return task.with_process(
        raw_next=changed[:count],
        next=changed[count : 2 * count],
        reward=changed[2 * count],
        terminal=changed[2 * count + 1],
        measures=dict(zip(task.process.measures, changed[2 * count + 2 :], strict=True)),
    )


def meaning(b: Builder, task: Task, meant: Mapping[str, Node]) -> Task:
    """Replace each action by another one, by name; the expert remembers the meant ones."""
    reads = {}
    for name, node in meant.items():
        reads[(Role.ACTION, name)] = node
    changed = acting(b, task, meant)
    if task.process.legal is not None:
        changed = changed.with_process(legal=b.substitute([task.process.legal], reads)[0])
    return remembering(b, changed, reads)


def drawing(task: Task, drawn: Mapping[int, Draw]) -> Task:
    return task.with_process(step_draws=(*task.process.step_draws, *drawn.values()))


def last(b: Builder, task: Task) -> Node:
    if task.horizon is None:
        return task.process.terminal
    time = b.read(Role.TIME, "t", INT, 0, task.horizon - 1)
    return b.apply("or", task.process.terminal, b.apply("eq", time, b.scalar(task.horizon - 1)))


def reads_time(task: Task) -> bool:
    expert = task.annotations.expert_nodes
    roots = (
        *task.process.step_roots,
        task.process.absorbing_reward,
        *task.observation.nodes,
        *expert,
    )
    return TIME in reads(roots)


def paying(b: Builder, task: Task, reward: Node) -> Task:
    return task.with_process(reward=b.cast(reward, Kind.REAL))


# -- observations -------------------------------------------------------------------------------------------------


def observing(
    b: Builder,
    task: Task,
    components: Sequence[Component],
    nodes: Sequence[Node],
    space: SpaceKind,
    drawn: Mapping[int, Draw],
    meant: Mapping[str, Node] | None = None,
) -> Task:
    """Replace the observations, for which more is drawn at resets and in steps.

    Earlier observations, by name, are `meant` as functions of the present ones. An expert that remembers something else
    of it is left out.
    """
    if meant is None:
        meant = {}
    now = list(zip(components, nodes, strict=True))
    before = zip(task.observation.components, task.observation.nodes, strict=True)
    lost = set()
    for c, node in before:
        if (c, node) not in now and c.name not in meant:
            lost.add((Role.NEXT, c.name))
    changed = task.with_process(
        reset_draws=(*task.process.reset_draws, *drawn.values()), step_draws=(*task.process.step_draws, *drawn.values())
    )
    changed = replace(changed, observation=Observation(tuple(components), tuple(nodes), space))
    if task.annotations.memory is not None and lost & reads(
        (*task.annotations.memory.initial, *task.annotations.memory.next)
    ):
        return forgetting(changed)
    return remembering(b, changed, {(Role.NEXT, name): node for name, node in meant.items()})


def real_space(task: Task) -> SpaceKind:
    """Space of observations that contain reals: a dictionary where they are one, else a box."""
    if task.observation.space == "dict":
        return "dict"
    return "box"


def shows_the_state(task: Task) -> bool:
    """Test whether no two states are known to look alike at any time; draws do not count."""
    nodes = []
    for n in task.observation.nodes:
        if not draws([n]) and TIME not in reads([n]):
            nodes.append(n)
    return all(part.is_decided and part.clash() is None for part in parts(Role.STATE, task.state, nodes))


def informative(task: Task) -> Observation:
    """Drop noise from the observation that is independent of the steps and of everything else in it."""
    known = moving_draws(task)
    for node in task.observation.nodes:
        if reads([node]):
            known |= draw_sites([node])
    size = -1
    while size < len(known):  # noise that is seen twice tells what is hidden behind it
        size = len(known)
        for node in task.observation.nodes:
            if draw_sites([node]) & known:
                known |= draw_sites([node])
    shown = zip(task.observation.components, task.observation.nodes, strict=True)
    kept = []
    for c, node in shown:
        if not draws([node]) or draw_sites([node]) & known:
            kept.append((c, node))
    return replace(task.observation, components=tuple(c for c, _ in kept), nodes=tuple(node for _, node in kept))


def moving_draws(task: Task) -> set[int]:
    """Sites of draws on which first and next states, rewards and ends depend."""
    process = task.process
    return draw_sites((*process.initial, *process.next, process.reward, process.terminal))


def sees_moving_draws(task: Task) -> bool:
    return bool(moving_draws(task) & draw_sites(task.observation.nodes))


def storing_observations(task: Task) -> Task:
    """Store random observations in the state, so that each state has one observation.

    Noise that tells nothing is not observed any more.
    """
    shown = informative(task)
    first = dict(zip(task.observation.nodes, task.first_observation, strict=True))
    later = dict(zip(task.observation.nodes, task.next_observation, strict=True))
    b = task.new_builder()
    nodes = list(shown.nodes)
    added = []
    names = fresh([c.name for c in shown.components], all_names(task.state))
    for i, c in enumerate(shown.components):
        if draws([nodes[i]]):
            stored = replace(c, name=names[i])
            added.append(AddedState(stored, first[nodes[i]], later[nodes[i]]))
            nodes[i] = present(b, stored)
    return replace(with_state(task, added), observation=replace(shown, nodes=tuple(nodes)))


# -- what an expert remembers -------------------------------------------------------------------------------------


def remembering(b: Builder, task: Task, meant: Mapping[tuple[Role, str], Node]) -> Task:
    """Let the expert remember the meant action or observation; drop the expert where it is unknown."""
    memory = task.annotations.memory
    if memory is None or not meant:
        return task

    changed = replace(
        memory,
        initial=b.substitute(memory.initial, meant),
        next=b.substitute(memory.next, meant),
        raw_initial=b.substitute(memory.raw_initial, meant),
        raw_next=b.substitute(memory.raw_next, meant),
    )
    result = task.with_annotations(memory=changed)
    if remembers_what_is_told(result):
        return result
    return forgetting(task)


def remembers_what_is_told(task: Task) -> bool:
    """Test whether an expert's memory, if there is one, reads the observation, and later itself, action and time."""
    memory = task.annotations.memory
    if memory is None:
        return True
    seen = set()
    for c in task.observation.components:
        seen.add((Role.NEXT, c.name))
    own = {c.read for c in memory.components} | {(Role.ACTION, c.name) for c in task.action} | {TIME}
    return reads(memory.initial) <= seen and reads(memory.next) <= seen | own


def forgetting(task: Task) -> Task:
    changed = task.with_annotations(memory=None)
    if isinstance(task.annotations.expert, tuple):
        return changed.with_annotations(expert=None)
    return changed


# -- joint indices ------------------------------------------------------------------------------------------------


def combinations(components: Sequence[Component], what: str, most: int = MOST) -> int:
    """Count the values that some components have together.

    Raises:
        Inapplicable: infinitely many, or more than `most`.
    """
    for c in components:
        if not c.is_finite:
            raise Inapplicable(f"{what} must be finite, and '{c.name}' has infinitely many values")
    size = math.prod(counts_of(components))
    if size > most:
        raise Inapplicable(f"{what} can take {size:,} values; the limit is {most:,}")
    return size


def joint(b: Builder, components: Sequence[Component], nodes: Sequence[Node]) -> Node:
    """Compute the number of a combination of values, the first element of the first component slowest."""
    code: Node = b.scalar(0)
    for c, node in zip(components, nodes, strict=True):
        for element, low, count in zip(elements(b, node), c.low, c.counts, strict=True):
            digit = b.within(b.apply("sub", b.cast(element, Kind.INT), b.scalar(int(low))), 0, count - 1)
            code = b.apply("add", b.apply("mul", code, b.scalar(count)), digit)
    return code


def apart(b: Builder, components: Sequence[Component], table: Sequence[int], row: Node) -> list[Node]:
    """Inverse of `joint`: values of the components whose number a table (N,) has at a row."""
    rest = math.prod(counts_of(components))
    parts = []
    for c in components:
        digits = []
        for low, count in zip(c.low, c.counts, strict=True):
            rest //= count
            values = []
            for code in table:
                values.append(int(low) + code // rest % count)
            digit = looked_up(b, values, row)
            digits.append(b.apply("lt", b.scalar(0), digit) if c.type.kind is Kind.BOOL else digit)
        parts.append(shaped(b, digits, c.type))
    return parts


def looked_up(b: Builder, values: Sequence[Any], row: Node) -> Node:
    table = b.const(tuple(values), Type(Kind.INT, (len(values),)))
    return b.structure("index", [table, b.position(row, len(values))])


def elements(b: Builder, node: Node) -> list[Node]:
    if node.type.is_scalar:
        return [node]
    flat = b.structure("reshape", [node], (node.type.size,))
    return [b.structure("element", [flat], (i,)) for i in range(node.type.size)]


def shaped(b: Builder, flat: Sequence[Node], type: Type) -> Node:
    """Inverse of `elements`: a value of a type from its elements, row-major."""
    if type.is_scalar:
        return flat[0]
    return b.structure("reshape", [b.structure("vector", flat)], type.shape)
