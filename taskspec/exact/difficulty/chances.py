"""What one step of uniformly random actions may come to: next states together with what is paid, not its expectation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exact.model.failure import refuse
from taskspec.exact.model.model import Model
from taskspec.exact.model.transitions import Steps
from taskspec.limits import count, how_to_raise, limits

Array = np.ndarray[Any, Any]
CHUNK = 65_536
RATE = 1_000_000
"""Outcomes that are listed in a second, nominally."""


@dataclass(frozen=True)
class StepOutcomes:
    """Every outcome (N,) of a step from a state: where it leads, what it pays, whether it ends, its probability.

    They are sorted by `state`, and no two are alike. `first` (S + 1,) says where those of each state begin.
    """

    state: Array
    target: Array
    reward: Array
    ends: Array
    weight: Array
    first: Array


class RandomSteps:
    """The chances at each time, listed when they are asked for, in the states in which episodes act.

    Raises:
        SpecError: (E712) when there are too many, or infinitely many.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.steps = model, Steps(model.task, as_paid=True)
        self.acting = np.flatnonzero(model.acting)
        self._known: dict[int, StepOutcomes] = {}
        if self.steps.branching == np.inf:
            refuse("rewards are drawn from a distribution that has infinitely many outcomes")
        times = (model.horizon or 1) if self.steps.uses_time else 1
        size = times * len(self.acting) * model.n_actions * self.steps.branching
        if size > limits().seconds * RATE:
            refuse(f"random steps have {count(int(size))} outcomes", how_to_raise("seconds", size / RATE))

    def at(self, t: int) -> StepOutcomes:
        time = t if self.steps.uses_time else 0
        if time not in self._known:
            self._known[time] = self._listed(time)
        return self._known[time]

    def _listed(self, t: int) -> StepOutcomes:
        parts = list(self._parts(t))
        state, target, reward, ends, weight = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.lexsort((reward, ends, target, state))
        state, target, reward, ends, weight = (x[order] for x in (state, target, reward, ends, weight))
        new = np.ones(len(state), np.bool_)
        new[1:] = np.logical_or.reduce([x[1:] != x[:-1] for x in (state, target, reward, ends)])
        at = np.flatnonzero(new)
        total = np.add.reduceat(weight, at) / self.model.n_actions
        first = np.searchsorted(state[at], np.arange(self.model.n_states + 1))
        return StepOutcomes(state[at], target[at], reward[at], ends[at], total, first)

    def _parts(self, t: int) -> Iterator[tuple[Array, ...]]:
        """State, target, reward, end and probability of outcomes, some actions in some states at a time."""
        codes, rows = self.model.codes, len(self.acting) * self.model.n_actions
        size = max(1, int(CHUNK // max(1.0, min(self.steps.branching, CHUNK))))
        for low in range(0, rows, size):
            action, which = np.divmod(np.arange(low, min(rows, low + size)), len(self.acting))
            state = self.acting[which]
            for found in self.steps.outcomes(codes[state], action, t):
                at = state if found.origin is None else state[found.origin]
                target = np.searchsorted(codes, found.code)
                given = (at, target, found.reward.astype(np.float64), found.terminal, found.weight)
                yield tuple(np.broadcast_to(x, (len(at),)) for x in given)
