"""Trust-region policy optimisation (Schulman et al., 2015), with the options of two packages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from jax.flatten_util import ravel_pytree

from taskspec.base.arrays import AnyArray
from taskspec.learners.deep.nets import net, orthogonal, says, xavier
from taskspec.learners.deep.ppo import ActorCritic, PolicyNet, advantages, critic_inputs, judged, mean, standardised
from taskspec.learners.deep.world import Played, Walk, World, complete, round_length
from taskspec.learners.settings import Trpo

Product = Callable[[AnyArray], AnyArray]
"""A symmetric matrix times a vector."""
LONG = 100
"""Steps that the regression counts time in."""
CUT = 1e-6
"""Eigenvalues that are smaller than the largest by this are taken for 0, as float32 cannot tell."""


class TrpoUpdate:
    """How a policy of `world` is begun, acts, and is improved (see `PpoUpdate`)."""

    def __init__(self, config: Trpo, world: World) -> None:
        self.config, self.world = config, world
        self.experience = config.experience
        self.steps = round_length(world, config.experience)
        self._adam = optax.adam(config.critic_learning_rate)

    def init(self, key: AnyArray) -> ActorCritic:
        first, second = jax.random.split(key)
        config, head = self.config, self.world.head
        plain = config.weights == "xavier"
        layers = net(
            first, self.world.seen.size, config.hidden, head.vectors.size, xavier if plain else orthogonal(0.01)
        )
        actor = PolicyNet(layers, jnp.zeros(head.deviations))
        inputs = critic_inputs(self.world, self.experience.critic_sees_time)
        if config.critic == "ridge":
            return ActorCritic(actor, jnp.zeros(2 * inputs + 4), ())
        critic = net(second, inputs, config.hidden, 1, xavier if plain else orthogonal(1.0))
        return ActorCritic(actor, critic, self._adam.init(critic))

    def update(self, held: ActorCritic, steps: Played, walk: Walk, rewards: AnyArray, key: AnyArray) -> ActorCritic:
        """The policy after a round of steps (T, E, ...), paid `rewards` (T, E), that led to `walk`."""
        config, lasts = self.config, complete(steps) if self.experience.whole else jnp.ones_like(rewards)
        seen = judged(self.world, steps, walk, self.experience.critic_sees_time)
        if config.critic == "ridge":
            seen = features(seen, jnp.concatenate([steps.time, walk.state.time[None]]))
            values = seen @ held.critic
        else:
            values = says(held.critic, seen)[..., 0]
        gains = advantages(rewards, values, steps.ended, config.discount, config.trace)
        targets = (gains + values[:-1]).reshape(-1)
        flat = steps._replace(weight=steps.weight * lasts).flat()
        actor = self.improved(held.actor, flat, standardised(gains.reshape(-1), flat.weight))
        rows = seen[:-1].reshape(len(targets), -1)
        if config.critic == "ridge":
            return ActorCritic(actor, regression(rows, targets, lasts.reshape(-1), config.ridge), ())
        return ActorCritic(actor, *self._fitted(held, rows, targets, key))

    def improved(self, actor: PolicyNet, steps: Played, gains: AnyArray) -> PolicyNet:
        """The policy after a step along the natural gradient, of standardised advantages (N,)."""
        config, (start, whole) = self.config, ravel_pytree(actor)
        better, apart = objective(self.world, actor, steps, gains, config.entropy)
        some = Played(*(x[:: config.fisher_every] for x in steps))
        _, near = objective(self.world, actor, some, gains[:: config.fisher_every], 0.0)
        slope = jax.grad(lambda x: better(whole(x)))(start)
        curve = jax.grad(lambda x: near(whole(x)))

        def fisher(v: AnyArray) -> AnyArray:
            return jax.jvp(curve, (start,), (v,))[1] + config.damping * v

        way = conjugate_gradients(fisher, slope, config.cg_iterations)
        full = way * jnp.sqrt(2 * config.kl / jnp.maximum(way @ fisher(way), 1e-12))
        before = better(actor)

        def refused(k: AnyArray) -> AnyArray:
            there = whole(start + config.shrink**k * full)
            gain, distance = better(there) - before, apart(there)
            fits = (
                (gain > 0) & (distance < config.accepted_kl)
                if config.strict
                else (gain >= 0) & (distance <= config.accepted_kl)
            )
            return ~fits

        k = jax.lax.while_loop(lambda k: (k < config.halvings) & refused(k), lambda k: k + 1.0, 0.0)
        return whole(start + jnp.where(k < config.halvings, config.shrink**k, 0.0) * full)  # type: ignore[no-any-return]

    def _fitted(self, held: ActorCritic, rows: AnyArray, targets: AnyArray, key: AnyArray) -> tuple[Any, Any]:
        """The critic, a few epochs nearer to its targets."""
        config, size = self.config, len(targets)
        each = min(config.critic_batch, size)
        orders = jax.vmap(lambda k: jax.random.permutation(k, size))(jax.random.split(key, config.critic_epochs))

        def batch(carry: Any, chosen: AnyArray) -> tuple[Any, None]:
            critic, optimiser = carry
            slope = jax.grad(lambda c: ((says(c, rows[chosen])[:, 0] - targets[chosen]) ** 2).mean())(critic)
            change, optimiser = self._adam.update(slope, optimiser)
            return (optax.apply_updates(critic, change), optimiser), None

        orders = orders[:, : size // each * each].reshape(-1, each)
        return jax.lax.scan(batch, (held.critic, held.optimiser), orders)[0]


def objective(world: World, actor: PolicyNet, steps: Played, gains: AnyArray, entropy: float) -> tuple[Any, Any]:
    """Functions of a policy: what it gains over `actor` on these steps, and how far it is from it."""
    head, old = world.head, (says(actor.net, steps.seen), actor.deviations)
    before = head.log_prob(*old, steps.action)

    def better(new: PolicyNet) -> AnyArray:
        said = says(new.net, steps.seen)
        ratio = jnp.exp(head.log_prob(said, new.deviations, steps.action) - before)
        spread = jax.lax.stop_gradient(head.entropy(said, new.deviations))
        return mean(ratio * (gains + entropy * spread), steps.weight)

    def apart(new: PolicyNet) -> AnyArray:
        return mean(head.divergence(old, (says(new.net, steps.seen), new.deviations)), steps.weight)

    return better, apart


def conjugate_gradients(product: Product, target: AnyArray, iterations: int) -> AnyArray:
    """About x with product(x) = target."""

    def once(_: int, carry: tuple[AnyArray, AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray, AnyArray]:
        x, rest, way = carry
        norm, along = rest @ rest, product(way)
        step = jnp.where(norm > 1e-10, norm / jnp.maximum(way @ along, 1e-20), 0.0)
        x, after = x + step * way, rest - step * along
        return x, after, after + (after @ after) / jnp.maximum(norm, 1e-20) * way

    found: AnyArray = jax.lax.fori_loop(0, iterations, once, (jnp.zeros_like(target), target, target))[0]
    return found


def features(seen: AnyArray, time: AnyArray) -> AnyArray:
    """What the regression sees, (..., 2 D + 4): what is seen (..., D) and its squares, and powers of the time."""
    o, u = jnp.clip(seen, -10, 10), (time / LONG).astype(jnp.float32)[..., None]
    return jnp.concatenate([o, o**2, u, u**2, u**3, jnp.ones_like(u)], -1)


def regression(rows: AnyArray, targets: AnyArray, weight: AnyArray, ridge: float) -> AnyArray:
    """The weights (D,) with the least squared error on rows (N, D) that count, and the least themselves among those."""
    scaled = rows * weight[:, None]
    values, vectors = jnp.linalg.eigh(scaled.T @ rows + ridge * jnp.eye(rows.shape[1]))
    inverse = jnp.where(values > CUT * values[-1], 1 / values, 0.0)
    return vectors @ (inverse * (vectors.T @ (scaled.T @ targets)))
