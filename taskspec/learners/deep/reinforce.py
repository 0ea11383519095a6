"""Training a policy on the true reward, and the parts that all learners with nets share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from taskspec.data.demonstrations import role
from taskspec.exact.model.failure import misused
from taskspec.learners.case import LearnerCase
from taskspec.learners.configurations import Experience, Ppo, Trpo
from taskspec.learners.deep.engine import Schedule, of_seed, trained
from taskspec.learners.deep.ppo import ActorCritic, PolicyNet, PpoUpdate, acting
from taskspec.learners.deep.trpo import TrpoUpdate
from taskspec.learners.deep.world import Played, Walk, World
from taskspec.learners.policies import NetPolicy
from taskspec.modifiers import modify
from taskspec.task.task import Task

Array = Any
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


def begun(update: Update, key: Array) -> Learning:
    """A policy that has learned nothing."""
    first, second = jax.random.split(key)
    return Learning(update.init(first), update.world.begin(second, update.experience.lanes))


def played(update: Update, learning: Learning, key: Array) -> tuple[Walk, Played]:
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

    def advance(learning: Learning, key: Array, shared: Any) -> Learning:
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
