"""Small fully connected nets, and policies as distributions over actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.interface import Vectors

Net = tuple[tuple[AnyArray, AnyArray], ...]
"""Weights (inputs, outputs) and biases (outputs,) of each layer."""
Layer = tuple[AnyArray, AnyArray]
Initialiser = Callable[[AnyArray, int, int, bool], Layer]
"""From a key, the numbers of inputs and outputs, and whether it is the last, to a new layer."""
_FUNCTIONS = {"relu": jax.nn.relu, "tanh": jnp.tanh}


def orthogonal(last: float) -> Initialiser:
    """Return an initialiser by orthogonal matrices times the square root of 2, the last one times `last`, and biases of 0."""

    def made(key: AnyArray, inputs: int, outputs: int, is_last: bool) -> Layer:
        scale = last if is_last else 2**0.5
        return jax.nn.initializers.orthogonal(scale)(key, (inputs, outputs), jnp.float32), jnp.zeros(
            outputs, jnp.float32
        )

    return made


def xavier(key: AnyArray, inputs: int, outputs: int, is_last: bool) -> Layer:
    """Return a matrix of uniform numbers (Glorot and Bengio, 2010), and biases of 0."""
    return jax.nn.initializers.glorot_uniform()(key, (inputs, outputs), jnp.float32), jnp.zeros(outputs, jnp.float32)


def fan_in(key: AnyArray, inputs: int, outputs: int, is_last: bool) -> Layer:
    """Return weights and biases that are uniform up to 1 / sqrt(inputs), as PyTorch makes them."""
    bound = inputs**-0.5
    layer = jax.random.uniform(key, (inputs + 1, outputs), jnp.float32, -bound, bound)
    return layer[:-1], layer[-1]


def net(key: AnyArray, inputs: int, hidden: Sequence[int], outputs: int, layer: Initialiser = xavier) -> Net:
    """Return a new net."""
    sizes = (inputs, *hidden, outputs)
    keys = jax.random.split(key, len(sizes) - 1)
    last = len(keys) - 1
    return tuple(layer(keys[i], sizes[i], sizes[i + 1], i == last) for i in range(len(keys)))


def forward(layers: Net, x: AnyArray, activation: str = "tanh") -> AnyArray:
    """Forward pass: (..., inputs) -> (..., outputs)."""
    *inner, (w, b) = layers
    for u, c in inner:
        x = _FUNCTIONS[activation](x @ u + c)
    return x @ w + b


def gradient_step(adam: Any, loss: Callable[..., AnyArray], nets: Any, optimiser: Any, *data: Any) -> tuple[Any, Any]:
    """Return nets and the state of their optimiser after a step down the slope of `loss(nets, *data)`."""
    change, optimiser = adam.update(jax.grad(loss)(nets, *data), optimiser, nets)
    return optax.apply_updates(nets, change), optimiser


def shuffled(key: AnyArray, size: int, epochs: int, batch: int, batches: int) -> AnyArray:
    """Return the indices of minibatches (epochs * batches, batch), in a new order in each epoch."""
    orders = jax.vmap(lambda k: jax.random.permutation(k, size))(jax.random.split(key, epochs))
    return orders[:, : batch * batches].reshape(-1, batch)


def ring_update(kept: Any, new: Any, count: AnyArray, size: int) -> Any:
    """Return arrays of the latest `size` rows, with new ones in place of the oldest; `count` is how many there were."""
    number = len(jax.tree.leaves(new)[0])
    places = (count + jnp.arange(number)) % size
    return jax.tree.map(lambda old, some: old.at[places].set(some), kept, new)


LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class ActionHead:
    """The distribution of an action, given the output (..., vectors.size) of a net: logits, or means.

    Finite actions are int32 (..., K), of K independent categoricals; real ones float32 (..., D), of independent Gaussians whose
    log-deviations (D,) are free parameters; for finite actions they have no elements.
    """

    vectors: Vectors

    @property
    def deviations(self) -> int:
        if self.vectors.counts:
            return 0
        return self.vectors.size

    def noise(self, key: AnyArray, shape: tuple[int, ...]) -> AnyArray:
        """Return the noise that `sample` takes, float32 (*shape, size)."""
        draw = jax.random.gumbel if self.vectors.counts else jax.random.normal
        return draw(key, (*shape, self.vectors.size), jnp.float32)

    def sample(self, output: AnyArray, deviations: AnyArray, noise: AnyArray) -> AnyArray:
        if not self.vectors.counts:
            return output + jnp.exp(deviations) * noise
        return jnp.stack([g.argmax(-1).astype(jnp.int32) for g in self._groups(output + noise)], -1)

    def uniform(self, noise: AnyArray) -> AnyArray:
        """Return uniformly random actions from the same noise; real ones lie within their bounds."""
        if self.vectors.counts:
            return self.sample(jnp.zeros_like(noise), jnp.zeros(0), noise)
        low = jnp.array(self.vectors.low)
        high = jnp.array(self.vectors.high)
        return low + (high - low) * jax.scipy.stats.norm.cdf(noise)

    def log_prob(self, output: AnyArray, deviations: AnyArray, action: AnyArray) -> AnyArray:
        """Return the log-probabilities (...) of actions (..., K)."""
        if not self.vectors.counts:
            z = (action - output) * jnp.exp(-deviations)
            return (-0.5 * (z**2 + LOG_2PI) - deviations).sum(-1)
        logs = [jax.nn.log_softmax(g) for g in self._groups(output)]
        return sum(jnp.take_along_axis(g, action[..., k, None], -1)[..., 0] for k, g in enumerate(logs))

    def entropy(self, output: AnyArray, deviations: AnyArray) -> AnyArray:
        if not self.vectors.counts:
            return jnp.broadcast_to((deviations + 0.5 * (1 + LOG_2PI)).sum(), output.shape[:-1])
        logs = [jax.nn.log_softmax(g) for g in self._groups(output)]
        return sum(-(jnp.exp(g) * g).sum(-1) for g in logs)

    def divergence(self, old: tuple[AnyArray, AnyArray], new: tuple[AnyArray, AnyArray]) -> AnyArray:
        """Return the Kullback-Leibler divergence (...) of the new distribution from the old one; each is (output, deviations)."""
        if not self.vectors.counts:
            ratio = jnp.exp(2 * (old[1] - new[1]))
            distance = (old[0] - new[0]) ** 2 * jnp.exp(-2 * new[1])
            return 0.5 * (ratio + distance - 1).sum(-1) + (new[1] - old[1]).sum()
        before, after = ([jax.nn.log_softmax(g) for g in self._groups(output)] for output in (old[0], new[0]))
        return sum((jnp.exp(a) * (a - b)).sum(-1) for a, b in zip(before, after, strict=True))

    def program_action(self, action: AnyArray) -> AnyArray:
        """Return actions (N, K) as programs take them, lanes last."""
        v = self.vectors
        if v.counts:
            if v.single:
                return action[:, 0] + v.start
            return action.T
        shown = jnp.clip(action, jnp.array(v.low), jnp.array(v.high)).T
        return shown.reshape(*v.shape, -1)

    def _groups(self, output: AnyArray) -> list[AnyArray]:
        ends = np.cumsum(self.vectors.counts)[:-1].tolist()
        return jnp.split(output, ends, axis=-1)
