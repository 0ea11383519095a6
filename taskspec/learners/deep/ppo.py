"""Proximal policy optimisation (Schulman et al., 2017), as Stable Baselines 2 has it, and advantages."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learners.deep.nets import Net, net, orthogonal, says
from taskspec.learners.deep.world import Act, Played, Walk, World, complete, round_length
from taskspec.learners.settings import Ppo

# ---------- advantages
# What actions are worth, from what followed.


def judged(world: World, steps: Played, walk: Walk, sees_time: bool) -> AnyArray:
    """What a critic sees of steps and of where they led, (T + 1, E, D)."""
    return jnp.concatenate([_seen(world, *steps[:3], sees_time), _last(world, walk, sees_time)[None]])


def critic_inputs(world: World, sees_time: bool) -> int:
    return world.seen.size + world.absorbs + (sees_time and world.horizon is not None)


def _last(world: World, walk: Walk, sees_time: bool) -> AnyArray:
    return _seen(world, walk.seen, walk.gone, walk.state.time, sees_time)


def _seen(world: World, seen: AnyArray, gone: AnyArray, time: AnyArray, sees_time: bool) -> AnyArray:
    parts = [seen]
    if world.absorbs:
        parts.append(gone[..., None])
    if sees_time and world.horizon is not None:
        parts.append((time / world.horizon).astype(jnp.float32)[..., None])
    return jnp.concatenate(parts, -1)


def advantages(rewards: AnyArray, values: AnyArray, ended: AnyArray, discount: float, trace: float) -> AnyArray:
    """Generalised advantages (T, E), of rewards (T, E) and values (T + 1, E); the end of an episode is worth 0."""
    lasts = discount * (1 - ended)
    errors = rewards + lasts * values[1:] - values[:-1]

    def back(later: AnyArray, now: tuple[AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray]:
        error, last = now
        found = error + trace * last * later
        return found, found

    return jax.lax.scan(back, jnp.zeros_like(errors[0]), (errors, lasts), reverse=True)[1]


def standardised(values: AnyArray, weight: AnyArray) -> AnyArray:
    """With mean 0 and deviation 1 over those that count."""
    total = jnp.maximum(weight.sum(), 1.0)
    centred = values - (values * weight).sum() / total
    return centred / (jnp.sqrt((centred**2 * weight).sum() / total) + 1e-8)


def mean(values: AnyArray, weight: AnyArray) -> AnyArray:
    """The mean over those that count."""
    return (values * weight).sum() / jnp.maximum(weight.sum(), 1.0)


# ---------- ppo
# Proximal policy optimisation (Schulman et al., 2017), as Stable Baselines 2 has it.


class PolicyNet(NamedTuple):
    """A policy: its net, and the log-deviations of real actions."""

    net: Net
    deviations: AnyArray


class ActorCritic(NamedTuple):
    """What a policy optimiser holds: `critic` is a net, or the weights of a regression."""

    actor: PolicyNet
    critic: Any
    optimiser: Any


class PpoUpdate:
    """How a policy of `world` is begun, acts, and is improved."""

    def __init__(self, config: Ppo, world: World) -> None:
        self.config, self.world = config, world
        self.experience = config.experience
        self.steps = round_length(world, config.experience)
        self._adam = optax.chain(
            optax.clip_by_global_norm(config.gradient_norm), optax.adam(config.learning_rate, eps=1e-5)
        )

    def init(self, key: AnyArray) -> ActorCritic:
        actor, critic = jax.random.split(key)
        found = begun_actor(actor, self.world, self.config.hidden)
        inputs = critic_inputs(self.world, self.experience.critic_sees_time)
        judge = net(critic, inputs, self.config.hidden, 1, orthogonal(1.0))
        return ActorCritic(found, judge, self._adam.init((found, judge)))

    def update(self, held: ActorCritic, steps: Played, walk: Walk, rewards: AnyArray, key: AnyArray) -> ActorCritic:
        """The policy after a round of steps (T, E, ...), paid `rewards` (T, E), that led to `walk`."""
        config = self.config
        seen = judged(self.world, steps, walk, self.experience.critic_sees_time)
        values = says(held.critic, seen)[..., 0]
        gains = advantages(rewards, values, steps.ended, config.discount, config.trace)
        if self.experience.whole:
            steps = steps._replace(weight=steps.weight * complete(steps))
        flat = steps.flat()
        old = self.world.head.log_prob(says(held.actor.net, flat.seen), held.actor.deviations, flat.action)
        judged_as = seen[:-1].reshape(len(old), -1)
        data = (flat.seen, flat.action, flat.weight, old, judged_as, gains.reshape(-1), values[:-1].reshape(-1))
        return self._epochs(held, data, key)

    def _epochs(self, held: ActorCritic, data: Any, key: AnyArray) -> ActorCritic:
        size = len(data[0])

        def batch(carry: Any, chosen: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            slope = jax.grad(self.loss)(nets, *(x[chosen] for x in data))
            change, optimiser = self._adam.update(slope, optimiser, nets)
            return (optax.apply_updates(nets, change), optimiser), None

        each = size // self.config.minibatches
        orders = jax.vmap(lambda k: jax.random.permutation(k, size))(jax.random.split(key, self.config.epochs))
        orders = orders[:, : each * self.config.minibatches].reshape(-1, each)
        (nets, optimiser), _ = jax.lax.scan(batch, ((held.actor, held.critic), held.optimiser), orders)
        return ActorCritic(*nets, optimiser)

    def loss(
        self,
        nets: Any,
        seen: AnyArray,
        action: AnyArray,
        weight: AnyArray,
        old: AnyArray,
        judged: AnyArray,
        gains: AnyArray,
        values: AnyArray,
    ) -> AnyArray:
        """What is made smaller, over a minibatch: each (N, ...)."""
        (actor, critic), config, head = nets, self.config, self.world.head
        said = says(actor.net, seen)
        ratio = jnp.exp(head.log_prob(said, actor.deviations, action) - old)
        gain = standardised(gains, weight)
        clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
        better = mean(jnp.minimum(ratio * gain, clipped * gain), weight)
        value, target = says(critic, judged)[..., 0], gains + values
        error = (value - target) ** 2
        if config.value_clip is not None:
            near = values + jnp.clip(value - values, -config.value_clip, config.value_clip)
            error = jnp.maximum(error, (near - target) ** 2)
        spread = mean(head.entropy(said, actor.deviations), weight)
        return -better - config.entropy * spread + config.value_weight * 0.5 * error.mean()


def begun_actor(key: AnyArray, world: World, hidden: tuple[int, ...]) -> PolicyNet:
    """A policy whose actions are nearly as likely as each other; deviations are 1."""
    head = world.head
    return PolicyNet(net(key, world.seen.size, hidden, head.vectors.size, orthogonal(0.01)), jnp.zeros(head.deviations))


def acting(world: World, actor: PolicyNet) -> Act:
    """The policy's actions, drawn."""
    return lambda seen, noise: world.head.sample(says(actor.net, seen), actor.deviations, noise)
