"""Whether the symmetries that a task declares keep returns: whether what is seen, and what is done, are mapped one-to-one.

A policy of the task then has one of its twin that does the same in every state, and the other way round: it undoes the map of
what it sees, and maps what it does. So returns are kept, whatever the dynamics, as soon as nothing that was seen is lost, and
actions are mapped onto actions. This is proved of all values, or from the form of the expressions (`task.bijection`). Elsewhere a
map is applied to random points over and over; when all of them come back, it is tested, and no more.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, Role
from taskspec.model.points import SAMPLES, sampled
from taskspec.model.space import shown
from taskspec.task.bijection import MapPart, outside, parts
from taskspec.task.merge import merge
from taskspec.task.parts import Component, Symmetry
from taskspec.task.task import Task

ROUNDS = 12
"""How often a map is applied until values have to be back."""


@dataclass(frozen=True)
class Kept:
    """What is known of a symmetry.

    `problem` says where it is not one-to-one, or why that is not known (None: nowhere that was looked at). Otherwise returns are
    proved to be kept where `points` is 0, and it was tested at that many.
    """

    symmetry: Symmetry
    points: int = 0
    problem: str | None = None

    @property
    def is_proved(self) -> bool:
        return self.problem is None and not self.points


def kept(task: Task, symmetry: Symmetry) -> Kept:
    """Prove that a symmetry keeps returns, or test it."""
    problem = _of_actions(task, symmetry)
    points = 0
    for part in parts(Role.NEXT, symmetry.seen, symmetry.observation) if symmetry.observation else ():
        if problem is not None:
            break
        clash = part.clash()
        if clash is not None:
            problem = f"{_told(symmetry.seen, clash[0])} and {_told(symmetry.seen, clash[1])} look alike"
        elif not part.is_decided:
            problem, points = _returning(symmetry, part), SAMPLES
    return Kept(symmetry, points, problem)


def not_kept(task: Task, found: Iterable[Kept]) -> Iterator[Diagnostic]:
    """E605 for each symmetry of a task that is none."""
    for each in found:
        if each.problem is not None:
            name = each.symmetry.name
            place = merge(task.document, task.variant).key_span(("symmetries", name))
            yield Diagnostic("E605", place, f"'{name}' is not a symmetry: {each.problem}")


def _of_actions(task: Task, symmetry: Symmetry) -> str | None:
    """What is wrong with the map of the actions, or None."""
    for part in parts(Role.ACTION, task.action, symmetry.action, is_tied=True) if symmetry.action else ():
        if not part.is_decided:
            names = " and ".join(f"'{c.name}'" for c in part.inputs)
            return f"what it does to {names} is more than to move elements about, and there are too many values to try"
        found, clash = outside(part), part.clash()
        if found is not None:
            return (
                f"the action {_told(task.action, found[0])} becomes {_told(task.action, found[1])}, where actions end"
            )
        if clash is not None:
            return f"{_told(task.action, clash[0])} and {_told(task.action, clash[1])} become the same action"
    return None


def _told(components: Sequence[Component], values: Mapping[str, Array]) -> str:
    """A value in words, as `x = 2, y = 0`."""
    return ", ".join(f"{c.name} = {shown(c, values[c.name])}" for c in components if c.name in values)


# -- tests --------------------------------------------------------------------------------------------------------


def _returning(symmetry: Symmetry, part: MapPart) -> str | None:
    """Why a part of a map of what is seen may not be one-to-one; None where random points come back."""
    nodes: dict[str, Node] = {symmetry.components[i].name: symmetry.observation[i] for i in part.outputs}
    names = [c.name for c in part.inputs]
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
        apart = _apart(first, now)
        if not apart.any():
            return None
    lane = int(np.flatnonzero(apart)[0])
    return (
        f"{_told(part.inputs, {n: v[..., lane] for n, v in first.items()})} does not return to itself when it is applied "
        f"{ROUNDS} times, so it could not be shown to be one-to-one"
    )


def _apart(first: Mapping[str, Array], now: Mapping[str, Array]) -> Array:
    """Where (N,) values are not what they were."""
    found = np.zeros(SAMPLES, np.bool_)
    for name, value in first.items():
        same = np.isclose(np.broadcast_to(now[name], value.shape), value, rtol=1e-9, atol=1e-9)
        found |= ~same.reshape(-1, SAMPLES).all(axis=0)
    return found
