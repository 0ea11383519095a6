"""Who says which of two trajectories is better, although the rewards of neither are told."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.data.preferences import WORDS, Teacher, return_ends
from taskspec.task.task import Task

Key = tuple[Hashable, Hashable, Hashable]
KEPT = 250_000
"""Different steps that are remembered at least, of which the latest count."""


class Oracle:
    """Remembers what the steps that a learner saw were worth, and compares by that.

    A trajectory is recognised by its observations and actions: where two steps look alike and pay differently, the last one
    seen counts.

    Args:
        task: by whose rewards it goes.
        seed: of its mistakes.
    """

    def __init__(self, task: Task, seed: int) -> None:
        self.task, self.rng = task, np.random.default_rng([seed, 0x7EAC4])
        self.seen, self.done = (_dtype(layout.form) for layout in (task.observation_layout, task.action_layout))
        self.rewards: dict[Key, float] = {}
        self.older: dict[Key, float] = {}

    def keep(self, before: Any, actions: Any, after: Any, rewards: Array) -> None:
        """Remember steps; each argument is a batch of N. What was not seen for long is forgotten."""
        if len(self.rewards) >= KEPT:
            self.rewards, self.older = {}, self.rewards
        for key, reward in zip(self._keys(before, actions, after), rewards.tolist(), strict=True):
            self.rewards[key] = reward

    def prefer(self, first: Any, second: Any, temperature: float) -> float:
        """1.0 for the first, 0.0 for the second, 0.5 for neither."""
        one, other = np.array([self._value(first)]), np.array([self._value(second)])
        teacher, words = Teacher(boltzmann=temperature), self.rng.integers(0, 2**32, (WORDS, 1), dtype=np.uint32)
        ends = return_ends(self.task, len(first.acts)) if teacher.needs_range else (0.0, 0.0)
        return float(teacher.labels(one, other, (one, other), ends, words)[0])

    def _value(self, trajectory: Any) -> float:
        obs, discount = trajectory.obs, self.task.discount
        keys = self._keys(_rows(obs, slice(None, -1)), trajectory.acts, _rows(obs, slice(1, None)))
        try:
            rewards = [self.rewards[key] if key in self.rewards else self.older[key] for key in keys]
        except KeyError:
            message = (
                "`prefer` compares steps that `case.env()`, `case.make_vec()` or the demonstrations have shown, among the "
                f"latest {KEPT:,}"
            )
            raise ValueError(message) from None
        return sum(discount**t * reward for t, reward in enumerate(rewards))

    def _keys(self, before: Any, actions: Any, after: Any) -> Iterator[Key]:
        return zip(_each(before, self.seen), _each(actions, self.done), _each(after, self.seen), strict=True)


def _dtype(form: str) -> type[np.generic]:
    return np.int64 if form in ("discrete", "multi_discrete") else np.float32


def _rows(seen: Any, which: slice) -> Any:
    return {name: part[which] for name, part in seen.items()} if isinstance(seen, dict) else seen[which]


def _each(batch: Any, dtype: type[np.generic]) -> Iterator[Hashable]:
    """Each of a batch of observations or actions, as something that a dictionary finds again."""
    if isinstance(batch, dict):
        return zip(*(_each(batch[name], np.float64) for name in sorted(batch)), strict=True)
    array = np.ascontiguousarray(batch, dtype)
    return iter(array.tolist()) if array.ndim == 1 else (row.tobytes() for row in array)
