"""Learning curves: from the policies that a learner shows, or else from the episodes in which it learns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taskspec.base.arrays import Array

POINTS = 20
"""Points of a curve of training episodes, at most."""

Curve = Sequence[Sequence[float | None]]
"""Points of steps and a score."""


class TrainingReturns:
    """Returns of the episodes of a training run, as means over equal parts of the budget.

    Args:
        steps: the budget.
    """

    def __init__(self, steps: int) -> None:
        self.width = max(1.0, steps / POINTS)
        self.totals = np.zeros(POINTS)
        self.counts = np.zeros(POINTS, np.int64)

    def add(self, steps: int, total: float, episodes: int) -> None:
        """Count episodes that ended when so many steps had been taken, with the total of their returns."""
        part = min(POINTS - 1, int((steps - 1) / self.width))
        self.totals[part] += total
        self.counts[part] += episodes

    @property
    def points(self) -> list[list[float]]:
        """Points of steps and the mean return; without parts in which no episode ended."""
        curve = []
        for part in np.flatnonzero(self.counts).tolist():
            steps = float(round((part + 1) * self.width))
            curve.append([steps, float(self.totals[part] / self.counts[part])])
        return curve


class EpisodeReturns:
    """Returns of the episodes that run in some lanes, discounted as the task says."""

    def __init__(self, discount: float) -> None:
        self.discount = discount
        self.totals = np.zeros(0)
        self.weights = np.ones(0)

    def begin(self, lanes: int) -> None:
        """Forget episodes that were not finished."""
        self.totals = np.zeros(lanes)
        self.weights = np.ones(lanes)

    def step(self, rewards: Array, is_over: Array, takes_part: Array) -> Array:
        """Return the returns of the episodes that ended in a step.

        Args:
            takes_part: bool (lanes,), without the lanes that were reset instead.
        """
        if len(rewards) != len(self.totals):
            self.begin(len(rewards))
        self.totals = self.totals + np.where(takes_part, self.weights * rewards, 0.0)
        self.weights = np.where(takes_part, self.weights * self.discount, self.weights)
        ended = is_over & takes_part
        returns = self.totals[ended]
        self.totals = np.where(ended, 0.0, self.totals)
        self.weights = np.where(ended, 1.0, self.weights)
        return returns


def area(curve: Curve | None) -> float | None:
    """Return the area under a learning curve, over the steps between its ends; None without one."""
    points = [(steps, score) for steps, score in curve or () if steps is not None and score is not None]
    if not points:
        return None
    steps, scores = np.array(points, float).T
    if len(points) == 1:
        return float(scores[0])
    return float(np.trapezoid(scores, steps) / (steps[-1] - steps[0]))


def steps_to(curve: Curve | None, score: float) -> float | None:
    """Return the steps after which a learning curve first has a score; None if it never has."""
    for steps, reached in curve or ():
        if reached is not None and reached >= score:
            return steps
    return None
