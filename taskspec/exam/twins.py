"""Twins: the same task in other words, where a learner that is right earns the same, and one that is right by luck does not."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.data import demonstrations
from taskspec.modifiers import keeps_observers, modify
from taskspec.task.task import Task

Modifiers = tuple[str, ...]
Labels = np.ndarray[Any, Any]
TRIED = 16
"""Seeds that twins are chosen from, at least."""
WAYS = ("permuted_actions={seed},per_state=true", "permuted_actions={seed}")
"""How actions are permuted: the first way is taken that keeps what those can earn who see observations alone."""
EPISODES = 8
"""Of the expert, that show what it does in the states where it comes."""


@lru_cache(maxsize=64)
def twins_of(task: Task, wanted: int) -> tuple[Modifiers, ...]:
    """The modifiers of each twin; none where the task has no twins.

    Of finite tasks what is observed is renamed, and in each state anew what the actions do is permuted, by a seed. Where two
    states look alike, it is permuted in all states alike, so that those who see observations alone can earn what they could.
    Seeds are chosen among the first ones: such that no constant action is the expert's, where that can be, and that from twin to
    twin its actions differ in as many states as possible. Other tasks are seen and steered by the symmetries that they declare.
    """
    way = _way(task)
    if way is None:
        return tuple((f"symmetry={each.name}",) for each in task.symmetries[:wanted])
    if not wanted:
        return ()
    known = {seed: _labels(task, way, seed) for seed in range(1, max(TRIED, 2 * wanted) + 1)}
    varied = [seed for seed, labels in known.items() if (labels != labels[0]).any()]
    left = varied if len(varied) >= wanted else list(known)
    chosen = [left[0]]
    while len(chosen) < wanted:
        others = [seed for seed in left if seed not in chosen]
        chosen.append(max(others, key=lambda seed: min(int((known[seed] != known[c]).sum()) for c in chosen)))
    return tuple(_modifiers(way, seed) for seed in chosen)


def _way(task: Task) -> str | None:
    """How the actions of a task are permuted; None where they or what is observed cannot be renamed."""
    try:
        return next((way for way in WAYS if keeps_observers(task, *_modifiers(way, 1))), None)
    except SpecError as error:
        if {d.code for d in error.diagnostics} <= {"E720"}:
            return None
        raise


def _modifiers(way: str, seed: int) -> Modifiers:
    return way.format(seed=seed), f"relabelled={seed}"


def _labels(task: Task, way: str, seed: int) -> Labels:
    """What the expert's actions are called, (steps,), in the steps of some episodes, which are the same under every seed."""
    twin = modify(task, way.format(seed=seed))
    policy = "optimal" if twin.expert is None else "expert"
    return np.asarray(demonstrations(twin, policy, episodes=EPISODES).acts)
