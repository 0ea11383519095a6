"""GAIL (Ho and Ermon, 2016) and AIRL (Fu, Luo and Levine, 2018), with the options of three packages."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.learners.deep.nets import forward, gradient_step, ring_update
from taskspec.learn.learners.deep.policy_training import (
    PolicyState,
    Update,
    collect,
    init_policy_state,
    policies,
    policy_update,
    rounds,
    world_of,
)
from taskspec.learn.learners.deep.ppo import PolicyNet
from taskspec.learn.learners.deep.reward_nets import (
    RewardInputs,
    RewardModel,
    RewardNets,
    demonstration_inputs,
    reward_inputs,
)
from taskspec.learn.learners.deep.world import Schedule, StepBatch, World, in_complete_episode, seed_slice, train_seeds
from taskspec.learn.learners.interface import LearnerCase, NetPolicy
from taskspec.learn.learners.paper_settings import Adversarial


class AdversarialState(NamedTuple):
    """A policy and a discriminator in training; `recent` are steps of the learner, `count` is how many there were."""

    learning: PolicyState
    nets: RewardNets
    optimiser: Any
    recent: RewardInputs | None
    count: AnyArray


class Discriminator:
    """A classifier of steps: learner or expert."""

    def __init__(self, config: Adversarial, world: World) -> None:
        self.config = config
        self.world = world
        self.reward = RewardModel(config.reward, world, config.policy.discount)
        self._adam = optax.adam(config.reward.learning_rate)

    def init(self, key: AnyArray) -> tuple[RewardNets, Any]:
        nets = self.reward.init(key)
        return nets, self._adam.init((nets.theta, nets.phi))

    def logit(self, nets: RewardNets, actor: PolicyNet, at: RewardInputs) -> AnyArray:
        """Return l = log D - log(1 - D) of steps (...): above 0 for steps that look like the expert's."""
        logit = self.reward(nets, at)
        if not self.config.minus_log_policy:
            return logit
        spread = actor.deviations
        if self.config.deviation_as_variance:
            spread = spread / 2
        log = self.world.head.log_prob(forward(actor.net, at.seen), spread, at.action)
        return logit - jax.lax.stop_gradient(log) * (1 - at.gone)

    def pay(self, nets: RewardNets, actor: PolicyNet, at: RewardInputs) -> AnyArray:
        """Return the rewards (...) that the policy learns from."""
        if self.config.pay == "f":
            return self.reward(nets, at)
        logit = self.logit(nets, actor, at)
        match self.config.pay:
            case "softplus(l)":
                return jax.nn.softplus(logit)
            case "-softplus(-l)":
                return -jax.nn.softplus(-logit)
            case _:
                return logit

    def loss(
        self, trainable: Any, nets: RewardNets, actor: PolicyNet, own: RewardInputs, shown: RewardInputs
    ) -> AnyArray:
        """Return the cross-entropy of classifying steps of the learner and demonstrated ones, (N, ...) each."""
        nets = nets._replace(theta=trainable[0], phi=trainable[1])
        mine = self.logit(nets, actor, own)
        theirs = self.logit(nets, actor, shown)
        error = 0.5 * (jax.nn.softplus(mine).mean() + jax.nn.softplus(-theirs).mean())
        both = jnp.concatenate([mine, theirs])
        return error - self.config.entropy * (jax.nn.softplus(both) - both * jax.nn.sigmoid(both)).mean()

    def update(
        self, nets: RewardNets, optimiser: Any, actor: PolicyNet, draw: Any, key: AnyArray
    ) -> tuple[RewardNets, Any]:
        """Return the nets after the updates of a round, on steps of the learner and of the expert sampled by `draw(key)`."""

        def once(carry: Any, key: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            own, shown = draw(key)
            nets = self.reward.with_statistics(nets, jnp.concatenate([own.seen, shown.seen]))
            now = (nets.theta, nets.phi)
            (theta, phi), optimiser = gradient_step(self._adam, self.loss, now, optimiser, nets, actor, own, shown)
            return (nets._replace(theta=theta, phi=phi), optimiser), None

        keys = jax.random.split(key, self.config.updates)
        return jax.lax.scan(once, (nets, optimiser), keys)[0]


class AdversarialRound:
    """A round of GAIL or AIRL: the policy acts and learns from the discriminator's rewards, then the discriminator is updated."""

    def __init__(self, config: Adversarial, update: Update) -> None:
        self.config = config
        self.policy = update
        self.judge = Discriminator(config, update.world)
        self.each = update.steps * update.experience.lanes

    def init(self, key: AnyArray) -> AdversarialState:
        first, second = jax.random.split(key)
        learning = init_policy_state(self.policy, first)
        recent = None
        if self.config.kept:
            _, steps = jax.eval_shape(lambda k: collect(self.policy, learning, k), key)
            shapes = reward_inputs(jax.eval_shape(StepBatch.flat, steps))
            recent = RewardInputs(*(jnp.zeros((self.config.kept, *x.shape[1:]), x.dtype) for x in shapes))
        return AdversarialState(learning, *self.judge.init(second), recent, jnp.int32(0))

    def advance(self, contest: AdversarialState, key: AnyArray, shown: RewardInputs) -> AdversarialState:
        keys = jax.random.split(key, self.config.every + 1)

        def round_(learning: PolicyState, key: AnyArray) -> tuple[PolicyState, StepBatch]:
            first, second = jax.random.split(key)
            walk, steps = collect(self.policy, learning, first)
            pay = self.judge.pay(contest.nets, learning.policy.actor, reward_inputs(steps))
            return PolicyState(self.policy.update(learning.policy, steps, walk, pay, second), walk), steps

        learning, steps = jax.lax.scan(round_, contest.learning, keys[1:])
        last = jax.tree.map(lambda x: x[-1], steps)
        valid = jnp.ones_like(last.ended)
        if self.policy.experience.whole:
            valid = in_complete_episode(last)
        own = reward_inputs(last.flat())
        recent = contest.recent
        count = contest.count
        if recent is not None:
            recent = ring_update(recent, own, count, self.config.kept)
            count = count + len(own.gone)
        draw = self._drawing(own if recent is None else recent, valid, count, shown)
        nets, optimiser = self.judge.update(contest.nets, contest.optimiser, learning.policy.actor, draw, keys[0])
        return AdversarialState(learning, nets, optimiser, recent, count)

    def _drawing(self, own: RewardInputs, valid: AnyArray, count: AnyArray, shown: RewardInputs) -> Any:
        size = self.config.batch or self.each
        weight = valid.reshape(-1)

        def draw(key: AnyArray) -> tuple[RewardInputs, RewardInputs]:
            first, second = jax.random.split(key)
            theirs = jax.random.randint(second, (size,), 0, len(shown.gone))
            if self.config.kept:
                mine = jax.random.randint(first, (size,), 0, jnp.minimum(count, self.config.kept))
            else:
                mine = jnp.searchsorted(
                    jnp.cumsum(weight), jax.random.uniform(first, (size,)) * weight.sum(), side="right"
                )
            return RewardInputs(*(x[mine] for x in own)), RewardInputs(*(x[theirs] for x in shown))

        return draw


def train_adversarial(config: Adversarial, case: LearnerCase) -> list[NetPolicy]:
    """Train policies from demonstrations; each has the reward that it learned."""
    world = world_of(case.task, config.policy.experience)
    training = AdversarialRound(config, policy_update(config.policy, world))
    counted = round(training.each * config.every / config.budget_factor)
    shown = demonstration_inputs(world, case.demonstrations)
    pay = "f" if config.minus_log_policy else config.pay

    def trained(contest: AdversarialState) -> list[NetPolicy]:
        rewards = lambda i: training.judge.reward.learned(seed_slice(contest.nets, i), pay)  # noqa: E731
        return policies(case, world, contest.learning.policy.actor, rewards)

    plan = Schedule(rounds(case, counted), counted, shown=trained)
    return trained(train_seeds(case, training.init, training.advance, plan, shown))
