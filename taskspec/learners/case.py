"""What a learner is given, as learners of this package use it."""

from __future__ import annotations

from typing import Any, Protocol

from taskspec.data import Demonstrations
from taskspec.task.task import Task


class LearnerCase(Protocol):
    """What is asked of a learner: to learn `task` in `steps` steps, once for every one of `seeds`."""

    @property
    def task(self) -> Task: ...

    @property
    def steps(self) -> int: ...

    @property
    def seeds(self) -> tuple[int, ...]: ...

    @property
    def demonstrations(self) -> Demonstrations: ...

    @property
    def judge(self) -> Task:
        """The task by whose rewards segments are compared."""
        ...

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        """Say that each seed took so many more steps, and had so many more pairs compared."""

    def show(self, *policies: Any) -> None:
        """Show what each seed has learned so far."""
