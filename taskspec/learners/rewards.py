"""Rewards that were learned, as NumPy arrays: functions that can be asked, pickled and sent to other processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.learners.vectors import Vectors

Array = np.ndarray[Any, Any]
Layers = Sequence[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class LearnedReward:
    """A reward of steps of an episode that goes on: theta, and where there is a phi, + discount phi(s') - phi(s).

    Attributes:
        mean, deviation: (D,), what observations are standardised by.
        sees_action: whether theta does.
        flagged: whether nets see a flag, which is 0 here, of states that absorb.
        pay: what it says is turned into a reward so (see `configurations.Adversarial`).
    """

    seen: Vectors
    actions: Vectors
    mean: Array
    deviation: Array
    theta: Layers
    phi: Layers | None
    activation: str
    sees_action: bool
    flagged: bool
    discount: float
    pay: str

    def __call__(self, observations: Any, actions: Any, next_observations: Any) -> Array:
        """Float64 (N,), of observations (N, *shape), actions (N, *shape), and what followed."""
        state = self._state(observations)
        taken = self.actions(np.asarray(actions)).astype(np.float64)
        said = self._says(self.theta, np.hstack([state, taken]) if self.sees_action else state)
        if self.phi is not None:
            said = (
                said
                + self.discount * self._says(self.phi, self._state(next_observations))
                - self._says(self.phi, state)
            )
        if self.pay == "softplus(l)":
            return np.logaddexp(0, said)
        return -np.logaddexp(0, -said) if self.pay == "-softplus(-l)" else said

    def _state(self, observations: Any) -> Array:
        rows = (self.seen(np.asarray(observations)) - self.mean) / self.deviation
        return np.hstack([rows, np.zeros((len(rows), int(self.flagged)))])

    def _says(self, layers: Layers, x: Array) -> Array:
        *inner, (w, b) = layers
        for u, c in inner:
            x = np.tanh(x @ u + c) if self.activation == "tanh" else np.maximum(x @ u + c, 0)
        found: Array = (x @ w + b)[:, 0]
        return found
