"""Observations of the states of an exact model, over time.

Shapes: T times (1 without a horizon), S states, O observations.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array, as_matrix
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.policies.adapters import Predictor
from taskspec.exact.policies.policy import states_of


def times(model: Model) -> int:
    """Return the number of times for which tables differ: the horizon, 1 without one."""
    return model.horizon or 1


class StateObservations:
    """The observations of the states of a model, as the environment shows them.

    Attributes:
        is_known: whether they are functions of the state and the time, rather than drawn.
        is_timed: whether they show the time.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._reader = Predictor(model.task, None)
        self.is_known = not self._reader.is_noisy
        self.is_timed = self._reader.sees_time
        self._known: dict[int, Any] = {}

    def at(self, t: int) -> Any:
        """Return the observations (S, *shape) at a time; a dict of them for a dict space."""
        if not self.is_known:
            refuse(f"observations of {self._model.task.id} are drawn: no table has them")
        t = t * self.is_timed
        if t not in self._known:
            self._known[t] = self._reader.observe(states_of(self._model), t, np.random.default_rng(0))
        return self._known[t]

    def matrix(self, t: int) -> Array:
        """Return the numbers of the observations at a time, float64 (S, D)."""
        return as_matrix(self.at(t), self._model.n_states)

    @property
    def times(self) -> range:
        """The times at which observations differ; 0 where they do not show the time."""
        if self.is_timed:
            return range(times(self._model))
        return range(1)

    @cached_property
    def rows(self) -> Array:
        """int64 (T, S): the row of each state's observation in a table over observations.

        A discrete observation is its own row, counted from the least. Others are numbered in lexicographic order.
        """
        layout = self._model.task.observation_layout
        flat = list(map(self.matrix, self.times))
        if layout.form == "discrete":
            numbers = np.stack([rows[:, 0] - layout.starts[0] for rows in flat])
        else:
            numbers = np.unique(np.concatenate(flat), axis=0, return_inverse=True)[1]
        shape = (times(self._model), self._model.n_states)
        return np.broadcast_to(numbers.reshape(len(flat), -1).astype(np.int64), shape)

    @cached_property
    def count(self) -> int:
        """The number of rows of a table over observations."""
        layout = self._model.task.observation_layout
        if layout.form == "discrete":
            return layout.counts[0]
        return int(self.rows.max()) + 1
