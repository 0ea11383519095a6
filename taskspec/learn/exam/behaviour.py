"""The actions that a learner takes while it trains, where observations and actions are single numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.task.task import Task

PARTS = 5
"""Equal parts of the budget, whose actions are counted apart."""
OFTEN = 500
"""Steps in an observation after which each action should have been tried."""
TRIED = 10
"""Times after which an action counts as tried."""
CLEAR = 0.7
"""The share of an action from which it is the one that a learner takes."""
LARGEST = 10_000
"""Observations times actions that are counted, at most."""


class TrainingBehaviour:
    """Counts of the actions that were taken in each observation.

    Args:
        steps: the budget.

    Attributes:
        counts: int64 (PARTS, O, A); None where observations or actions are no single numbers.
    """

    def __init__(self, task: Task, steps: int) -> None:
        seen = task.observation_layout
        done = task.action_layout
        self.width = max(1.0, steps / PARTS)
        self.counts: Array | None = None
        if seen.form == "discrete" and done.form == "discrete" and seen.counts[0] * done.counts[0] <= LARGEST:
            self.counts = np.zeros((PARTS, seen.counts[0], done.counts[0]), np.int64)
            self.first_observation = seen.starts[0]
            self.first_action = done.starts[0]

    def add(self, steps: int, observations: Any, actions: Any) -> None:
        """Count steps; observations and actions are batches (N,).

        Args:
            steps: of the budget, that are taken with these.
        """
        if self.counts is None:
            return
        part = min(PARTS - 1, int((steps - 1) / self.width))
        if len(actions) == 1:  # one environment: much faster than as arrays
            self.counts[part, int(observations[0]) - self.first_observation, int(actions[0]) - self.first_action] += 1
            return
        rows = np.asarray(observations, np.int64).reshape(-1) - self.first_observation
        columns = np.asarray(actions, np.int64).reshape(-1) - self.first_action
        np.add.at(self.counts[part], (rows, columns), 1)

    @property
    def total(self) -> Array | None:
        """Numbers of times that each action was taken, int64 (O, A); None where nothing was counted."""
        if self.counts is None or not self.counts.any():
            return None
        total: Array = self.counts.sum(axis=0)
        return total

    @property
    def tried(self) -> float | None:
        """The share of actions that were tried, in the observations that were seen often; None without one."""
        total = self.total
        if total is None:
            return None
        often = total[total.sum(axis=1) >= OFTEN]
        if not len(often):
            return None
        return float((often >= TRIED).mean())

    def agreement(self, policy: Array) -> float | None:
        """Return the share of the last steps whose usual action is the one that a policy (O, A) takes.

        Observations count in which both have a clear one; None without one.
        """
        if self.counts is None:
            return None
        last = self.counts[-1]
        steps = last.sum(axis=1)
        is_clear = (last.max(axis=1) > CLEAR * steps) & (policy.max(axis=1) > CLEAR) & (steps >= TRIED)
        if not is_clear.any():
            return None
        agrees = last.argmax(axis=1) == policy.argmax(axis=1)
        return float(steps[is_clear & agrees].sum() / steps[is_clear].sum())
