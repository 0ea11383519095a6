"""Training a policy on the true reward, and the parts that all learners with nets share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.exact.model.model import misused
from taskspec.language.modifiers import modify
from taskspec.language.registry import role
from taskspec.language.task.task import Task
from taskspec.learn.learners.deep.ppo import ActorCritic, PolicyNet, PpoUpdate, sampler
from taskspec.learn.learners.deep.trpo import TrpoUpdate
from taskspec.learn.learners.deep.world import RolloutState, Schedule, StepBatch, World, seed_slice, train_seeds
from taskspec.learn.learners.interface import LearnerCase, NetPolicy
from taskspec.learn.learners.paper_settings import Experience, Ppo, Trpo

Update = PpoUpdate | TrpoUpdate


class PolicyState(NamedTuple):
    """A policy in training, and where its lanes are."""

    policy: ActorCritic
    walk: RolloutState


def world_of(task: Task, experience: Experience) -> World:
    """Return where a learner acts in a task."""
    task = role(task, experience.where)
    if experience.horizon is not None:
        task = modify(task, {"horizon": experience.horizon})
    return World.of(task, experience.absorb)


def policy_update(config: Ppo | Trpo, world: World) -> Update:
    """Return the optimiser of a policy's settings."""
    if isinstance(config, Ppo):
        return PpoUpdate(config, world)
    return TrpoUpdate(config, world)


def init_policy_state(update: Update, key: AnyArray) -> PolicyState:
    """Return an untrained policy at the start of its episodes."""
    first, second = jax.random.split(key)
    return PolicyState(update.init(first), update.world.begin(second, update.experience.lanes))


def collect(update: Update, learning: PolicyState, key: AnyArray) -> tuple[RolloutState, StepBatch]:
    """Return the steps of a round of the current policy, and the state that they led to."""
    first, second = jax.random.split(key)
    world = update.world
    experience = update.experience
    walk = learning.walk
    if experience.whole:
        walk = world.begin(first, experience.lanes)
    return world.rollout(walk, sampler(world, learning.policy.actor), second, update.steps)


def policies(
    case: LearnerCase, world: World, actors: PolicyNet, rewards: Callable[[int], Any] | None = None
) -> list[NetPolicy]:
    """Return a policy for each seed, as NumPy arrays; `rewards` gives the reward that a seed learned."""
    trained = []
    for i, seed in enumerate(case.seeds):
        actor = seed_slice(actors, i)
        layers = [(np.asarray(w, np.float64), np.asarray(b, np.float64)) for w, b in actor.net]
        reward = None if rewards is None else rewards(i)
        trained.append(NetPolicy(world.seen, world.head.vectors, layers, np.asarray(actor.deviations), seed, reward))
    return trained


def train_ppo(config: Ppo, case: LearnerCase) -> list[NetPolicy]:
    """Train policies on the true reward."""
    world = world_of(case.task, config.experience)
    update = PpoUpdate(config, world)

    def advance(learning: PolicyState, key: AnyArray, shared: Any) -> PolicyState:
        first, second = jax.random.split(key)
        walk, steps = collect(update, learning, first)
        return PolicyState(update.update(learning.policy, steps, walk, steps.reward, second), walk)

    each = update.steps * update.experience.lanes
    plan = Schedule(rounds(case, each), each, shown=lambda learning: policies(case, world, learning.policy.actor))
    last = train_seeds(case, lambda key: init_policy_state(update, key), advance, plan)
    return policies(case, world, last.policy.actor)


def rounds(case: LearnerCase, each: int) -> int:
    """Return the number of rounds of `each` counted steps in the budget."""
    if case.steps < each:
        misused(f"a round of this learner takes {each:,} steps, and {case.steps:,} are granted")
    return case.steps // each
