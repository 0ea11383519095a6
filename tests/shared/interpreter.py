"""The reference program: a task stepped by the reference interpreter, one node at a time. Every backend is tested against it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taskspec.language import draws
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.types import Role
from taskspec.language.expressions.variates import sampler
from taskspec.language.task.task import Task

Flat = tuple[Any, ...]


class Interpreter:
    """One environment of a task; values are flat tuples, one for each component.

    Draws are those of the contract: word w of reset number e, or of step number n since the seed was set.
    """

    def __init__(self, task: Task, seed: int) -> None:
        self.task = task
        self.seed = seed
        self.episode = 0
        self.steps = 0
        self.time = 0
        self.state: list[Flat] = []
        self._reset_roots = task.reset_roots
        self._step_roots = task.step_roots
        self._reset_layout = task.reset_words
        self._step_layout = task.step_words

    def reset(self) -> list[Flat]:
        """Return the first observation of the next episode."""
        layout = self._reset_layout
        words = draws.words(self.seed, draws.RESET, self.episode, layout.count)
        values = evaluate(self._reset_roots, {}, sampler(layout, words))
        self.episode = self.episode + 1
        self.time = 0
        self.state = values[: len(self.task.state)]
        return values[len(self.task.state) :]

    def step(self, action: Sequence[Flat]) -> tuple[list[Flat], float, bool, bool]:
        """Observation, reward, terminated, truncated."""
        task = self.task
        n = len(self.task.state)
        words = draws.words(self.seed, draws.STEP, self.steps, self._step_layout.count)
        values = evaluate(self._step_roots, self._reads(action), sampler(self._step_layout, words))
        self.steps = self.steps + 1
        self.time = self.time + 1
        self.state = values[:n]
        truncated = task.horizon is not None and self.time >= task.horizon
        return values[n + 2 + len(task.process.measures) :], values[n][0], values[n + 1][0], truncated

    def _reads(self, action: Sequence[Flat]) -> dict[tuple[Role, str], Flat]:
        reads: dict[tuple[Role, str], Flat] = {(Role.TIME, "t"): (self.time,)}
        reads |= {c.read: value for c, value in zip(self.task.state, self.state, strict=True)}
        reads |= {(Role.ACTION, c.name): value for c, value in zip(self.task.action, action, strict=True)}
        return reads
