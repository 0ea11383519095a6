"""The reference program: a task stepped by the reference interpreter, one node at a time. Every backend is compared with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taskspec.language import draws
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.expressions.variates import sampler
from taskspec.language.task.task import Task

Flat = tuple[Any, ...]


class ReferenceProgram:
    """One environment of a task; values are flat tuples, one for each component.

    Draws follow the seeding contract: word w of reset number e, or of step number n since the seed was set.

    Attributes:
        time: steps of this episode.
        state: the present values of the components.
        measures: the measures of the last step, by name.
    """

    def __init__(self, task: Task, seed: int) -> None:
        self.task = task
        self.seed = seed
        self.episode = 0
        self.steps = 0
        self.time = 0
        self.state: list[Flat] = []
        self.measures: dict[str, float] = {}

    def reset(self) -> list[Flat]:
        """First observation of the next episode."""
        layout = self.task.reset_words
        words = draws.words(self.seed, draws.RESET, self.episode, layout.count)
        values = evaluate(self.task.reset_roots, {}, sampler(layout, words))
        self.episode += 1
        self.time = 0
        self.state = values[: len(self.task.state)]
        return values[len(self.task.state) :]

    def step(self, action: Sequence[Flat]) -> tuple[list[Flat], float, bool, bool]:
        """Observation, reward, terminated, truncated of a step."""
        task = self.task
        values = self.values(task.step_roots, action)
        self.steps += 1
        self.time += 1
        n = len(task.state)
        self.state = values[:n]
        (reward,) = values[n]
        (terminated,) = values[n + 1]
        first = n + 2 + len(task.process.measures)  # of the observation
        for name, (value,) in zip(task.process.measures, values[n + 2 : first], strict=True):
            self.measures[name] = float(value)
        truncated = task.horizon is not None and self.time >= task.horizon
        return values[first:], float(reward), terminated, truncated

    def values(self, nodes: Sequence[Node], action: Sequence[Flat]) -> list[Flat]:
        """Values of nodes in the step to come."""
        reads = {c.read: value for c, value in zip(self.task.state, self.state, strict=True)}
        for c, value in zip(self.task.action, action, strict=True):
            reads[(Role.ACTION, c.name)] = value
        reads[TIME] = (self.time,)
        layout = self.task.step_words
        words = draws.words(self.seed, draws.STEP, self.steps, layout.count)
        return evaluate(nodes, reads, sampler(layout, words))

    def mask(self) -> list[int]:
        """Legal actions of the present state, 1 or 0 for each; for a task with `legal`."""
        reads = {c.read: value for c, value in zip(self.task.state, self.state, strict=True)}
        (legal,) = evaluate(self.task.mask, reads)
        return list(map(int, legal))
