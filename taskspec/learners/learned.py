"""Learned policies and rewards as NumPy arrays, which can be evaluated and pickled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.learners.case import Vectors


@dataclass(frozen=True, eq=False)
class NetPolicy:
    """A net whose outputs are logits of actions, or means of real actions.

    Attributes:
        layers: weights (inputs, outputs) and biases (outputs,).
        deviations: logarithms (D,) of the standard deviations of real actions.
        seed: of sampled actions and ties.
        reward: the learned reward, a function of observation, action and next observation (N, ...); or None.
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
        """Return actions (N, *shape) of observations (N, *shape), or one of one; and no memory."""
        seen = np.asarray(observations)
        alone = seen.ndim == len(self.seen.shape)
        chosen = self._act(seen[None] if alone else seen, deterministic)
        return (chosen[0] if alone else chosen), None

    def action_probabilities(self, observations: Any) -> Array:
        """Return float64 (N, A), the probability of every action; the last component varies fastest.

        Raises:
            TypeError: for real actions.
        """
        if not self.actions.counts:
            raise TypeError("real actions have no probabilities")
        parts = self._groups(np.asarray(observations))
        return reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), parts)

    def _output(self, seen: Array) -> Array:
        x = self.seen(seen).astype(np.float64)
        *inner, (w, b) = self.layers
        for u, c in inner:
            x = np.tanh(x @ u + c)
        output: Array = x @ w + b
        return output

    def _groups(self, seen: Array) -> list[Array]:
        """Return the probabilities of each component's values."""
        ends = np.cumsum(self.actions.counts)[:-1]
        logits = np.split(self._output(seen), ends, axis=1)
        powers = [np.exp(each - each.max(axis=1, keepdims=True)) for each in logits]
        return [p / p.sum(axis=1, keepdims=True) for p in powers]

    def _act(self, seen: Array, deterministic: bool) -> Array:
        if not self._rng:
            self._rng.append(np.random.default_rng(self.seed))
        rng = self._rng[0]
        v = self.actions
        if not v.counts:
            mean = self._output(seen)
            drawn = mean if deterministic else mean + np.exp(self.deviations) * rng.standard_normal(mean.shape)
            return np.clip(drawn, v.low, v.high).astype(np.float32).reshape(-1, *v.shape)
        columns = []
        for p in self._groups(seen):
            p = p >= p.max(axis=1, keepdims=True) if deterministic else p
            columns.append((rng.random((len(p), 1)) * p.sum(axis=1, keepdims=True) >= p.cumsum(axis=1)).sum(axis=1))
        numbers = np.stack(columns, axis=1)
        return numbers[:, 0] + v.start if v.single else numbers


Layers = Sequence[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class LearnedReward:
    """A reward of steps that do not end an episode: theta, plus discount phi(s') - phi(s) if there is a phi.

    Attributes:
        mean, deviation: (D,), that observations are standardised with.
        sees_action: whether actions are an input of theta.
        flagged: whether nets have an input that flags absorbing states, which is 0 here.
        pay: how outputs become rewards (see `Adversarial`).
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
        """Return float64 (N,) of observations, actions and next observations, (N, *shape) each."""
        state = self._state(observations)
        taken = self.actions(np.asarray(actions)).astype(np.float64)
        output = self._forward(self.theta, np.hstack([state, taken]) if self.sees_action else state)
        if self.phi is not None:
            output = (
                output
                + self.discount * self._forward(self.phi, self._state(next_observations))
                - self._forward(self.phi, state)
            )
        if self.pay == "softplus(l)":
            return np.logaddexp(0, output)
        return -np.logaddexp(0, -output) if self.pay == "-softplus(-l)" else output

    def _state(self, observations: Any) -> Array:
        rows = (self.seen(np.asarray(observations)) - self.mean) / self.deviation
        return np.hstack([rows, np.zeros((len(rows), int(self.flagged)))])

    def _forward(self, layers: Layers, x: Array) -> Array:
        *inner, (w, b) = layers
        for u, c in inner:
            x = np.tanh(x @ u + c) if self.activation == "tanh" else np.maximum(x @ u + c, 0)
        found: Array = (x @ w + b)[:, 0]
        return found
