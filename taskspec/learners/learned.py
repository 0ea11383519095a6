"""What learners learn, as NumPy arrays: policies and rewards that can be asked and pickled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.learners.case import Vectors

# ---------- policies
# What learners learn, as NumPy arrays: policies that can be asked, scored, pickled and sent to other processes.


@dataclass(frozen=True, eq=False)
class NetPolicy:
    """A net whose outputs are logits of actions, or their means.

    Attributes:
        layers: weights (inputs, outputs) and biases (outputs,).
        deviations: of real actions, their logarithms (D,).
        seed: of what is drawn, where actions are; ties of a best action are drawn as well.
        reward: what was learned of the reward, a function of observation, action and next observation (N, ...); or None.
    """

    seen: Vectors
    actions: Vectors
    layers: Sequence[tuple[Array, Array]]
    deviations: Array
    seed: int = 0
    reward: Callable[[Array, Array, Array], Array] | None = None
    _rng: list[np.random.Generator] = field(default_factory=list, repr=False)

    def predict(
        self, observations: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Array, None]:
        """Actions (N, *shape) of observations (N, *shape), or one of one; and no memory."""
        seen = np.asarray(observations)
        alone = seen.ndim == len(self.seen.shape)
        chosen = self._chosen(seen[None] if alone else seen, deterministic)
        return (chosen[0] if alone else chosen), None

    def action_probabilities(self, observations: Any) -> Array:
        """Float64 (N, A), the probability of every action, the first component's slowest.

        Raises:
            TypeError: for real actions.
        """
        if not self.actions.counts:
            raise TypeError("real actions have no probabilities")
        parts = self._groups(np.asarray(observations))
        return reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), parts)

    def _said(self, seen: Array) -> Array:
        x = self.seen(seen).astype(np.float64)
        *inner, (w, b) = self.layers
        for u, c in inner:
            x = np.tanh(x @ u + c)
        said: Array = x @ w + b
        return said

    def _groups(self, seen: Array) -> list[Array]:
        """The probabilities of each component's values."""
        ends = np.cumsum(self.actions.counts)[:-1]
        logits = np.split(self._said(seen), ends, axis=1)
        powers = [np.exp(each - each.max(axis=1, keepdims=True)) for each in logits]
        return [p / p.sum(axis=1, keepdims=True) for p in powers]

    def _chosen(self, seen: Array, deterministic: bool) -> Array:
        if not self._rng:
            self._rng.append(np.random.default_rng(self.seed))
        rng, v = self._rng[0], self.actions
        if not v.counts:
            mean = self._said(seen)
            drawn = mean if deterministic else mean + np.exp(self.deviations) * rng.standard_normal(mean.shape)
            return np.clip(drawn, v.low, v.high).astype(np.float32).reshape(-1, *v.shape)
        columns = []
        for p in self._groups(seen):
            p = p >= p.max(axis=1, keepdims=True) if deterministic else p
            columns.append((rng.random((len(p), 1)) * p.sum(axis=1, keepdims=True) >= p.cumsum(axis=1)).sum(axis=1))
        numbers = np.stack(columns, axis=1)
        return numbers[:, 0] + v.start if v.single else numbers


# ---------- rewards
# Rewards that were learned, as NumPy arrays: functions that can be asked, pickled and sent to other processes.

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
