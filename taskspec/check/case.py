"""What a lint looks at: a task, with what is known of it and where its parts were written."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskspec.base.diagnostics import Span
from taskspec.model.model import Model
from taskspec.scores.returns import Results
from taskspec.task.merge import Merged, merge
from taskspec.task.task import Task

SAME = 1e-9
"""Numbers that differ by less, relative to their size, count as equal."""
SMALL = 3_000_000


@dataclass(frozen=True)
class Linted:
    """A task with what is known of it; `model` only where the task itself (not a stand-in) has one of moderate size."""

    task: Task
    results: Results

    @cached_property
    def model(self) -> Model | None:
        model = self.results.model
        return model if model is not None and model.task is self.task and model.entries <= SMALL else None

    @cached_property
    def merged(self) -> Merged:
        return merge(self.task.document, self.task.variant)

    def key(self, *path: str) -> Span:
        return self.merged.key_span(path)

    @cached_property
    def paid(self) -> tuple[float, float] | None:
        """The least and the largest expected reward of all that can be done in any episode; None where nothing can be."""
        model = self.results.model
        if model is None:
            return None
        low, high = [], []
        for t, level in model.levels() if model.is_timed else [(0, model.acting)]:
            for paid in model.step(t).R.reshape(model.n_actions, -1):  # one by one, as there may be no memory for all
                if level.any():
                    low.append(paid[level].min())
                    high.append(paid[level].max())
        return (float(np.min(low)), float(np.max(high))) if low else None

    @property
    def is_constant(self) -> bool:
        """Whether every step pays the same, and it makes no difference how many there are."""
        paid, model = self.paid, self.results.model
        if model is None or paid is None or not np.isfinite(paid).all() or paid[1] - paid[0] > SAME:
            return False
        return all(step.P_end is None for step in model.steps) or abs(paid[0]) <= SAME
