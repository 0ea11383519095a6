"""Policy gradients over groups of episodes (RLOO, GRPO), and direct preference optimisation (DPO).

An episode is a completion, its first state the prompt, and its steps are the tokens. The reference policy is the policy before
training.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.exact.model.model import misused
from taskspec.learn.learners.deep.nets import forward, gradient_step
from taskspec.learn.learners.deep.policy_training import policies, rounds, world_of
from taskspec.learn.learners.deep.ppo import PolicyNet, init_actor, sampler
from taskspec.learn.learners.deep.world import (
    RolloutState,
    Schedule,
    StepBatch,
    World,
    discounted_rewards,
    in_first_episode,
    train_seeds,
)
from taskspec.learn.learners.interface import LearnerCase, NetPolicy
from taskspec.learn.learners.paper_settings import Direct, Grouped

SMALL = 1e-4
"""Added to the deviation of a group: a group whose returns are all equal has advantages of 0."""


class AlignedState(NamedTuple):
    """A policy in training, its reference, and the state of the optimiser."""

    actor: PolicyNet
    reference: PolicyNet
    optimiser: Any


class GroupEpisodes(NamedTuple):
    """Whole episodes, (T, E, ...): steps, and `live` (T, E), 1.0 for those of the first episode of a lane."""

    steps: StepBatch
    live: AnyArray


def begin_groups(world: World, key: AnyArray, groups: int, group: int) -> RolloutState:
    """Begin `groups` * `group` episodes; those of a group, which lie side by side, begin in the same state."""
    walk = world.begin(key, groups * group)
    first = jnp.repeat(jnp.arange(groups) * group, group)
    values = tuple(value[..., first] for value in walk.state.values)
    return walk._replace(state=walk.state._replace(values=values), seen=walk.seen[first])


def play(world: World, actor: PolicyNet, walk: RolloutState, key: AnyArray) -> GroupEpisodes:
    """Play the episodes that were begun to their ends."""
    _, steps = world.rollout(walk, sampler(world, actor), key, world.length)
    return GroupEpisodes(steps, in_first_episode(steps))


def returns(world: World, episodes: GroupEpisodes) -> AnyArray:
    """Return the discounted return of each episode (E,)."""
    return discounted_rewards(world.task, episodes.steps, episodes.live).sum(0)


def log_probs(world: World, actor: PolicyNet, episodes: GroupEpisodes) -> AnyArray:
    """Return the log-probability of each action (T, E)."""
    steps = episodes.steps
    return world.head.log_prob(forward(actor.net, steps.seen), actor.deviations, steps.action)


class GroupUpdate:
    """RLOO and GRPO on a world: the advantages of a group, and the loss of its episodes."""

    def __init__(self, config: Grouped, world: World) -> None:
        self.config = config
        self.world = world
        self.adam = _optimiser(config)

    def advance(self, held: AlignedState, key: AnyArray, _: Any) -> AlignedState:
        """Play a round of groups and learn from it."""
        config = self.config
        begin, noise = jax.random.split(key)
        walk = begin_groups(self.world, begin, config.groups, config.group)
        episodes = play(self.world, held.actor, walk, noise)
        old = log_probs(self.world, held.actor, episodes)
        reference = log_probs(self.world, held.reference, episodes)
        gained = returns(self.world, episodes)
        if config.kl_in == "return":
            gained = gained - config.kl * ((old - reference) * episodes.live).sum(0)
        data = (episodes, old, reference, self.advantages(gained))

        def once(carry: Any, _: Any) -> tuple[Any, None]:
            return gradient_step(self.adam, self.loss, *carry, *data), None

        (actor, optimiser), _ = jax.lax.scan(once, (held.actor, held.optimiser), None, config.epochs)
        return AlignedState(actor, held.reference, optimiser)

    def advantages(self, gained: AnyArray) -> AnyArray:
        """Return the advantage of each episode (E,) within its group.

        Source: Ahmadian et al. (2024), section 2.3.2, for the mean of the others; Shao et al. (2024), section 4.1, for the
        standardised one.
        """
        config = self.config
        R = gained.reshape(config.groups, config.group)
        A = R - R.mean(1, keepdims=True)
        if config.baseline == "others":
            A = A * config.group / (config.group - 1)
        if config.standardised:
            A = A / (R.std(1, ddof=1, keepdims=True) + SMALL)
        return A.reshape(-1)

    def loss(
        self, actor: PolicyNet, episodes: GroupEpisodes, old: AnyArray, reference: AnyArray, advantages: AnyArray
    ) -> AnyArray:
        """Return the loss: clipped surrogate, and the divergence from the reference where it is not part of the return.

        Source: Shao et al. (2024), equations 3 and 4.
        """
        config = self.config
        now = log_probs(self.world, actor, episodes)
        ratio = jnp.exp(now - old)
        clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
        gain = jnp.minimum(ratio * advantages, clipped * advantages)
        if config.kl_in == "loss":
            ahead = reference - now
            gain = gain - config.kl * (jnp.exp(ahead) - ahead - 1)
        gain = gain * episodes.live
        lengths = episodes.live.sum(0)
        if config.average == "episode":
            return -(gain.sum(0) / lengths).mean()
        if config.average == "step":
            return -gain.sum() / lengths.sum()
        return -gain.sum(0).mean()


class DirectUpdate:
    """DPO on a world: pairs of episodes of the reference policy, and the loss of their comparisons.

    Args:
        judge: the world whose rewards label the pairs; otherwise equal to `world`.
    """

    def __init__(self, config: Direct, world: World, judge: World) -> None:
        self.config = config
        self.world = world
        self.judge = judge
        self.adam = _optimiser(config)

    def advance(self, held: AlignedState, key: AnyArray, _: Any) -> AlignedState:
        """Compare new pairs of the reference policy and learn from the labels."""
        begin, noise = jax.random.split(key)
        walk = begin_groups(self.judge, begin, self.config.pairs, 2)
        episodes = play(self.judge, held.reference, walk, noise)
        reference = log_probs(self.world, held.reference, episodes)
        R = returns(self.judge, episodes).reshape(-1, 2)
        actor, optimiser = gradient_step(self.adam, self.loss, held.actor, held.optimiser, episodes, reference, R)
        return AlignedState(actor, held.reference, optimiser)

    def loss(self, actor: PolicyNet, episodes: GroupEpisodes, reference: AnyArray, R: AnyArray) -> AnyArray:
        """Return minus the log-likelihood of the labels; equal returns are half a preference for each.

        Source: Rafailov et al. (2023), equation 7.
        """
        ahead = (log_probs(self.world, actor, episodes) - reference) * episodes.live
        rewards = self.config.beta * ahead.sum(0).reshape(-1, 2)
        margin = rewards[:, 0] - rewards[:, 1]
        better = jnp.where(jnp.abs(R[:, 0] - R[:, 1]) < 1e-6, 0.5, (R[:, 0] > R[:, 1]).astype(jnp.float32))
        return (better * jax.nn.softplus(-margin) + (1 - better) * jax.nn.softplus(margin)).mean()


def _optimiser(config: Grouped | Direct) -> Any:
    return optax.chain(optax.clip_by_global_norm(config.gradient_norm), optax.adam(config.learning_rate))


def train_grouped(config: Grouped, case: LearnerCase) -> list[NetPolicy]:
    """Train policies on the true reward, by groups of episodes."""
    if config.group < 2:
        misused("a group has at least two episodes")
    world = world_of(case.task, config.experience)
    each = config.groups * config.group * world.length
    return _trained(GroupUpdate(config, world), case, each, 0)


def train_direct(config: Direct, case: LearnerCase) -> list[NetPolicy]:
    """Train policies from comparisons of whole episodes, without a reward in between."""
    world = world_of(case.task, config.experience)
    judge = world_of(case.judge, config.experience)
    return _trained(DirectUpdate(config, world, judge), case, 2 * config.pairs * world.length, config.pairs)


def _trained(update: GroupUpdate | DirectUpdate, case: LearnerCase, each: int, comparisons: int) -> list[NetPolicy]:
    def init(key: AnyArray) -> AlignedState:
        actor = init_actor(key, update.world, update.config.hidden)
        return AlignedState(actor, actor, update.adam.init(actor))

    def shown(held: AlignedState) -> list[NetPolicy]:
        return policies(case, update.world, held.actor)

    plan = Schedule(rounds(case, each), each, comparisons, shown)
    return shown(train_seeds(case, init, update.advance, plan))
