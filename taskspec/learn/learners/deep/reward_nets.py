"""Nets that score a step, and random network distillation (Burda et al., 2018)."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from taskspec.base.arrays import AnyArray
from taskspec.learn.data.episodes import Demonstrations
from taskspec.learn.learners.deep.nets import Net, fan_in, forward, gradient_step, net, xavier
from taskspec.learn.learners.deep.world import StepBatch, World
from taskspec.learn.learners.interface import LearnedReward
from taskspec.learn.learners.paper_settings import Novelty, Reward

INITIALISERS = {"xavier": xavier, "fan in": fan_in}


class RewardInputs(NamedTuple):
    """The fields of steps (N, ...) that rewards and discriminators take (see `StepBatch`)."""

    seen: AnyArray
    gone: AnyArray
    action: AnyArray
    taken: AnyArray
    next_seen: AnyArray
    next_gone: AnyArray


class RewardNets(NamedTuple):
    """theta, and phi if it is shaped; the mean, variance and number of observations so far."""

    theta: Net
    phi: Net | None
    mean: AnyArray
    variance: AnyArray
    count: AnyArray


def reward_inputs(steps: StepBatch) -> RewardInputs:
    return RewardInputs(steps.seen, steps.gone, steps.action, steps.taken, steps.next_seen, steps.next_gone)


def demonstration_inputs(world: World, shown: Demonstrations) -> RewardInputs:
    """Return demonstrated steps; terminal states last until the horizon if they do so in the world."""
    vectors = world.head.vectors
    action = vectors.flat(np.asarray(shown.acts))
    over = np.asarray(shown.terminated & world.absorbs, np.float32)
    seen, following = (world.seen(np.asarray(o)) for o in (shown.obs, shown.next_obs))
    steps = RewardInputs(
        seen, np.zeros(len(over), np.float32), action, vectors.one_hot(action), following * (1 - over)[:, None], over
    )
    last = shown.starts + shown.lengths - 1
    more = int((over[last] * np.maximum((world.horizon or 0) - shown.lengths, 0)).sum())
    rest = RewardInputs(*(np.zeros((more, *x.shape[1:]), x.dtype) for x in steps))
    rest = rest._replace(gone=np.ones(more, np.float32), next_gone=np.ones(more, np.float32))
    return RewardInputs(*(jnp.asarray(np.concatenate(pair)) for pair in zip(steps, rest, strict=True)))


class RewardModel:
    """A learned reward on a world: f = theta(s, a), and if shaped + gamma phi(s') - phi(s)."""

    def __init__(self, config: Reward, world: World, discount: float) -> None:
        self.config = config
        self.world = world
        self.discount = discount

    def init(self, key: AnyArray) -> RewardNets:
        first, second = jax.random.split(key)
        config = self.config
        state = self.world.seen.size + self.world.absorbs
        inputs = state + (self.world.head.vectors.size if config.inputs == "state, action" else 0)
        layer = INITIALISERS[config.weights]
        theta = net(first, inputs, config.hidden, 1, layer)
        phi = None
        if config.shaped:
            phi = net(second, state, config.hidden, 1, layer)
        size = self.world.seen.size
        return RewardNets(theta, phi, jnp.zeros(size), jnp.ones(size), jnp.float32(0))

    def __call__(self, nets: RewardNets, at: RewardInputs) -> AnyArray:
        state = self._state(nets, at.seen, at.gone)
        inputs = state
        if self.config.inputs != "state":
            inputs = jnp.concatenate([state, at.taken], -1)
        theta = forward(nets.theta, inputs, self.config.activation)[..., 0]
        if nets.phi is None:
            return theta
        after = self._state(nets, at.next_seen, at.next_gone)
        ahead, here = (forward(nets.phi, x, self.config.activation)[..., 0] for x in (after, state))
        return theta + self.discount * ahead - here

    def _state(self, nets: RewardNets, seen: AnyArray, gone: AnyArray) -> AnyArray:
        if self.config.scaled:
            seen = self.world.seen.scaled(seen)
        if self.config.standardised:
            seen = (seen - nets.mean) / jnp.maximum(jnp.sqrt(nets.variance), 0.1)
        if not self.world.absorbs:
            return seen
        return jnp.concatenate([seen * (1 - gone)[..., None], gone[..., None]], -1)

    def with_statistics(self, nets: RewardNets, seen: AnyArray) -> RewardNets:
        """Return the nets with more observations (N, D) in their mean and variance."""
        if not self.config.standardised:
            return nets
        count = nets.count + len(seen)
        share = len(seen) / count
        distance = seen.mean(0) - nets.mean
        variance = (1 - share) * nets.variance + share * seen.var(0) + share * (1 - share) * distance**2
        return nets._replace(mean=nets.mean + share * distance, variance=variance, count=count)

    def learned(self, nets: RewardNets, pay: str) -> LearnedReward:
        """Return the learned reward, as NumPy arrays."""
        config = self.config
        mean = np.zeros(self.world.seen.size)
        deviation = np.ones(self.world.seen.size)
        if config.standardised:
            mean = np.asarray(nets.mean)
            deviation = np.maximum(np.sqrt(np.asarray(nets.variance)), 0.1)
        if config.scaled and self.world.seen.is_bounded:
            low = np.array(self.world.seen.low)
            high = np.array(self.world.seen.high)
            mean = low + (high - low) * mean
            deviation = (high - low) * deviation
        return LearnedReward(
            self.world.seen, self.world.head.vectors, mean, deviation, _arrays(nets.theta),
            None if nets.phi is None else _arrays(nets.phi), config.activation, config.inputs == "state, action",
            self.world.absorbs, self.discount, pay,
        )  # fmt: skip


def _arrays(layers: Net) -> tuple[Any, ...]:
    return tuple((np.asarray(w, np.float64), np.asarray(b, np.float64)) for w, b in layers)


# -- random network distillation (Burda et al., 2018): novel inputs are those where one net does not predict a random one


class NoveltyState(NamedTuple):
    """The learning and the random net, and the running mean and variance of their distance."""

    learner: Net
    target: Net
    optimiser: Any
    mean: AnyArray
    variance: AnyArray


class NoveltyBonus:
    """A bonus for novel steps."""

    def __init__(self, config: Novelty, world: World) -> None:
        self.config = config
        self.world = world
        self._adam = optax.adam(config.learning_rate)

    def init(self, key: AnyArray) -> NoveltyState:
        inputs = self.world.seen.size + self.world.head.vectors.size
        nets = [net(k, inputs, self.config.hidden, self.config.outputs) for k in jax.random.split(key)]
        return NoveltyState(nets[0], nets[1], self._adam.init(nets[0]), jnp.float32(0), jnp.float32(1))

    def distance(self, learner: Net, target: Net, at: RewardInputs) -> AnyArray:
        """Return the mean squared difference (...) of the nets' outputs on steps."""
        inputs = jnp.concatenate([self.world.seen.scaled(at.seen), at.taken], -1)
        return ((forward(learner, inputs, "relu") - forward(target, inputs, "relu")) ** 2).mean(-1)

    def fit(self, novel: NoveltyState, at: RewardInputs) -> NoveltyState:
        """Return the state after a gradient step on observed steps."""

        def error(learner: Net) -> AnyArray:
            return self.distance(learner, novel.target, at).mean()

        learner, optimiser = gradient_step(self._adam, error, novel.learner, novel.optimiser)
        return novel._replace(learner=learner, optimiser=optimiser)

    def bonus(self, novel: NoveltyState, at: RewardInputs) -> tuple[AnyArray, NoveltyState]:
        """Return the bonus of steps (T, E), standardised by running averages, and the state with these averages."""
        errors = self.distance(novel.learner, novel.target, at)
        rate = self.config.rate

        def once(carry: tuple[AnyArray, AnyArray], error: AnyArray) -> tuple[tuple[AnyArray, AnyArray], AnyArray]:
            mean, variance = carry
            mean = (1 - rate) * mean + rate * error
            variance = (1 - rate) * variance + rate * (error - mean) ** 2
            return (mean, variance), (error - mean) / (jnp.sqrt(variance) + 1e-8)

        (mean, variance), scaled = jax.lax.scan(once, (novel.mean, novel.variance), errors.reshape(-1))
        return self.config.weight * scaled.reshape(errors.shape), novel._replace(mean=mean, variance=variance)
