"""What learners are given, without an exam around it."""

from typing import Any

import taskspec
from taskspec.data import Demonstrations, demonstrations
from taskspec.language.task.task import Task


class Granted:
    """A task with everything that may be learned from, which keeps count."""

    def __init__(
        self, task: str | Task, steps: int = 1000, seeds: int = 1, demonstrations: Demonstrations | None = None
    ) -> None:
        self.task = taskspec.load(task)
        self.steps = steps
        self.seeds = tuple(range(seeds))
        self.judge = self.task
        self._shown = demonstrations
        self.counted = 0
        self.compared = 0
        self.curve: list[tuple[int, list[Any]]] = []

    @property
    def demonstrations(self) -> Demonstrations:
        if self._shown is None:
            self._shown = demonstrations(self.task, transitions=2000)
        return self._shown

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        self.counted += steps
        self.compared += comparisons
        assert self.counted <= self.steps

    def show(self, *policies: Any) -> None:
        assert len(policies) == len(self.seeds)
        self.curve.append((self.counted, list(policies)))
