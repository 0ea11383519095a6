"""Prove or test that declared symmetries keep returns: that observations and actions are mapped one-to-one.

A policy of the task then corresponds to one of its twin that does the same in every state: it inverts the map of observations,
and maps its actions. So returns are kept for any dynamics if no observation is lost, and actions are mapped onto actions. This
is proved for all values, or from the form of the expressions (`task.bijection`). Otherwise a map is applied repeatedly to random
points; if all of them return to themselves, it is tested.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.named import all_names
from taskspec.exact.abstraction.abstraction import in_words
from taskspec.exact.model.points import SAMPLES, sampled
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import Expression, Role
from taskspec.language.task.bijection import MapPart, outside, parts
from taskspec.language.task.parts import Symmetry
from taskspec.language.task.task import Task

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
