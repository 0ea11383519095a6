"""Behavioural cloning: the expert's actions as a problem of supervised learning."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from taskspec.learners.case import LearnerCase
from taskspec.learners.configurations import Cloning, Experience
from taskspec.learners.deep.engine import Schedule, trained
from taskspec.learners.deep.nets import says
from taskspec.learners.deep.ppo import PolicyNet, begun_actor
from taskspec.learners.deep.reinforce import policies, world_of
from taskspec.learners.deep.world import World
from taskspec.learners.policies import NetPolicy

Array = Any


def cloned(config: Cloning, case: LearnerCase) -> list[NetPolicy]:
    """Policies that do what was demonstrated."""
    world, shown = world_of(case.task, Experience()), case.demonstrations
    first = shown.starts[max(1, round(config.share * len(shown.starts))) :]
    rows = int(first[0]) if len(first) else len(shown)
    seen = world.seen(np.asarray(shown.obs)[:rows])
    acts = world.head.vectors.flat(np.asarray(shown.acts)[:rows])
    data = (np.asarray(seen, np.float32), acts)
    adam = optax.adam(config.learning_rate)

    def init(key: Array) -> Any:
        actor = begun_actor(key, world, config.hidden)
        return actor, adam.init(actor)

    def advance(state: Any, key: Array, data: Any) -> Any:
        actor, optimiser = state
        chosen = jax.random.randint(key, (config.batch,), 0, rows)
        slope = jax.grad(loss)(actor, config, world, data[0][chosen], data[1][chosen])
        change, optimiser = adam.update(slope, optimiser)
        return optax.apply_updates(actor, change), optimiser

    updates = max(config.updates, config.epochs * -(-rows // config.batch))
    actor, _ = trained(case, init, advance, Schedule(updates, 0), data)
    return policies(case, world, actor)


def loss(actor: PolicyNet, config: Cloning, world: World, seen: Array, action: Array) -> Array:
    """How far the actor is from actions (N, K) on what is seen (N, D)."""
    said, vectors = says(actor.net, seen), world.head.vectors
    if not vectors.counts and config.loss == "squared":
        return ((said - action) ** 2).mean()
    if vectors.counts and config.joint:
        return -(vectors.one_hot(action) * jax.nn.log_softmax(said)).sum(-1).mean()
    return -jnp.mean(world.head.log_prob(said, actor.deviations, action))
