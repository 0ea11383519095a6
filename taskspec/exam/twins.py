"""Twins: the same task in other words, where a learner that is right earns the same, and one that is right by luck does not."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.data import demonstrations
from taskspec.diagnostics import SpecError
from taskspec.modifiers import modify
from taskspec.task.task import Task

Modifiers = tuple[str, ...]
Labels = np.ndarray[Any, Any]
TRIED = 16
"""Seeds that twins are chosen from, at least."""
EPISODES = 8
"""Of the expert, that show what it does in the states where it comes."""


@lru_cache(maxsize=64)
def twins_of(task: Task, wanted: int) -> tuple[Modifiers, ...]:
    """The modifiers of each twin; none where the task has no twins.

    Of finite tasks the states are renamed, and in each state anew what the actions do is permuted, by a seed. Seeds are chosen
    among the first ones: such that no constant action is the expert's, where that can be, and that from twin to twin its actions
    differ in as many states as possible. Other tasks are seen and steered by the symmetries that they declare.
    """
    try:
        modify(task, *_modifiers(1))
    except SpecError as error:
        if {d.code for d in error.diagnostics} <= {"E720"}:
            return tuple((f"symmetry={each.name}",) for each in task.symmetries[:wanted])
        raise
    if not wanted:
        return ()
    known = {seed: _labels(task, seed) for seed in range(1, max(TRIED, 2 * wanted) + 1)}
    varied = [seed for seed, labels in known.items() if (labels != labels[0]).any()]
    left = varied if len(varied) >= wanted else list(known)
    chosen = [left[0]]
    while len(chosen) < wanted:
        others = [seed for seed in left if seed not in chosen]
        chosen.append(max(others, key=lambda seed: min(int((known[seed] != known[c]).sum()) for c in chosen)))
    return tuple(_modifiers(seed) for seed in chosen)


def _modifiers(seed: int) -> Modifiers:
    return _permuted(seed), f"relabelled={seed}"


def _permuted(seed: int) -> str:
    return f"permuted_actions={seed},per_state=true"


def _labels(task: Task, seed: int) -> Labels:
    """What the expert's actions are called, (steps,), in the steps of some episodes, which are the same under every seed."""
    twin = modify(task, _permuted(seed))
    policy = "optimal" if twin.expert is None else "expert"
    return np.asarray(demonstrations(twin, policy, episodes=EPISODES).acts)
