"""Proximal policy optimisation (Schulman et al., 2017), as Stable Baselines 2 has it."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.learners.configurations import Ppo
from taskspec.learners.deep.advantages import advantages, critic_inputs, judged, mean, standardised
from taskspec.learners.deep.nets import Net, net, orthogonal, says
from taskspec.learners.deep.world import Act, Played, Walk, World, complete, round_length

Array = Any


class PolicyNet(NamedTuple):
    """A policy: its net, and the log-deviations of real actions."""

    net: Net
    deviations: Array


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

    def init(self, key: Array) -> ActorCritic:
        actor, critic = jax.random.split(key)
        found = begun_actor(actor, self.world, self.config.hidden)
        inputs = critic_inputs(self.world, self.experience.critic_sees_time)
        judge = net(critic, inputs, self.config.hidden, 1, orthogonal(1.0))
        return ActorCritic(found, judge, self._adam.init((found, judge)))

    def update(self, held: ActorCritic, steps: Played, walk: Walk, rewards: Array, key: Array) -> ActorCritic:
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

    def _epochs(self, held: ActorCritic, data: Any, key: Array) -> ActorCritic:
        size = len(data[0])

        def batch(carry: Any, chosen: Array) -> tuple[Any, None]:
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
        seen: Array,
        action: Array,
        weight: Array,
        old: Array,
        judged: Array,
        gains: Array,
        values: Array,
    ) -> Array:
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


def begun_actor(key: Array, world: World, hidden: tuple[int, ...]) -> PolicyNet:
    """A policy whose actions are nearly as likely as each other; deviations are 1."""
    head = world.head
    return PolicyNet(net(key, world.seen.size, hidden, head.vectors.size, orthogonal(0.01)), jnp.zeros(head.deviations))


def acting(world: World, actor: PolicyNet) -> Act:
    """The policy's actions, drawn."""
    return lambda seen, noise: world.head.sample(says(actor.net, seen), actor.deviations, noise)
