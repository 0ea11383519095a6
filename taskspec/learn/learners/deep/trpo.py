"""Trust-region policy optimisation (Schulman et al., 2015), with the options of two packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from jax.flatten_util import ravel_pytree

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.deep.nets import forward, gradient_step, net, orthogonal, shuffled, xavier
from taskspec.learn.learners.deep.ppo import (
    ActorCritic,
    PolicyNet,
    critic_input_size,
    critic_observations,
    gae,
    mean,
    standardise,
)
from taskspec.learn.learners.deep.world import RolloutState, StepBatch, World, in_complete_episode, round_length
from taskspec.learn.learners.paper_settings import Trpo

Product = Callable[[AnyArray], AnyArray]
"""A symmetric matrix times a vector."""
LONG = 100
"""Steps in a unit of time in the features of the regression."""
CUT = 1e-6
"""Eigenvalues below this fraction of the largest count as 0: float32 cannot distinguish them."""


class TrpoUpdate:
    """TRPO on a world: initial policies and their updates (see `PpoUpdate`)."""

    def __init__(self, config: Trpo, world: World) -> None:
        self.config = config
        self.world = world
        self.experience = config.experience
        self.steps = round_length(world, config.experience)
        self._adam = optax.adam(config.critic_learning_rate)

    def init(self, key: AnyArray) -> ActorCritic:
        first, second = jax.random.split(key)
        config = self.config
        head = self.world.head
        of_actor = orthogonal(0.01)
        of_critic = orthogonal(1.0)
        if config.weights == "xavier":
            of_actor = of_critic = xavier
        layers = net(first, self.world.seen.size, config.hidden, head.vectors.size, of_actor)
        actor = PolicyNet(layers, jnp.zeros(head.deviations))
        inputs = critic_input_size(self.world, self.experience.critic_sees_time)
        if config.critic == "ridge":
            return ActorCritic(actor, jnp.zeros(2 * inputs + 4), ())
        critic = net(second, inputs, config.hidden, 1, of_critic)
        return ActorCritic(actor, critic, self._adam.init(critic))

    def update(
        self, held: ActorCritic, steps: StepBatch, walk: RolloutState, rewards: AnyArray, key: AnyArray
    ) -> ActorCritic:
        """Return the policy after a rollout (T, E, ...) with `rewards` (T, E) that led to `walk`."""
        config = self.config
        lasts = jnp.ones_like(rewards)
        if self.experience.whole:
            lasts = in_complete_episode(steps)
        seen = critic_observations(self.world, steps, walk, self.experience.critic_sees_time)
        if config.critic == "ridge":
            seen = ridge_features(seen, jnp.concatenate([steps.time, walk.state.time[None]]))
            values = seen @ held.critic
        else:
            values = forward(held.critic, seen)[..., 0]
        advantages = gae(rewards, values, steps.ended, config.discount, config.gae_lambda)
        targets = (advantages + values[:-1]).reshape(-1)
        flat = steps._replace(weight=steps.weight * lasts).flat()
        actor = self.natural_gradient_step(held.actor, flat, standardise(advantages.reshape(-1), flat.weight))
        rows = seen[:-1].reshape(len(targets), -1)
        if config.critic == "ridge":
            return ActorCritic(actor, ridge_regression(rows, targets, lasts.reshape(-1), config.ridge), ())
        return ActorCritic(actor, *self._fit(held, rows, targets, key))

    def natural_gradient_step(self, actor: PolicyNet, steps: StepBatch, advantages: AnyArray) -> PolicyNet:
        """Return the policy after a step along the natural gradient, for standardised advantages (N,)."""
        config = self.config
        start, whole = ravel_pytree(actor)
        better, distance = objective(self.world, actor, steps, advantages, config.entropy)
        some = StepBatch(*(x[:: config.fisher_every] for x in steps))
        _, near = objective(self.world, actor, some, advantages[:: config.fisher_every], 0.0)
        slope = jax.grad(lambda x: better(whole(x)))(start)
        curve = jax.grad(lambda x: near(whole(x)))

        def fisher(v: AnyArray) -> AnyArray:
            return jax.jvp(curve, (start,), (v,))[1] + config.damping * v

        direction = conjugate_gradients(fisher, slope, config.cg_iterations)
        full = direction * jnp.sqrt(2 * config.kl / jnp.maximum(direction @ fisher(direction), 1e-12))
        before = better(actor)

        def refused(k: AnyArray) -> AnyArray:
            there = whole(start + config.shrink**k * full)
            gain = better(there) - before
            kl = distance(there)
            if config.strict:
                return ~((gain > 0) & (kl < config.accepted_kl))
            return ~((gain >= 0) & (kl <= config.accepted_kl))

        k = jax.lax.while_loop(lambda k: (k < config.halvings) & refused(k), lambda k: k + 1.0, 0.0)
        return whole(start + jnp.where(k < config.halvings, config.shrink**k, 0.0) * full)

    def _fit(self, held: ActorCritic, rows: AnyArray, targets: AnyArray, key: AnyArray) -> tuple[Any, Any]:
        config = self.config
        size = len(targets)
        each = min(config.critic_batch, size)

        def error(critic: Any, rows: AnyArray, targets: AnyArray) -> AnyArray:
            return ((forward(critic, rows)[:, 0] - targets) ** 2).mean()

        def batch(carry: Any, chosen: AnyArray) -> tuple[Any, None]:
            critic, optimiser = carry
            return gradient_step(self._adam, error, critic, optimiser, rows[chosen], targets[chosen]), None

        orders = shuffled(key, size, config.critic_epochs, each, size // each)
        return jax.lax.scan(batch, (held.critic, held.optimiser), orders)[0]


def objective(
    world: World, actor: PolicyNet, steps: StepBatch, advantages: AnyArray, entropy: float
) -> tuple[Any, Any]:
    """Return two functions of a policy: its surrogate advantage on these steps, and its mean divergence from `actor`."""
    head = world.head
    old = (forward(actor.net, steps.seen), actor.deviations)
    before = head.log_prob(*old, steps.action)

    def better(new: PolicyNet) -> AnyArray:
        output = forward(new.net, steps.seen)
        ratio = jnp.exp(head.log_prob(output, new.deviations, steps.action) - before)
        spread = jax.lax.stop_gradient(head.entropy(output, new.deviations))
        return mean(ratio * (advantages + entropy * spread), steps.weight)

    def distance(new: PolicyNet) -> AnyArray:
        return mean(head.divergence(old, (forward(new.net, steps.seen), new.deviations)), steps.weight)

    return better, distance


def conjugate_gradients(product: Product, target: AnyArray, iterations: int) -> AnyArray:
    """Return an approximation of x with product(x) = target."""

    def once(_: int, carry: tuple[AnyArray, AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray, AnyArray]:
        x, rest, way = carry
        norm = rest @ rest
        along = product(way)
        step = jnp.where(norm > 1e-10, norm / jnp.maximum(way @ along, 1e-20), 0.0)
        x = x + step * way
        after = rest - step * along
        return x, after, after + (after @ after) / jnp.maximum(norm, 1e-20) * way

    solution: AnyArray = jax.lax.fori_loop(0, iterations, once, (jnp.zeros_like(target), target, target))[0]
    return solution


def ridge_features(seen: AnyArray, time: AnyArray) -> AnyArray:
    """Return features (..., 2 D + 4): observations (..., D), their squares, and powers of the time."""
    o = jnp.clip(seen, -10, 10)
    u = (time / LONG).astype(jnp.float32)[..., None]
    return jnp.concatenate([o, o**2, u, u**2, u**3, jnp.ones_like(u)], -1)


def ridge_regression(rows: AnyArray, targets: AnyArray, weight: AnyArray, ridge: float) -> AnyArray:
    """Return the weights (D,) of least squared error on weighted rows (N, D), and of least norm among those."""
    scaled = rows * weight[:, None]
    values, vectors = jnp.linalg.eigh(scaled.T @ rows + ridge * jnp.eye(rows.shape[1]))
    inverse = jnp.where(values > CUT * values[-1], 1 / values, 0.0)
    return vectors @ (inverse * (vectors.T @ (scaled.T @ targets)))
