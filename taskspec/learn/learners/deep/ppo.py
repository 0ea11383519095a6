"""Proximal policy optimisation (Schulman et al., 2017), as in Stable Baselines 2, and generalised advantages."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.deep.nets import Net, forward, gradient_step, net, orthogonal, shuffled
from taskspec.learn.learners.deep.world import Act, RolloutState, StepBatch, World, in_complete_episode, round_length
from taskspec.learn.learners.paper_settings import Ppo


def critic_observations(world: World, steps: StepBatch, walk: RolloutState, sees_time: bool) -> AnyArray:
    """Return the inputs (T + 1, E, D) of a critic: steps, and the states that they led to."""
    last = _seen(world, walk.seen, walk.gone, walk.state.time, sees_time)
    return jnp.concatenate([_seen(world, *steps[:3], sees_time), last[None]])


def critic_input_size(world: World, sees_time: bool) -> int:
    return world.seen.size + world.absorbs + (sees_time and world.horizon is not None)


def _seen(world: World, seen: AnyArray, gone: AnyArray, time: AnyArray, sees_time: bool) -> AnyArray:
    parts = [seen]
    if world.absorbs:
        parts.append(gone[..., None])
    if sees_time and world.horizon is not None:
        parts.append((time / world.horizon).astype(jnp.float32)[..., None])
    return jnp.concatenate(parts, -1)


def gae(rewards: AnyArray, values: AnyArray, ended: AnyArray, gamma: float, gae_lambda: float) -> AnyArray:
    """Return generalised advantages (T, E) from rewards (T, E) and values (T + 1, E); the end of an episode has value 0.

    Source: Schulman et al. (2016), equations 11 and 16.
    """
    discounts = gamma * (1 - ended)
    deltas = rewards + discounts * values[1:] - values[:-1]

    def back(later: AnyArray, now: tuple[AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray]:
        delta, discount = now
        advantage = delta + gae_lambda * discount * later
        return advantage, advantage

    return jax.lax.scan(back, jnp.zeros_like(deltas[0]), (deltas, discounts), reverse=True)[1]


def standardise(values: AnyArray, weight: AnyArray) -> AnyArray:
    """Return values shifted and scaled to mean 0 and deviation 1, weighted."""
    total = jnp.maximum(weight.sum(), 1.0)
    centred = values - (values * weight).sum() / total
    return centred / (jnp.sqrt((centred**2 * weight).sum() / total) + 1e-8)


def mean(values: AnyArray, weight: AnyArray) -> AnyArray:
    """Return the weighted mean."""
    return (values * weight).sum() / jnp.maximum(weight.sum(), 1.0)


class PolicyNet(NamedTuple):
    """A policy: its net, and the log-deviations of real actions."""

    net: Net
    deviations: AnyArray


class ActorCritic(NamedTuple):
    """A policy, its critic (a net, or the weights of a regression), and the state of the optimiser."""

    actor: PolicyNet
    critic: Any
    optimiser: Any


class PpoUpdate:
    """PPO on a world: initial policies and their updates."""

    def __init__(self, config: Ppo, world: World) -> None:
        self.config = config
        self.world = world
        self.experience = config.experience
        self.steps = round_length(world, config.experience)
        self._adam = optax.chain(
            optax.clip_by_global_norm(config.gradient_norm), optax.adam(config.learning_rate, eps=1e-5)
        )

    def init(self, key: AnyArray) -> ActorCritic:
        actor, critic = jax.random.split(key)
        policy = init_actor(actor, self.world, self.config.hidden)
        inputs = critic_input_size(self.world, self.experience.critic_sees_time)
        judge = net(critic, inputs, self.config.hidden, 1, orthogonal(1.0))
        return ActorCritic(policy, judge, self._adam.init((policy, judge)))

    def update(
        self, held: ActorCritic, steps: StepBatch, walk: RolloutState, rewards: AnyArray, key: AnyArray
    ) -> ActorCritic:
        """Return the policy after a rollout (T, E, ...) with `rewards` (T, E) that led to `walk`."""
        config = self.config
        seen = critic_observations(self.world, steps, walk, self.experience.critic_sees_time)
        values = forward(held.critic, seen)[..., 0]
        advantages = gae(rewards, values, steps.ended, config.discount, config.gae_lambda)
        if self.experience.whole:
            steps = steps._replace(weight=steps.weight * in_complete_episode(steps))
        flat = steps.flat()
        old = self.world.head.log_prob(forward(held.actor.net, flat.seen), held.actor.deviations, flat.action)
        judged_as = seen[:-1].reshape(len(old), -1)
        data = (flat.seen, flat.action, flat.weight, old, judged_as, advantages.reshape(-1), values[:-1].reshape(-1))
        return self._epochs(held, data, key)

    def _epochs(self, held: ActorCritic, data: Any, key: AnyArray) -> ActorCritic:
        size = len(data[0])

        def batch(carry: Any, chosen: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            return gradient_step(self._adam, self.loss, nets, optimiser, *(x[chosen] for x in data)), None

        batches = self.config.minibatches
        orders = shuffled(key, size, self.config.epochs, size // batches, batches)
        (nets, optimiser), _ = jax.lax.scan(batch, ((held.actor, held.critic), held.optimiser), orders)
        return ActorCritic(*nets, optimiser)

    def loss(
        self, nets: Any, seen: AnyArray, action: AnyArray, weight: AnyArray, old: AnyArray, critic_observations: AnyArray,
        advantages: AnyArray, values: AnyArray,
    ) -> AnyArray:  # fmt: skip
        """Return the loss over a minibatch, (N, ...) each: clipped surrogate, entropy bonus and squared error of the critic."""
        actor, critic = nets
        config = self.config
        head = self.world.head
        output = forward(actor.net, seen)
        ratio = jnp.exp(head.log_prob(output, actor.deviations, action) - old)
        gain = standardise(advantages, weight)
        clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
        better = mean(jnp.minimum(ratio * gain, clipped * gain), weight)
        value = forward(critic, critic_observations)[..., 0]
        target = advantages + values
        error = (value - target) ** 2
        if config.value_clip is not None:
            near = values + jnp.clip(value - values, -config.value_clip, config.value_clip)
            error = jnp.maximum(error, (near - target) ** 2)
        spread = mean(head.entropy(output, actor.deviations), weight)
        return -better - config.entropy * spread + config.value_weight * 0.5 * error.mean()


def init_actor(key: AnyArray, world: World, hidden: tuple[int, ...]) -> PolicyNet:
    """Return a policy whose actions are nearly equally likely; deviations are 1."""
    head = world.head
    return PolicyNet(net(key, world.seen.size, hidden, head.vectors.size, orthogonal(0.01)), jnp.zeros(head.deviations))


def sampler(world: World, actor: PolicyNet) -> Act:
    """Return a function that samples actions of a policy; the net runs once for each value of a single finite observation."""
    if world.seen.single:
        outputs = forward(actor.net, jnp.eye(world.seen.size))
        return lambda seen, noise: world.head.sample(seen @ outputs, actor.deviations, noise)
    return lambda seen, noise: world.head.sample(forward(actor.net, seen), actor.deviations, noise)
