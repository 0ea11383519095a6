"""Which way a move goes on a grid: what its label says, or where it mostly leads."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from taskspec.exact.model.space import Space
from taskspec.exact.model.transitions import Steps
from taskspec.lang.ir import Role
from taskspec.task.task import Task

Cell = tuple[int, int]
Way = tuple[float, float]
_WORDS: dict[str, Cell] = {
    "left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1), "west": (-1, 0), "east": (1, 0), "north": (0, -1),
    "south": (0, 1), "stay": (0, 0), "wait": (0, 0), "noop": (0, 0),
}  # fmt: skip


def chosen_ways(
    task: Task, policy: Mapping[int, tuple[int, ...]], cells: Mapping[int, Cell]
) -> Iterator[tuple[Cell, Way]]:
    """From each state's cell the ways of the actions that a policy takes there.

    Labels such as `left` or `down_right` say it. Other actions go where they lead in more than half of all cases, and
    nowhere where no outcome is that likely: an outcome of chance is no choice. From a cell of several states, only the
    ways that are taken in all of them.
    """
    said = [_said(task, i) for i in range(Space(task.action, Role.ACTION).size)]
    pairs = [(code, action) for code, actions in policy.items() for action in actions]
    ways = [way for way in said if way is not None]
    known = len(ways) == len(said)
    found = ((code, ways[action]) for code, action in pairs) if known else _led(task, pairs, cells)
    taken: dict[int, dict[Way, None]] = {code: {} for code in policy}
    for code, way in found:
        taken[code] |= {way: None} if any(way) else {}
    alike: dict[Cell, dict[Way, None]] = {}
    for code, some in taken.items():
        cell = cells[code]
        alike[cell] = {way: None for way in alike[cell] if way in some} if cell in alike else some
    yield from ((cell, way) for cell, some in alike.items() for way in some)


def _said(task: Task, action: int) -> Way | None:
    """The way that the label of an action says, as a step of at most one cell; None where it says none."""
    if len(task.action) != 1 or task.action[0].domain is None:
        return None
    words = re.split(r"[^a-z]+", task.action[0].domain.labels[action].lower())
    if not all(word in _WORDS for word in words):
        return None
    dx, dy = (sum(_WORDS[word][axis] for word in words) for axis in (0, 1))
    return float(np.sign(dx)), float(np.sign(dy))


def _led(task: Task, pairs: list[tuple[int, int]], cells: Mapping[int, Cell]) -> Iterator[tuple[int, Way]]:
    """Where actions lead in more than half of all cases, by the code of the state."""
    if not pairs:
        return  # no overlay asks for a policy
    codes, actions = np.array(pairs, np.int64).reshape(-1, 2).T
    weights: dict[tuple[int, Cell], float] = {}
    for o in Steps(task).outcomes(codes, actions, 0):
        origin = np.arange(len(codes)) if o.origin is None else o.origin
        weight, target = (np.broadcast_to(x, origin.shape) for x in (o.weight, o.code))
        for point, p, code in zip(origin.tolist(), weight.tolist(), target.tolist(), strict=True):
            key = (point, cells[code])
            weights[key] = weights.get(key, 0.0) + p
    for (point, (bx, by)), p in weights.items():
        if p > 0.5:
            code = pairs[point][0]
            ax, ay = cells[code]
            length = max(abs(bx - ax), abs(by - ay)) or 1
            yield code, ((bx - ax) / length, (by - ay) / length)
