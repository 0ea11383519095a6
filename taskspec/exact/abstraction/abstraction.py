"""Abstractions: maps of every state of a task to one of a finite stand-in with the same actions.

An abstraction is faithful, a homomorphism, if rewards, terminations and the distribution of the next mapped state depend on
the mapped state alone; then values, and returns of policies of the mapped state, are those of the task itself (`verify`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector
from taskspec.base.named import all_names
from taskspec.exact.model.extract import extract as model_of
from taskspec.exact.model.model import Model
from taskspec.exact.model.space import shown
from taskspec.exact.rollout.rollout import reads_of
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.types import Expression
from taskspec.language.modifiers import stand_in as modified_stand_in
from taskspec.language.registry import load
from taskspec.language.task.build import build_abstract
from taskspec.language.task.context import assign
from taskspec.language.task.parts import Component
from taskspec.language.task.questions import scope, written_in
from taskspec.language.task.task import Task, TaskLike


@dataclass(frozen=True)
class Abstraction:
    """A task, its finite stand-in, and the expressions that map a state to the stand-in's, in order of its components."""

    task: Task
    stand_in: Task
    nodes: tuple[Expression, ...]

    def map(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Map states, (*shape, lanes) by component, to states of the stand-in, (*shape, lanes) by component."""
        lanes = next(iter(state.values())).shape[-1]
        values = evaluate(self.nodes, reads_of(state, {}, 0))
        mapped = {}
        for name, value in zip(all_names(self.stand_in.state), values, strict=True):
            mapped[name] = np.broadcast_to(value, (*value.shape[:-1], lanes))
        return mapped


def extract(task: TaskLike, reachable: bool | None = None, limit: int | None = None) -> Model:
    """Extract the exact model of a finite task, or of its abstraction if the spec gives one: the model behind its scores.

    Args:
        task: the task, its id or its path.
        reachable: only states that episodes enter (True), or all declared ones (False); None takes
            all if that is cheap.
        limit: non-zeros that the matrices may have, 12 bytes each; checked, like the time, in advance.

    Returns:
        the model: sparse transition probabilities and expected rewards, float64, for S states and A actions.

    Raises:
        SpecError: E712 where the task is not finite, or too large.
    """
    task = load(task)
    declared = abstraction(task)
    if declared is not None:
        task = declared.stand_in
    return model_of(task, reachable, limit)


def abstraction(task: Task) -> Abstraction | None:
    """Build the abstraction that a task declares; None without one."""
    if task.annotations.memory is not None or task.annotations.remembers:  # the map does not read the memory
        task = task.with_annotations(expert=None, memory=None)
    written = written_in(task, "abstraction")
    if written is None:
        return None
    as_written = build_abstract(task)
    stand_in = None
    if as_written is not None:
        stand_in = modified_stand_in(task, as_written)
    if stand_in is None:
        return None
    checker = Checker(task.new_builder(), Collector())
    visible = scope(task, "abstraction")
    nodes = []
    for c in stand_in.state:
        if c.name not in written:
            return None
        node = assign(checker, written[c.name], visible, c)
        if node is None:
            return None
        nodes.append(node)
    return Abstraction(task, stand_in, tuple(nodes))


def in_words(components: Iterable[Component], values: Mapping[str, Array], lane: int | None = None) -> str:
    """Write values of components in words, as `x = 2, y = 0`.

    Args:
        components: in this order; those without a value are left out.
        values: by name, (*shape) or (*shape, lanes).
        lane: the lane to be written, where values have a batch axis.
    """
    words = []
    for c in components:
        if c.name in values:
            value = values[c.name]
            if lane is not None:
                value = value[..., lane]
            words.append(f"{c.name} = {shown(c, value)}")
    return ", ".join(words)
