"""The input and output of checks for warnings: a task with its results, and problems at their places."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Placed, Span
from taskspec.exact.model.extract import lasting
from taskspec.exact.model.model import Model
from taskspec.exact.scores.returns import Results
from taskspec.language.task.merge import Merged, merge
from taskspec.language.task.task import Task

SAME = 1e-9  # numbers that differ by less, relative to their size, count as equal


@dataclass(frozen=True)
class Doubt:
    """Something to warn about, at its place; the check that found it has the code."""

    place: Placed | None
    message: str
    hint: str | None = None
    notes: Iterable[str] = ()


@dataclass(frozen=True)
class LintContext:
    """A task with its results."""

    task: Task
    results: Results

    @cached_property
    def model(self) -> Model | None:
        """The exact model of the task itself, not of a stand-in; None where there is none."""
        model = self.results.model
        if model is None or model.task is not self.task:
            return None
        return model

    @cached_property
    def lasting_model(self) -> Model:
        """The exact model with the states that longer episodes would enter; raises E712 as `known_model`."""
        return lasting(self.results.known_model)

    @cached_property
    def merged(self) -> Merged:
        return merge(self.task.source.document, self.task.source.variant)

    def key(self, *path: str) -> Span:
        return self.merged.key_span(path)

    @cached_property
    def paid(self) -> tuple[float, float] | None:
        """The least and the largest expected reward of any step of any episode; None if there is no such step."""
        model = self.results.known_model
        low = []
        high = []
        levels: Iterable[tuple[int, Array]] = [(0, model.acting)]
        if model.is_timed:
            levels = model.levels()
        for t, level in levels:
            if level.any():
                for paid in model.step(t).R.reshape(model.n_actions, -1):  # one action at a time, to save memory
                    low.append(paid[level].min())
                    high.append(paid[level].max())
        if not low:
            return None
        return float(np.min(low)), float(np.max(high))

    @property
    def is_constant(self) -> bool:
        """True if all steps have the same reward, and their number makes no difference."""
        paid = self.paid
        model = self.results.known_model
        if paid is None or not np.isfinite(paid).all() or paid[1] - paid[0] > SAME:
            return False
        return all(step.P_end is None for step in model.steps) or abs(paid[0]) <= SAME
