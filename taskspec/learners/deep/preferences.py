"""Deep reinforcement learning from preferences (Christiano et al., 2017): a reward that agrees with comparisons."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.lang.ir import draws
from taskspec.learners.case import LearnerCase
from taskspec.learners.deep.ppo import PpoUpdate, acting
from taskspec.learners.deep.reinforce import Learning, begun, played, policies, rounds, world_of
from taskspec.learners.deep.rewards import Curiosity, Looks, Novel, RewardNets, RewardOf, looks
from taskspec.learners.deep.world import Played, Schedule, World, of_seed, trained
from taskspec.learners.learned import NetPolicy
from taskspec.learners.settings import Comparing


class Pairs(NamedTuple):
    """Pairs of segments of L steps: `at` (P, 2, L, ...), `live` (P, 2, L), 1.0 for steps that are part of a segment.

    `better` (P,) is 1.0 where the first is better, 0.0 where the second is; `weight` (P,) is 0.0 for pairs that do not count.
    """

    at: Looks
    live: AnyArray
    better: AnyArray
    weight: AnyArray


class Survey(NamedTuple):
    """A policy and a reward in training; `kept` are pairs that were asked about, `count` how many there were."""

    learning: Learning
    nets: RewardNets
    optimiser: Any
    kept: Pairs | None
    count: AnyArray
    novel: Novel | None


class Asking:
    """A round of comparisons: episodes are asked about, the reward learns from them, and the policy from the reward.

    Args:
        judge: the world whose rewards decide; otherwise as that of `update`.
    """

    def __init__(self, config: Comparing, update: PpoUpdate, judge: World) -> None:
        self.config, self.policy, self.judge = config, update, judge
        self.reward = RewardOf(config.reward, update.world, config.policy.discount)
        self.curious = None if config.novelty is None else Curiosity(config.novelty, update.world)
        self._adam = optax.adam(config.reward.learning_rate)
        world = update.world
        self.alike = world.horizon is None or world.absorbs or not world.may_end
        """Whether all episodes are equally long."""
        self.ties = config.noise_ties and bool(draws(world.task.observation.nodes))

    @property
    def pairs(self) -> int:
        """How many are compared in a round, at most."""
        return self.config.episodes * (1 if self.alike else self.judge.length) // 2

    def init(self, key: AnyArray) -> Survey:
        first, second, third = jax.random.split(key, 3)
        learning, nets = begun(self.policy, first), self.reward.init(second)
        kept = None
        if self.config.kept:
            shapes = jax.eval_shape(lambda k: self.asked(learning, k)[0], key)
            kept = jax.tree.map(lambda x: jnp.zeros((self.config.kept, *x.shape[1:]), x.dtype), shapes)
        novel = None if self.curious is None else self.curious.init(third)
        return Survey(learning, nets, self._adam.init((nets.theta, nets.phi)), kept, jnp.int32(0), novel)

    def asked(self, learning: Learning, key: AnyArray) -> tuple[Pairs, Played]:
        """The pairs of a round, of episodes that the policy plays anew, and their steps (T, E, ...)."""
        begin, noise, coins = jax.random.split(key, 3)
        world, act = self.judge, acting(self.judge, learning.policy.actor)
        chances = jax.random.bernoulli(coins, self.config.random, (world.length, self.config.episodes))
        noises = world.head.noise(noise, chances.shape)

        def step(walk: Any, drawn: tuple[AnyArray, AnyArray]) -> Any:
            noise, at_random = drawn
            return world.step(walk, jnp.where(at_random[:, None], world.head.uniform(noise), act(walk.seen, noise)))

        _, steps = jax.lax.scan(step, world.begin(begin, self.config.episodes), (noises, chances))
        live = jnp.cumprod(jnp.concatenate([jnp.ones_like(steps.ended[:1]), 1 - steps.ended[:-1]]), axis=0)
        return self.compared(steps, live), steps

    def compared(self, steps: Played, live: AnyArray) -> Pairs:
        """Neighbours among episodes; where these differ in length, among their steps, as long segments do not fit into all."""
        world = self.judge
        gains = steps.reward * live * jnp.float32(world.task.discount) ** steps.time
        order = None if self.alike else jnp.argsort(1 - live.T.reshape(-1), stable=True)

        def paired(x: AnyArray) -> AnyArray:
            rows = jnp.swapaxes(x, 0, 1)
            rows = rows if order is None else rows.reshape(-1, 1, *x.shape[2:])[order]
            return rows[: 2 * self.pairs].reshape(self.pairs, 2, *rows.shape[1:])

        at, lives = Looks(*map(paired, looks(steps))), paired(live)
        returns = paired(gains).sum(-1)
        same = (jnp.abs(returns[:, 0] - returns[:, 1]) < 1e-6) | self.ties
        better = jnp.where(same, 0.5, (returns[:, 0] > returns[:, 1]).astype(jnp.float32))
        weight = lives.max(-1).min(-1) * jnp.where(same & self.config.total, 0.0, 1.0)
        return Pairs(at, lives, better, weight)

    def loss(self, trainable: Any, nets: RewardNets, pairs: Pairs) -> AnyArray:
        """Minus the log-likelihood of the comparisons (Bradley and Terry)."""
        nets = nets._replace(theta=trainable[0], phi=trainable[1])
        sums = (self.reward(nets, pairs.at) * pairs.live).sum(-1)
        ahead = sums[:, 0] - sums[:, 1]
        each = pairs.better * jax.nn.softplus(-ahead) + (1 - pairs.better) * jax.nn.softplus(ahead)
        total = (each * pairs.weight).sum()
        return total if self.config.total else total / jnp.maximum(pairs.weight.sum(), 1.0)

    def advance(self, survey: Survey, key: AnyArray, _: Any) -> Survey:
        ask, draw, play, improve = jax.random.split(key, 4)
        learning = survey.learning
        pairs, steps = self.asked(learning, ask)
        kept, count = self._kept(survey, pairs)
        nets, optimiser = self._fitted(survey, pairs if kept is None else kept, count, draw)
        if self.config.stale:
            walk = self.policy.world.begin(draw, self.policy.experience.lanes)
            learning = learning._replace(walk=walk._replace(seen=learning.walk.seen))
        walk, own = played(self.policy, learning, play)
        pay, novel = self.reward(nets, looks(own)), survey.novel
        if self.curious is not None and novel is not None:
            novel = self.curious.fitted(novel, looks(steps))
            bonus, novel = self.curious.bonus(novel, looks(own))
            pay = pay + bonus
        policy = self.policy.update(learning.policy, own, walk, pay, improve)
        return Survey(Learning(policy, walk), nets, optimiser, kept, count, novel)

    def _kept(self, survey: Survey, pairs: Pairs) -> tuple[Pairs | None, AnyArray]:
        if survey.kept is None:
            return None, survey.count
        places = (survey.count + jnp.arange(self.pairs)) % self.config.kept
        kept = jax.tree.map(lambda old, new: old.at[places].set(new), survey.kept, pairs)
        return kept, survey.count + self.pairs

    def _fitted(self, survey: Survey, pairs: Pairs, count: AnyArray, key: AnyArray) -> tuple[RewardNets, Any]:
        """The reward after the gradient steps of a round."""
        config = self.config
        known = jnp.minimum(count, config.kept) if config.kept else self.pairs

        def once(carry: Any, key: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            now, some = (nets.theta, nets.phi), pairs
            if config.batch:
                chosen = jax.random.randint(key, (config.batch,), 0, known)
                some = jax.tree.map(lambda x: x[chosen], pairs)
            change, optimiser = self._adam.update(jax.grad(self.loss)(now, nets, some), optimiser)
            theta, phi = optax.apply_updates(now, change)
            return (nets._replace(theta=theta, phi=phi), optimiser), None

        keys = jax.random.split(key, config.updates)
        return jax.lax.scan(once, (survey.nets, survey.optimiser), keys)[0]


def preferred(config: Comparing, case: LearnerCase) -> list[NetPolicy]:
    """Policies that learned from comparisons; each has the reward that it learned."""
    experience = config.policy.experience
    world = world_of(case.task, experience)
    judge = world_of(case.judge, experience)
    asking = Asking(config, PpoUpdate(config.policy, world), judge)
    each = asking.policy.steps * experience.lanes
    counted = round(each / config.budget_factor)

    def found(survey: Survey) -> list[NetPolicy]:
        rewards = lambda i: asking.reward.learned(of_seed(survey.nets, i), "f")  # noqa: E731
        return policies(case, world, survey.learning.policy.actor, rewards)

    plan = Schedule(rounds(case, counted), counted, asking.pairs, found)
    return found(trained(case, asking.init, asking.advance, plan))
