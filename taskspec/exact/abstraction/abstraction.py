"""Abstractions and symmetries of tasks, and bisimulation.

An abstraction maps every state of a task to one of a finite stand-in with the same actions. It is faithful, a homomorphism, if
rewards, terminations and the distribution of the next mapped state depend on the mapped state alone; then values, and returns
of policies of the mapped state, are those of the task itself (`verify`).

Bisimulation partitions states into classes that no sequence of actions tells apart. Level k has the classes of states that no k
actions tell apart. The classes of level k + 1 follow from those of level k, until their number stays the same (R. Givan, T. Dean
and M. Greig, Equivalence notions and model minimization in Markov decision processes, Artificial Intelligence 147, 2003).

A symmetry keeps returns if observations and actions are mapped one-to-one: a policy of the task then corresponds to one of its
twin that does the same in every state; it inverts the map of observations, and maps its actions. This is proved for all values,
or from the form of the expressions (`task.bijection`). Otherwise a map is applied repeatedly to random points; if all of them
return to themselves, it is tested.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector
from taskspec.base.named import all_names
from taskspec.exact.model.extract import extract as model_of
from taskspec.exact.model.model import Model
from taskspec.exact.model.points import SAMPLES, sampled
from taskspec.exact.model.space import shown
from taskspec.exact.rollout.rollout import reads_of
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.types import Expression, Role
from taskspec.language.modifiers import stand_in as modified_stand_in
from taskspec.language.registry import load
from taskspec.language.task.bijection import MapPart, outside, parts
from taskspec.language.task.build import build_abstract
from taskspec.language.task.context import assign
from taskspec.language.task.parts import Component, Symmetry
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


Rows = Sequence[Sequence[Mapping[Any, Any]]]
"""The outcomes of each state and action, (next state, reward, whether the episode ends there), with their probabilities."""


def levels(rows: Rows, labels: Sequence[Hashable], depth: int | None = None) -> list[list[int]]:
    """Partition states into classes that no k actions tell apart, for k = 0, 1, ...

    Args:
        rows: outcomes of each state and action.
        labels: observation of each state, (S,).
        depth: the last level; None for all, up to the classes of bisimulation.

    Returns:
        the class of each state (S,) at each level; level 0 are the labels.
    """
    classes = [_numbered(labels)]
    while depth is None or len(classes) <= depth:
        classes.append(_refined(rows, classes))
        if max(classes[-1], default=0) == max(classes[-2], default=0):
            break
    return classes


def classes_from(steps: Iterable[Rows], labels: Sequence[Hashable]) -> list[int]:
    """Partition states into classes that no actions tell apart, in steps whose outcomes depend on the time.

    Args:
        steps: outcomes of each state and action, from the last step to the first.
        labels: observation of each state, (S,).

    Returns:
        the class of each state (S,) at the first step.
    """
    classes = [_numbered(labels)]
    for rows in steps:
        classes.append(_refined(rows, classes, labels))
    return classes[-1]


def _refined(rows: Rows, classes: Sequence[Sequence[int]], labels: Sequence[Hashable] | None = None) -> list[int]:
    if labels is None:
        labels = classes[-1]
    level = len(classes) - 1
    return _numbered([(labels[s], signature(rows, classes, level, s)) for s in range(len(rows))])


def _numbered(keys: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(key, len(numbers)) for key in keys]


def signature(rows: Rows, classes: Sequence[Sequence[int]], level: int, s: int) -> tuple[Hashable, ...]:
    """Outcomes of each action in a state, with the classes of next states at a level; of last states only the labels."""
    by_action = []
    for outcomes in rows[s]:
        merged: Counter[Hashable] = Counter()
        for (to, reward, ends), p in outcomes.items():
            seen_at = 0 if ends else level
            merged[reward, ends, classes[seen_at][to]] += p
        by_action.append(frozenset(merged.items()))
    return tuple(by_action)


def apart(rows: Rows, classes: Sequence[Sequence[int]], one: int, other: int) -> list[int]:
    """Search for a shortest sequence of actions after which two states differ.

    Args:
        rows: outcomes of each state and action.
        classes: of each level, as `levels` gives them.
        one: a state.
        other: a state of another class.

    Returns:
        actions; none where the labels differ. Where actions have several outcomes, it is a sequence for one of these.
    """
    level = _first_level(classes, one, other)
    actions: list[int] = []
    while level > 0:
        level -= 1
        mine = signature(rows, classes, level, one)
        theirs = signature(rows, classes, level, other)
        a = next(a for a in range(len(mine)) if mine[a] != theirs[a])
        actions.append(a)
        pair = _later(rows, classes[level], a, one, other)
        if pair is None:
            break
        one, other = pair
        level = _first_level(classes, one, other)
    return actions


def _first_level(classes: Sequence[Sequence[int]], one: int, other: int) -> int:
    return next(k for k, of_states in enumerate(classes) if of_states[one] != of_states[other])


def _later(rows: Rows, classes: Sequence[int], a: int, one: int, other: int) -> tuple[int, int] | None:
    """Two next states of different classes after the same reward; None where the outcomes themselves differ."""
    mine = {(reward, ends): to for to, reward, ends in rows[one][a]}
    theirs = {(reward, ends): to for to, reward, ends in rows[other][a]}
    if set(mine) != set(theirs):
        return None
    for key, to in mine.items():
        if not key[1] and classes[to] != classes[theirs[key]]:
            return to, theirs[key]
    return None


ROUNDS = 12
"""Applications of a map after which values have to return to themselves."""


@dataclass(frozen=True)
class SymmetryCheck:
    """The result of the verification of a symmetry.

    Args:
        points: at which it was tested; 0 if it is proved.
        problem: two values with one image, or the reason for which it could not be shown; None if there is none.
    """

    symmetry: Symmetry
    points: int = 0
    problem: str | None = None

    @property
    def is_proved(self) -> bool:
        return self.problem is None and not self.points

    def record(self) -> dict[str, Any]:
        """Write the result as JSON data."""
        status = "tested"
        if self.problem is not None:
            status = "false"
        elif self.is_proved:
            status = "proved"
        return {"symmetry": self.symmetry.name, "status": status, "detail": self.problem or "", "points": self.points}


def verify_symmetry(task: Task, symmetry: Symmetry) -> SymmetryCheck:
    """Prove that a symmetry keeps returns, or test it.

    Args:
        task: the task that declares it.
        symmetry: a map of observations and actions.
    """
    problem = _of_actions(task, symmetry)
    if problem is not None or not symmetry.observation:
        return SymmetryCheck(symmetry, 0, problem)
    points = 0
    for part in parts(Role.NEXT, symmetry.seen, symmetry.observation):
        clash = part.clash()
        if clash is not None:
            problem = f"{in_words(symmetry.seen, clash[0])} and {in_words(symmetry.seen, clash[1])} look alike"
        elif not part.is_decided:
            problem = _returning(symmetry, part)
            points = SAMPLES
        if problem is not None:
            break
    return SymmetryCheck(symmetry, points, problem)


def _of_actions(task: Task, symmetry: Symmetry) -> str | None:
    if not symmetry.action:
        return None
    for part in parts(Role.ACTION, task.action, symmetry.action, is_tied=True):
        if not part.is_decided:
            names = " and ".join(f"'{c.name}'" for c in part.inputs)
            return f"its map of {names} does more than to move elements about, and there are too many values to try"
        pair = outside(part)
        clash = part.clash()
        if pair is not None:
            return f"the action {in_words(task.action, pair[0])} becomes {in_words(task.action, pair[1])}, where actions end"
        if clash is not None:
            return f"{in_words(task.action, clash[0])} and {in_words(task.action, clash[1])} become the same action"
    return None


def _returning(symmetry: Symmetry, part: MapPart) -> str | None:
    """Apply a part of a map of observations repeatedly to random points: a problem, or None if all of them return."""
    nodes: dict[str, Expression] = {symmetry.components[i].name: symmetry.observation[i] for i in part.outputs}
    names = all_names(part.inputs)
    if not names:
        return "it shows a value that is not finite"
    if sorted(nodes) != sorted(names) or any(nodes[c.name].type.shape != c.type.shape for c in part.inputs):
        return f"it shows other things than {', '.join(names)}, so that it is not known to be one-to-one"
    rng = np.random.default_rng(0)
    first = {c.name: sampled(c, SAMPLES, rng) for c in part.inputs}
    now = first
    for _ in range(ROUNDS):
        read = {(Role.NEXT, name): value for name, value in now.items()}
        now = dict(zip(names, evaluate([nodes[n] for n in names], read), strict=True))
        apart = np.zeros(SAMPLES, np.bool_)
        for name, value in first.items():
            same = np.isclose(np.broadcast_to(now[name], value.shape), value, rtol=1e-9, atol=1e-9)
            apart |= ~same.reshape(-1, SAMPLES).all(axis=0)
        if not apart.any():
            return None
    state = in_words(part.inputs, first, int(np.flatnonzero(apart)[0]))
    problem = f"{state} does not return to itself when it is applied {ROUNDS} times"
    return f"{problem}, so it could not be shown to be one-to-one"
