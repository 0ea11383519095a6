"""Random network distillation (Burda et al., 2018): what a net has not learned yet of a random one is new."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.learners.configurations import Novelty
from taskspec.learners.deep.nets import Net, net, says
from taskspec.learners.deep.rewards import Looks
from taskspec.learners.deep.world import World

Array = Any


class Novel(NamedTuple):
    """The net that learns and the random one, and the running mean and variance of how far they are apart."""

    learner: Net
    target: Net
    optimiser: Any
    mean: Array
    variance: Array


class Curiosity:
    """How a bonus for what is new is begun, learned and paid."""

    def __init__(self, config: Novelty, world: World) -> None:
        self.config, self.world = config, world
        self._adam = optax.adam(config.learning_rate)

    def init(self, key: Array) -> Novel:
        inputs = self.world.seen.size + self.world.head.vectors.size
        nets = [net(k, inputs, self.config.hidden, self.config.outputs) for k in jax.random.split(key)]
        return Novel(nets[0], nets[1], self._adam.init(nets[0]), jnp.float32(0), jnp.float32(1))

    def apart(self, learner: Net, target: Net, at: Looks) -> Array:
        """How far the nets are apart on steps (...), the mean square of their outputs' differences."""
        inputs = jnp.concatenate([self.world.seen.scaled(at.seen), at.taken], -1)
        return ((says(learner, inputs, "relu") - says(target, inputs, "relu")) ** 2).mean(-1)

    def fitted(self, novel: Novel, at: Looks) -> Novel:
        """After a gradient step on what was seen."""
        slope = jax.grad(lambda n: self.apart(n, novel.target, at).mean())(novel.learner)
        change, optimiser = self._adam.update(slope, novel.optimiser)
        return novel._replace(learner=optax.apply_updates(novel.learner, change), optimiser=optimiser)

    def bonus(self, novel: Novel, at: Looks) -> tuple[Array, Novel]:
        """What steps (T, E) are paid, standardised by averages that move with each of them."""
        errors, rate = self.apart(novel.learner, novel.target, at), self.config.rate

        def once(carry: tuple[Array, Array], error: Array) -> tuple[tuple[Array, Array], Array]:
            mean, variance = carry
            mean = (1 - rate) * mean + rate * error
            variance = (1 - rate) * variance + rate * (error - mean) ** 2
            return (mean, variance), (error - mean) / (jnp.sqrt(variance) + 1e-8)

        (mean, variance), scaled = jax.lax.scan(once, (novel.mean, novel.variance), errors.reshape(-1))
        return self.config.weight * scaled.reshape(errors.shape), novel._replace(mean=mean, variance=variance)
