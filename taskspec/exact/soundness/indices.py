"""Indices that lie outside of their vectors, and are moved into them, in states in which episodes act."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model
from taskspec.exact.model.points import Samples, columns
from taskspec.exact.model.space import Reads
from taskspec.exact.rollout.rollout import visited
from taskspec.exact.soundness.phases import Check, CheckPhase, Examination
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Node, children, reads, walk
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.task.task import Task

POINTS = 100_000
"""States, actions and times that are evaluated, at most."""


@dataclass(frozen=True)
class MovedIndex:
    """An index that lies outside of a vector of `length` elements.

    `reads` are the values that the index depends on.
    """

    place: s.Place
    index: int
    length: int
    reads: Reads


def moved_indices(task: Task, model: Model | None) -> Iterator[MovedIndex]:
    """Yield an example of each index that lies outside where its value matters.

    Args:
        model: the exact model of the task, whose states are all tried; None tries those of a few episodes.
    """
    clamped = {id(m.node): m for m in task.source.surface.moved}
    if not clamped:
        return
    expert = task.annotations.expert_nodes
    step = (*task.process.raw_next, task.process.reward, task.process.terminal, *task.process.measures.values())
    for name, roots in (("observation", task.observation.nodes), ("expert", expert), ("step", step)):
        checked = {}
        for node, guard in _guards(roots, task.new_builder(roots)):
            if id(node) in clamped:
                m = clamped[id(node)]
                size = m.index.type.size
                check = Check("W510", m.index, (0,) * size, (m.length - 1,) * size, name, guards=(guard,))
                checked[check] = m
        if not checked:
            continue
        phase = CheckPhase(task, name, tuple(checked), Samples(_acting_points(task, model, roots), {}), False)
        for violation in Examination(phase).violations():
            m = checked[violation.check]
            del clamped[id(m.node)]
            values = violation.value.reshape(-1)
            index = int(values[(values < 0) | (values >= m.length)][0])
            needed = reads([m.index])
            known = {key: value for key, value in violation.reads.items() if key in needed}
            yield MovedIndex(m.place, index, m.length, known)


def _acting_points(task: Task, model: Model | None, roots: Sequence[Node]) -> Reads:
    """Return the values read at points at which episodes act: all if there is an exact model, otherwise samples."""
    if model is None:
        return visited(task).acting
    read = reads(roots)
    actions = 1
    if any(role is Role.ACTION for role, _ in read):
        actions = model.n_actions
    levels: Iterable[tuple[int, Array]] = [(0, model.acting)]
    if TIME in read or model.is_timed:
        levels = model.levels()
    parts = []
    left = POINTS
    for t, level in levels:
        codes = model.codes[level]
        every = np.arange(len(codes) * actions)[:left]
        left -= len(every)
        point = model.states.decode(codes[every % len(codes)], read) | model.actions.decode(every // len(codes), read)
        parts.append(point | {TIME: np.full(len(every), t)})
    return columns(parts)


def _guards(roots: Sequence[Node], b: Builder) -> Iterator[tuple[Node, Node]]:
    """Yield every node with the condition under which its value matters: not in a branch that is not taken."""
    never = b.scalar(False)
    guards: dict[int, Node] = {id(root): b.scalar(True) for root in roots}
    for node in reversed(list(walk(roots))):
        here = guards[id(node)]
        yield node, here
        needed = [here] * len(children(node))
        if isinstance(node, Apply) and node.op in ("where", "and", "or") and node.args[0].type.is_scalar:
            holds = node.args[0]
            fails = b.apply("not", holds)
            condition = holds
            if node.op == "or":
                condition = fails
            needed[1] = b.apply("and", here, condition)
            if node.op == "where":
                needed[2] = b.apply("and", here, fails)
        for child, guard in zip(children(node), needed, strict=True):
            guards[id(child)] = b.apply("or", guards.get(id(child), never), guard)
