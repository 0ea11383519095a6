"""GAIL (Ho and Ermon, 2016) and AIRL (Fu, Luo and Levine, 2018), as three packages have them."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learners.case import LearnerCase
from taskspec.learners.deep.nets import says
from taskspec.learners.deep.ppo import PolicyNet
from taskspec.learners.deep.reinforce import Learning, Update, begun, played, policies, rounds, update_of, world_of
from taskspec.learners.deep.rewards import Looks, RewardNets, RewardOf, looks, shown_looks
from taskspec.learners.deep.world import Played, Schedule, World, complete, of_seed, trained
from taskspec.learners.learned import NetPolicy
from taskspec.learners.settings import Adversarial


class Contest(NamedTuple):
    """A policy and a discriminator in training; `recent` are steps of the learner, `count` how many there were."""

    learning: Learning
    nets: RewardNets
    optimiser: Any
    recent: Looks | None
    count: AnyArray


class Discriminator:
    """What tells the learner's steps from the expert's."""

    def __init__(self, config: Adversarial, world: World) -> None:
        self.config, self.world = config, world
        self.reward = RewardOf(config.reward, world, config.policy.discount)
        self._adam = optax.adam(config.reward.learning_rate)

    def init(self, key: AnyArray) -> tuple[RewardNets, Any]:
        nets = self.reward.init(key)
        return nets, self._adam.init((nets.theta, nets.phi))

    def logit(self, nets: RewardNets, actor: PolicyNet, at: Looks) -> AnyArray:
        """l (...): above 0 for what looks like the expert."""
        found = self.reward(nets, at)
        if not self.config.minus_log_policy:
            return found
        spread = actor.deviations / 2 if self.config.deviation_as_variance else actor.deviations
        log = self.world.head.log_prob(says(actor.net, at.seen), spread, at.action)
        return found - jax.lax.stop_gradient(log) * (1 - at.gone)

    def pay(self, nets: RewardNets, actor: PolicyNet, at: Looks) -> AnyArray:
        """What the policy is paid for steps (...)."""
        if self.config.pay == "f":
            return self.reward(nets, at)
        found = self.logit(nets, actor, at)
        match self.config.pay:
            case "softplus(l)":
                return jax.nn.softplus(found)
            case "-softplus(-l)":
                return -jax.nn.softplus(-found)
            case _:
                return found

    def loss(self, trainable: Any, nets: RewardNets, actor: PolicyNet, own: Looks, shown: Looks) -> AnyArray:
        """The cross-entropy of telling steps of the learner from steps that were shown, (N, ...) each."""
        nets = nets._replace(theta=trainable[0], phi=trainable[1])
        mine, theirs = self.logit(nets, actor, own), self.logit(nets, actor, shown)
        error = 0.5 * (jax.nn.softplus(mine).mean() + jax.nn.softplus(-theirs).mean())
        both = jnp.concatenate([mine, theirs])
        return error - self.config.entropy * (jax.nn.softplus(both) - both * jax.nn.sigmoid(both)).mean()

    def update(
        self, nets: RewardNets, optimiser: Any, actor: PolicyNet, draw: Any, key: AnyArray
    ) -> tuple[RewardNets, Any]:
        """The nets after the updates of a round, on steps of the learner and of the expert that `draw` gives of a key."""

        def once(carry: Any, key: AnyArray) -> tuple[Any, None]:
            nets, optimiser = carry
            own, shown = draw(key)
            nets = self.reward.watched(nets, jnp.concatenate([own.seen, shown.seen]))
            now = (nets.theta, nets.phi)
            change, optimiser = self._adam.update(jax.grad(self.loss)(now, nets, actor, own, shown), optimiser)
            theta, phi = optax.apply_updates(now, change)
            return (nets._replace(theta=theta, phi=phi), optimiser), None

        keys = jax.random.split(key, self.config.updates)
        return jax.lax.scan(once, (nets, optimiser), keys)[0]


class Contending:
    """A round of GAIL or AIRL: the policy plays and is paid, and the discriminator learns from what it did."""

    def __init__(self, config: Adversarial, update: Update) -> None:
        self.config, self.policy = config, update
        self.judge = Discriminator(config, update.world)
        self.each = update.steps * update.experience.lanes

    def init(self, key: AnyArray) -> Contest:
        first, second = jax.random.split(key)
        learning = begun(self.policy, first)
        recent = None
        if self.config.kept:
            _, steps = jax.eval_shape(lambda k: played(self.policy, learning, k), key)
            shapes = looks(jax.eval_shape(Played.flat, steps))
            recent = Looks(*(jnp.zeros((self.config.kept, *x.shape[1:]), x.dtype) for x in shapes))
        return Contest(learning, *self.judge.init(second), recent, jnp.int32(0))

    def advance(self, contest: Contest, key: AnyArray, shown: Looks) -> Contest:
        keys = jax.random.split(key, self.config.every + 1)

        def round_(learning: Learning, key: AnyArray) -> tuple[Learning, Played]:
            first, second = jax.random.split(key)
            walk, steps = played(self.policy, learning, first)
            pay = self.judge.pay(contest.nets, learning.policy.actor, looks(steps))
            return Learning(self.policy.update(learning.policy, steps, walk, pay, second), walk), steps

        learning, steps = jax.lax.scan(round_, contest.learning, keys[1:])
        last = jax.tree.map(lambda x: x[-1], steps)
        valid = complete(last) if self.policy.experience.whole else jnp.ones_like(last.ended)
        own = looks(last.flat())
        recent, count = self._kept(contest, own)
        draw = self._drawing(own if recent is None else recent, valid, count, shown)
        nets, optimiser = self.judge.update(contest.nets, contest.optimiser, learning.policy.actor, draw, keys[0])
        return Contest(learning, nets, optimiser, recent, count)

    def _kept(self, contest: Contest, own: Looks) -> tuple[Looks | None, AnyArray]:
        """Recent steps with those of a round in the place of the oldest."""
        if contest.recent is None:
            return None, contest.count
        size = len(own.gone)
        places = (contest.count + jnp.arange(size)) % self.config.kept
        kept = Looks(*(old.at[places].set(new) for old, new in zip(contest.recent, own, strict=True)))
        return kept, contest.count + size

    def _drawing(self, own: Looks, valid: AnyArray, count: AnyArray, shown: Looks) -> Any:
        """A function of a key to as many steps of the learner as of the expert."""
        size = self.config.batch or self.each
        weight = valid.reshape(-1)

        def draw(key: AnyArray) -> tuple[Looks, Looks]:
            first, second = jax.random.split(key)
            theirs = jax.random.randint(second, (size,), 0, len(shown.gone))
            if self.config.kept:
                mine = jax.random.randint(first, (size,), 0, jnp.minimum(count, self.config.kept))
            else:
                mine = jnp.searchsorted(
                    jnp.cumsum(weight), jax.random.uniform(first, (size,)) * weight.sum(), side="right"
                )
            return Looks(*(x[mine] for x in own)), Looks(*(x[theirs] for x in shown))

        return draw


def imitated(config: Adversarial, case: LearnerCase) -> list[NetPolicy]:
    """Policies that learned from demonstrations; each has the reward that it learned."""
    world = world_of(case.task, config.policy.experience)
    game = Contending(config, update_of(config.policy, world))
    counted = round(game.each * config.every / config.budget_factor)
    shown = shown_looks(world, case.demonstrations)
    pay = "f" if config.minus_log_policy else config.pay

    def found(contest: Contest) -> list[NetPolicy]:
        rewards = lambda i: game.judge.reward.learned(of_seed(contest.nets, i), pay)  # noqa: E731
        return policies(case, world, contest.learning.policy.actor, rewards)

    return found(trained(case, game.init, game.advance, Schedule(rounds(case, counted), counted, shown=found), shown))
