"""Deep reinforcement learning from preferences (Christiano et al., 2017): a reward that agrees with comparisons."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.deep.nets import gradient_step, ring_update
from taskspec.learn.learners.deep.policy_training import (
    PolicyState,
    collect,
    init_policy_state,
    policies,
    rounds,
    world_of,
)
from taskspec.learn.learners.deep.ppo import PpoUpdate, sampler
from taskspec.learn.learners.deep.reward_nets import (
    NoveltyBonus,
    NoveltyState,
    RewardInputs,
    RewardModel,
    RewardNets,
    reward_inputs,
)
from taskspec.learn.learners.deep.world import (
    Schedule,
    StepBatch,
    World,
    discounted_rewards,
    in_first_episode,
    seed_slice,
    train_seeds,
)
from taskspec.learn.learners.interface import LearnerCase, NetPolicy
from taskspec.learn.learners.paper_settings import Comparing


class Pairs(NamedTuple):
    """Pairs of segments of L steps: `at` (P, 2, L, ...); `live` (P, 2, L) is 1.0 for steps that are part of a segment.

    `better` (P,) is 1.0 where the first is better, 0.0 where the second is; `weight` (P,) is 0.0 for pairs that do not count.
    """

    at: RewardInputs
    live: AnyArray
    better: AnyArray
    weight: AnyArray


class PreferenceState(NamedTuple):
    """A policy and a reward in training; `kept` are labelled pairs, `count` is how many there were."""

    learning: PolicyState
    nets: RewardNets
    optimiser: Any
    kept: Pairs | None
    count: AnyArray
    novel: NoveltyState | None


class PreferenceRound:
    """A round of comparisons: episodes are compared, the reward learns from the labels, and the policy from the reward.

    Args:
        judge: the world whose rewards label the pairs; otherwise equal to that of `update`.
    """

    def __init__(self, config: Comparing, update: PpoUpdate, judge: World) -> None:
        self.config = config
        self.policy = update
        self.judge = judge
        self.reward = RewardModel(config.reward, update.world, config.policy.discount)
        self.curious = None
        if config.novelty is not None:
            self.curious = NoveltyBonus(config.novelty, update.world)
        self._adam = optax.adam(config.reward.learning_rate)
        world = update.world
        self.alike = world.horizon is None or world.absorbs or not world.may_end
        """Whether all episodes have the same length."""
        self.ties = config.noise_ties and world.task.observation.is_random

    @property
    def pairs(self) -> int:
        """The largest number of pairs in a round."""
        return self.config.episodes * (1 if self.alike else self.judge.length) // 2

    def init(self, key: AnyArray) -> PreferenceState:
        first, second, third = jax.random.split(key, 3)
        learning = init_policy_state(self.policy, first)
        nets = self.reward.init(second)
        kept = None
        if self.config.kept:
            shapes = jax.eval_shape(lambda k: self.query(learning, k)[0], key)
            kept = jax.tree.map(lambda x: jnp.zeros((self.config.kept, *x.shape[1:]), x.dtype), shapes)
        novel = None
        if self.curious is not None:
            novel = self.curious.init(third)
        return PreferenceState(learning, nets, self._adam.init((nets.theta, nets.phi)), kept, jnp.int32(0), novel)

    def query(self, learning: PolicyState, key: AnyArray) -> tuple[Pairs, StepBatch]:
        """Return the labelled pairs of a round, from new episodes of the policy, and their steps (T, E, ...)."""
        begin, noise, coins = jax.random.split(key, 3)
        world = self.judge
        act = sampler(self.judge, learning.policy.actor)
        at_random = jax.random.bernoulli(coins, self.config.random, (world.length, self.config.episodes))
        noises = world.head.noise(noise, at_random.shape)

        def step(walk: Any, drawn: tuple[AnyArray, AnyArray]) -> Any:
            noise, at_random = drawn
            noise = world.allowed(walk, noise)
            return world.step(walk, jnp.where(at_random[:, None], world.head.uniform(noise), act(walk.seen, noise)))

        _, steps = jax.lax.scan(step, world.begin(begin, self.config.episodes), (noises, at_random))
        return self.compared(steps, in_first_episode(steps)), steps

    def compared(self, steps: StepBatch, live: AnyArray) -> Pairs:
        """Return pairs of neighbouring episodes; of single steps, if episodes differ in length."""
        world = self.judge
        rewards = discounted_rewards(world.task, steps, live)
        order = None
        if not self.alike:
            order = jnp.argsort(1 - live.T.reshape(-1), stable=True)

        def paired(x: AnyArray) -> AnyArray:
            rows = jnp.swapaxes(x, 0, 1)
            if order is not None:
                rows = rows.reshape(-1, 1, *x.shape[2:])[order]
            return rows[: 2 * self.pairs].reshape(self.pairs, 2, *rows.shape[1:])

        at = RewardInputs(*map(paired, reward_inputs(steps)))
        lives = paired(live)
        returns = paired(rewards).sum(-1)
        same = (jnp.abs(returns[:, 0] - returns[:, 1]) < 1e-6) | self.ties
        better = jnp.where(same, 0.5, (returns[:, 0] > returns[:, 1]).astype(jnp.float32))
        weight = lives.max(-1).min(-1) * jnp.where(same & self.config.total, 0.0, 1.0)
        return Pairs(at, lives, better, weight)

    def loss(self, trainable: Any, nets: RewardNets, pairs: Pairs) -> AnyArray:
        """Return minus the log-likelihood of the labels (Bradley and Terry, 1952)."""
        nets = nets._replace(theta=trainable[0], phi=trainable[1])
        sums = (self.reward(nets, pairs.at) * pairs.live).sum(-1)
        ahead = sums[:, 0] - sums[:, 1]
        each = pairs.better * jax.nn.softplus(-ahead) + (1 - pairs.better) * jax.nn.softplus(ahead)
        total = (each * pairs.weight).sum()
        if self.config.total:
            return total
        return total / jnp.maximum(pairs.weight.sum(), 1.0)

    def advance(self, survey: PreferenceState, key: AnyArray, _: Any) -> PreferenceState:
        ask, draw, play, improve = jax.random.split(key, 4)
        learning = survey.learning
        pairs, steps = self.query(learning, ask)
        kept = survey.kept
        count = survey.count
        if kept is not None:
            kept = ring_update(kept, pairs, count, self.config.kept)
            count = count + self.pairs
        nets, optimiser = self._fit(survey, pairs if kept is None else kept, count, draw)
        if self.config.stale:
            walk = self.policy.world.begin(draw, self.policy.experience.lanes)
            learning = learning._replace(walk=walk._replace(seen=learning.walk.seen))
        walk, own = collect(self.policy, learning, play)
        pay = self.reward(nets, reward_inputs(own))
        novel = survey.novel
        if self.curious is not None and novel is not None:
            novel = self.curious.fit(novel, reward_inputs(steps))
            bonus, novel = self.curious.bonus(novel, reward_inputs(own))
            pay = pay + bonus
        policy = self.policy.update(learning.policy, own, walk, pay, improve)
        return PreferenceState(PolicyState(policy, walk), nets, optimiser, kept, count, novel)

    def _fit(self, survey: PreferenceState, pairs: Pairs, count: AnyArray, key: AnyArray) -> tuple[RewardNets, Any]:
        config = self.config
        known = jnp.minimum(count, config.kept) if config.kept else self.pairs

        def once(carry: Any, key: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            now = (nets.theta, nets.phi)
            some = pairs
            if config.batch:
                chosen = jax.random.randint(key, (config.batch,), 0, known)
                some = jax.tree.map(lambda x: x[chosen], pairs)
            (theta, phi), optimiser = gradient_step(self._adam, self.loss, now, optimiser, nets, some)
            return (nets._replace(theta=theta, phi=phi), optimiser), None

        keys = jax.random.split(key, config.updates)
        return jax.lax.scan(once, (survey.nets, survey.optimiser), keys)[0]


def train_from_preferences(config: Comparing, case: LearnerCase) -> list[NetPolicy]:
    """Train policies from comparisons; each has the reward that it learned."""
    experience = config.policy.experience
    world = world_of(case.task, experience)
    judge = world_of(case.judge, experience)
    training = PreferenceRound(config, PpoUpdate(config.policy, world), judge)
    each = training.policy.steps * experience.lanes
    counted = round(each / config.budget_factor)

    def trained(survey: PreferenceState) -> list[NetPolicy]:
        rewards = lambda i: training.reward.learned(seed_slice(survey.nets, i), "f")  # noqa: E731
        return policies(case, world, survey.learning.policy.actor, rewards)

    plan = Schedule(rounds(case, counted), counted, training.pairs, trained)
    return trained(train_seeds(case, training.init, training.advance, plan))
