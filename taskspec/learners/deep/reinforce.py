"""Training a policy on the true reward, cloning, and the parts that all learners with nets share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from taskspec.base.arrays import AnyArray
from taskspec.data.episodes import role
from taskspec.learners.case import LearnerCase
from taskspec.learners.deep.nets import says
from taskspec.learners.deep.ppo import ActorCritic, PolicyNet, PpoUpdate, acting, begun_actor
from taskspec.learners.deep.trpo import TrpoUpdate
from taskspec.learners.deep.world import Played, Schedule, Walk, World, of_seed, trained
from taskspec.learners.learned import NetPolicy
from taskspec.learners.settings import Cloning, Experience, Ppo, Trpo
from taskspec.model.model import misused
from taskspec.modifiers import modify
from taskspec.task.task import Task

# ---------- reinforce
# Training a policy on the true reward, and the parts that all learners with nets share.

Update = PpoUpdate | TrpoUpdate


class Learning(NamedTuple):
    """A policy in training, and where its lanes are."""

    policy: ActorCritic
    walk: Walk


def world_of(task: Task, experience: Experience) -> World:
    """Return where a learner acts in a task."""
    task = role(task, experience.where)
    if experience.horizon is not None:
        task = modify(task, {"horizon": experience.horizon})
    return World.of(task, experience.absorb)


def update_of(config: Ppo | Trpo, world: World) -> Update:
    """How a policy is improved."""
    return PpoUpdate(config, world) if isinstance(config, Ppo) else TrpoUpdate(config, world)


def begun(update: Update, key: AnyArray) -> Learning:
    """A policy that has learned nothing."""
    first, second = jax.random.split(key)
    return Learning(update.init(first), update.world.begin(second, update.experience.lanes))


def played(update: Update, learning: Learning, key: AnyArray) -> tuple[Walk, Played]:
    """A round of steps with the policy as it is."""
    first, second = jax.random.split(key)
    world, experience = update.world, update.experience
    walk = world.begin(first, experience.lanes) if experience.whole else learning.walk
    return world.walk(walk, acting(world, learning.policy.actor), second, update.steps)


def policies(
    case: LearnerCase, world: World, actors: PolicyNet, rewards: Callable[[int], Any] | None = None
) -> list[NetPolicy]:
    """A policy for each seed; `rewards` gives what a seed learned of the reward."""
    found = []
    for i, seed in enumerate(case.seeds):
        actor = of_seed(actors, i)
        layers = [(np.asarray(w, np.float64), np.asarray(b, np.float64)) for w, b in actor.net]
        reward = None if rewards is None else rewards(i)
        found.append(NetPolicy(world.seen, world.head.vectors, layers, np.asarray(actor.deviations), seed, reward))
    return found


def reinforced(config: Ppo, case: LearnerCase) -> list[NetPolicy]:
    """Policies that learned from the reward."""
    world = world_of(case.task, config.experience)
    update = PpoUpdate(config, world)

    def advance(learning: Learning, key: AnyArray, shared: Any) -> Learning:
        first, second = jax.random.split(key)
        walk, steps = played(update, learning, first)
        return Learning(update.update(learning.policy, steps, walk, steps.reward, second), walk)

    each = update.steps * update.experience.lanes
    plan = Schedule(rounds(case, each), each, shown=lambda learning: policies(case, world, learning.policy.actor))
    last = trained(case, lambda key: begun(update, key), advance, plan)
    return policies(case, world, last.policy.actor)


def rounds(case: LearnerCase, each: int) -> int:
    """How many rounds of so many counted steps there are in the budget.

    Raises:
        SpecError: E713 where there is not one.
    """
    if case.steps < each:
        misused(f"a round of this learner takes {each:,} steps, and {case.steps:,} are granted")
    return case.steps // each


# ---------- clone
# Behavioural cloning: the expert's actions as a problem of supervised learning.


def cloned(config: Cloning, case: LearnerCase) -> list[NetPolicy]:
    """Policies that do what was demonstrated."""
    world, shown = world_of(case.task, Experience()), case.demonstrations
    first = shown.starts[max(1, round(config.share * len(shown.starts))) :]
    rows = int(first[0]) if len(first) else len(shown)
    seen = world.seen(np.asarray(shown.obs)[:rows])
    acts = world.head.vectors.flat(np.asarray(shown.acts)[:rows])
    data = (np.asarray(seen, np.float32), acts)
    adam = optax.adam(config.learning_rate)

    def init(key: AnyArray) -> Any:
        actor = begun_actor(key, world, config.hidden)
        return actor, adam.init(actor)

    def advance(state: Any, key: AnyArray, data: Any) -> Any:
        actor, optimiser = state
        chosen = jax.random.randint(key, (config.batch,), 0, rows)
        slope = jax.grad(loss)(actor, config, world, data[0][chosen], data[1][chosen])
        change, optimiser = adam.update(slope, optimiser)
        return optax.apply_updates(actor, change), optimiser

    updates = max(config.updates, config.epochs * -(-rows // config.batch))
    actor, _ = trained(case, init, advance, Schedule(updates, 0), data)
    return policies(case, world, actor)


def loss(actor: PolicyNet, config: Cloning, world: World, seen: AnyArray, action: AnyArray) -> AnyArray:
    """How far the actor is from actions (N, K) on what is seen (N, D)."""
    said, vectors = says(actor.net, seen), world.head.vectors
    if not vectors.counts and config.loss == "squared":
        return ((said - action) ** 2).mean()
    if vectors.counts and config.joint:
        return -(vectors.one_hot(action) * jax.nn.log_softmax(said)).sum(-1).mean()
    return -jnp.mean(world.head.log_prob(said, actor.deviations, action))
