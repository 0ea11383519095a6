"""Pairs of observations and actions that a learner from demonstrations imitated, read from its policy.

A learner that imitates converges to the frequencies of the expert's actions after each observation. Pairs that are wrong have
frequencies of their own, which are counted in the episodes that it was shown: the nearest ones name the mistake.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.task.task import Task
from taskspec.learn.data.episodes import Demonstrations
from taskspec.learn.exam.operators import APART
from taskspec.learn.observed_policies import observation_rows


@dataclass(frozen=True, eq=False)
class Shown:
    """Demonstrated episodes with discrete observations and actions, both counted from 0, and their numbers (O, A)."""

    obs: Array
    acts: Array
    next_obs: Array
    starts: Array
    shape: tuple[int, int]

    def frequencies(self, obs: Array, acts: Array, counts_if: Array | bool = True) -> Array:
        """Return the frequencies (O, A) of actions after each observation; equal ones after those that do not occur."""
        counts = np.zeros(self.shape)
        np.add.at(counts, (obs, acts), np.float64(counts_if))
        counts[counts.sum(axis=1) == 0] = 1.0
        return counts / counts.sum(axis=1, keepdims=True)

    @cached_property
    def is_last(self) -> Array:
        """Return bool (N,): whether a step is the last one of its episode."""
        last = np.zeros(len(self.obs), np.bool_)
        last[self.starts - 1] = True
        return last

    @cached_property
    def reversed_acts(self) -> Array:
        """The actions of each episode in reverse order."""
        return np.concatenate([part[::-1] for part in np.split(self.acts, self.starts[1:])])

    @cached_property
    def right(self) -> Array:
        return self.frequencies(self.obs, self.acts)

    def distance(self, one: Array, other: Array) -> float:
        """Return the total variation of two policies (O, A), in the mean over the observations that were shown."""
        apart = np.abs(one - other).sum(axis=1) / 2
        return float(apart[self.obs].mean())


PAIRINGS: dict[str, Callable[[Shown], Array]] = {
    "right": lambda shown: shown.right,
    "stale action": lambda shown: shown.frequencies(shown.next_obs, shown.acts),
    "action after": lambda shown: shown.frequencies(shown.obs[:-1], shown.acts[1:], ~shown.is_last[:-1]),
    "shuffled": lambda shown: np.tile(shown.right[shown.obs].mean(axis=0), (shown.shape[0], 1)),
    "order reversed": lambda shown: shown.frequencies(shown.obs, shown.reversed_acts),
    "first episode": lambda shown: shown.frequencies(shown.obs, shown.acts, shown.is_last.cumsum() <= shown.is_last),
    "last steps missing": lambda shown: shown.frequencies(shown.obs, shown.acts, ~shown.is_last),
    "avoided": lambda shown: (1 - shown.right) / (shown.shape[1] - 1),
    "at random": lambda shown: np.full(shown.shape, 1 / shown.shape[1]),
}
"""Policies (O, A) by the name of the mistake that makes a learner converge to them; the right one first."""


def shown_of(task: Task, demonstrations: Demonstrations) -> Shown:
    """Return demonstrations of a task with discrete observations and actions."""
    seen = task.observation_layout
    done = task.action_layout
    first = seen.starts[0]
    return Shown(
        demonstrations.obs - first, demonstrations.acts - done.starts[0], demonstrations.next_obs - first,
        np.asarray(demonstrations.starts), (seen.counts[0], done.counts[0]),
    )  # fmt: skip


def pairing_fields(task: Task, policy: Any, demonstrations: Demonstrations) -> dict[str, Any]:
    """Return how a policy compares with what was demonstrated, as fields of a result.

    Args:
        policy: what a learner returned.
        demonstrations: that it was shown.

    Returns:
        `pairings`: distances from `PAIRINGS`, 0 to 1, the total variation over what was demonstrated; a pairing that is right on
        this task is left out. `apart`: the distance from the right one. `worst_step`: the observation where it differs most, in
        words. Nothing where observations or actions are not discrete, or the policy gives no probabilities.
    """
    seen = task.observation_layout
    done = task.action_layout
    if seen.form != "discrete" or done.form != "discrete" or done.counts[0] < 2:
        return {}
    rows = observation_rows(task, policy)
    if rows is None:
        return {}
    shown = shown_of(task, demonstrations)
    distances = {}
    for name, pairing in PAIRINGS.items():
        paired = pairing(shown)
        if name == "right" or shown.distance(paired, shown.right) >= APART:
            distances[name] = shown.distance(rows, paired)
    excess = rows - shown.right
    excess[np.bincount(shown.obs, minlength=len(rows)) == 0] = 0.0
    obs, action = map(int, np.unravel_index(excess.argmax(), excess.shape))
    worst = (
        f"in observation {obs + seen.starts[0]} it takes action {action + done.starts[0]} with a probability of "
        f"{rows[obs, action]:.2f}, in the demonstrations it is {shown.right[obs, action]:.2f}"
    )
    return {"pairings": distances, "apart": distances["right"], "worst_step": worst}
