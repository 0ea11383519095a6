"""Observations and actions as vectors, and policies as distributions over actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.learners.vectors import Vectors

Array = Any
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class ActionHead:
    """The distribution of an action, given what the net says (..., vectors.size): logits, or means.

    Finite actions are int32 (..., K), of K independent categoricals; real ones float32 (..., D), of independent Gaussians whose
    log-deviations (D,) are given beside it. Deviations are free parameters; for finite actions they have no elements.
    """

    vectors: Vectors

    @property
    def deviations(self) -> int:
        return 0 if self.vectors.counts else self.vectors.size

    def noise(self, key: Array, shape: tuple[int, ...]) -> Array:
        """What `sample` draws from, (*shape, size)."""
        draw = jax.random.gumbel if self.vectors.counts else jax.random.normal
        return draw(key, (*shape, self.vectors.size), jnp.float32)

    def sample(self, said: Array, deviations: Array, noise: Array) -> Array:
        if not self.vectors.counts:
            return said + jnp.exp(deviations) * noise
        return jnp.stack([g.argmax(-1).astype(jnp.int32) for g in self._groups(said + noise)], -1)

    def uniform(self, noise: Array) -> Array:
        """An action at random, of the same noise; real ones are uniform within their bounds."""
        if self.vectors.counts:
            return self.sample(jnp.zeros_like(noise), jnp.zeros(0), noise)
        low, high = jnp.array(self.vectors.low), jnp.array(self.vectors.high)
        return low + (high - low) * jax.scipy.stats.norm.cdf(noise)

    def log_prob(self, said: Array, deviations: Array, action: Array) -> Array:
        """(...): of actions (..., K)."""
        if not self.vectors.counts:
            z = (action - said) * jnp.exp(-deviations)
            return (-0.5 * (z**2 + LOG_2PI) - deviations).sum(-1)
        logs = [jax.nn.log_softmax(g) for g in self._groups(said)]
        return sum(jnp.take_along_axis(g, action[..., k, None], -1)[..., 0] for k, g in enumerate(logs))

    def entropy(self, said: Array, deviations: Array) -> Array:
        if not self.vectors.counts:
            return jnp.broadcast_to((deviations + 0.5 * (1 + LOG_2PI)).sum(), said.shape[:-1])
        logs = [jax.nn.log_softmax(g) for g in self._groups(said)]
        return sum(-(jnp.exp(g) * g).sum(-1) for g in logs)

    def divergence(self, old: tuple[Array, Array], new: tuple[Array, Array]) -> Array:
        """Kullback-Leibler, of the new distribution from the old one: (...)."""
        if not self.vectors.counts:
            ratio = jnp.exp(2 * (old[1] - new[1]))
            distance = (old[0] - new[0]) ** 2 * jnp.exp(-2 * new[1])
            return 0.5 * (ratio + distance - 1).sum(-1) + (new[1] - old[1]).sum()
        before, after = ([jax.nn.log_softmax(g) for g in self._groups(said)] for said in (old[0], new[0]))
        return sum((jnp.exp(a) * (a - b)).sum(-1) for a, b in zip(before, after, strict=True))

    def played(self, action: Array) -> Array:
        """Actions (N, K) as programs take them, lanes last."""
        v = self.vectors
        if v.counts:
            return action[:, 0] + v.start if v.single else action.T
        shown = jnp.clip(action, jnp.array(v.low), jnp.array(v.high)).T
        return shown.reshape(*v.shape, -1)

    def _groups(self, said: Array) -> list[Array]:
        ends = np.cumsum(self.vectors.counts)[:-1].tolist()
        return jnp.split(said, ends, axis=-1)
