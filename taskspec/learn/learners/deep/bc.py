"""Behavioural cloning."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.deep.nets import forward, gradient_step
from taskspec.learn.learners.deep.policy_training import policies, world_of
from taskspec.learn.learners.deep.ppo import PolicyNet, init_actor
from taskspec.learn.learners.deep.world import Schedule, World, train_seeds
from taskspec.learn.learners.interface import LearnerCase, NetPolicy
from taskspec.learn.learners.paper_settings import Cloning, Experience


def train_bc(config: Cloning, case: LearnerCase) -> list[NetPolicy]:
    """Train policies by supervised learning of the demonstrated actions."""
    world = world_of(case.task, Experience())
    shown = case.demonstrations
    first = shown.starts[max(1, round(config.share * len(shown.starts))) :]
    rows = int(first[0]) if len(first) else len(shown)
    seen = world.seen(np.asarray(shown.obs)[:rows])
    acts = world.head.vectors.flat(np.asarray(shown.acts)[:rows])
    data = (np.asarray(seen, np.float32), acts)
    adam = optax.adam(config.learning_rate)

    def init(key: AnyArray) -> Any:
        actor = init_actor(key, world, config.hidden)
        return actor, adam.init(actor)

    def advance(state: Any, key: AnyArray, data: Any) -> Any:
        actor, optimiser = state
        chosen = jax.random.randint(key, (config.batch,), 0, rows)
        return gradient_step(adam, loss, actor, optimiser, config, world, data[0][chosen], data[1][chosen])

    updates = max(config.updates, config.epochs * -(-rows // config.batch))
    actor, _ = train_seeds(case, init, advance, Schedule(updates, 0), data)
    return policies(case, world, actor)


def loss(actor: PolicyNet, config: Cloning, world: World, seen: AnyArray, action: AnyArray) -> AnyArray:
    """Return the loss of a policy on actions (N, K) and observations (N, D)."""
    output = forward(actor.net, seen)
    vectors = world.head.vectors
    if not vectors.counts and config.loss == "squared":
        return ((output - action) ** 2).mean()
    if vectors.counts and config.joint:
        return -(vectors.one_hot(action) * jax.nn.log_softmax(output)).sum(-1).mean()
    return -jnp.mean(world.head.log_prob(output, actor.deviations, action))
