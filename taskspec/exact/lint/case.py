"""What a lint looks at: a task, with what is known of it and where its parts were written."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.diagnostics import Span
from taskspec.exact.model.model import Model
from taskspec.exact.scoring.returns import Results
from taskspec.task.merge import Merged, merge
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]
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
    def rewards(self) -> Array:
        """Expected rewards (N,) of everything that can be done in any episode."""
        model = self.results.model
        if model is None:
            return np.zeros(0)
        found = []
        for t, level in model.levels() if model.is_timed else [(0, model.acting)]:
            found.append(model.step(t).reward.reshape(model.n_actions, -1)[:, level].reshape(-1))
        return np.concatenate(found) if found else np.zeros(0)

    @property
    def is_constant(self) -> bool:
        """Whether every step pays the same, and it makes no difference how many there are."""
        paid, model = self.rewards, self.results.model
        if model is None or not len(paid) or not np.isfinite(paid).all() or np.ptp(paid) > SAME:
            return False
        return all(step.ending is None for step in model.steps) or abs(float(paid[0])) <= SAME
