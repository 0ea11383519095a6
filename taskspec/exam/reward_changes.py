"""Rewards that a learner sees in place of the true ones: changes of the reward of every outcome, as wrappers make them."""

from __future__ import annotations

from collections.abc import Callable

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Node
from taskspec.lang.types import Kind
from taskspec.modifiers.core import paying
from taskspec.task.task import Task


def _clipped(b: Builder, task: Task) -> Node:
    at_least = b.apply("max2", task.process.reward, b.scalar(-1))
    return b.apply("min2", at_least, b.scalar(1))


def _sign(b: Builder, task: Task) -> Node:
    return b.apply("sign", task.process.reward)


def _unfinished(b: Builder, task: Task) -> Node:
    """Return the reward, 0 where the step ends the episode."""
    return b.apply("where", task.process.terminal, b.scalar(0.0), b.cast(task.process.reward, Kind.REAL))


REWARD_CHANGES: dict[str, Callable[[Builder, Task], Node]] = {
    "clipped": _clipped, "signs": _sign, "unfinished": _unfinished,
}  # fmt: skip
"""From a task to what is seen of its reward, by name."""


def with_changed_reward(task: Task, name: str) -> Task:
    """Return a task whose every reward is changed by an entry of `REWARD_CHANGES`.

    Expected rewards of the result are not those of the task, changed: what is random is changed outcome by outcome.
    """
    b = task.new_builder()
    return paying(b, task, REWARD_CHANGES[name](b, task))
