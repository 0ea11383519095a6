"""Nets that say how good a step is, and what they see of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.data import Demonstrations
from taskspec.learners.configurations import Reward
from taskspec.learners.deep.nets import Net, net, says
from taskspec.learners.deep.world import Played, World
from taskspec.learners.rewards import LearnedReward

Array = Any


class Looks(NamedTuple):
    """Steps (N, ...) as discriminators and rewards see them (see `Played`)."""

    seen: Array
    gone: Array
    action: Array
    taken: Array
    next_seen: Array
    next_gone: Array


class RewardNets(NamedTuple):
    """theta, and phi where it is shaped; the mean and variance of what was seen, and of how much."""

    theta: Net
    phi: Net | None
    mean: Array
    variance: Array
    count: Array


def looks(steps: Played) -> Looks:
    return Looks(steps.seen, steps.gone, steps.action, steps.taken, steps.next_seen, steps.next_gone)


def shown_looks(world: World, shown: Demonstrations) -> Looks:
    """Demonstrations, in which terminal states last until the horizon where they do so in the world."""
    vectors = world.head.vectors
    action = vectors.flat(np.asarray(shown.acts))
    over = np.asarray(shown.terminated & world.absorbs, np.float32)
    seen, following = (world.seen(np.asarray(o)) for o in (shown.obs, shown.next_obs))
    found = Looks(
        seen, np.zeros(len(over), np.float32), action, vectors.one_hot(action), following * (1 - over)[:, None], over
    )
    last = shown.starts + shown.lengths - 1
    more = int((over[last] * np.maximum((world.horizon or 0) - shown.lengths, 0)).sum())
    rest = Looks(*(np.zeros((more, *x.shape[1:]), x.dtype) for x in found))
    rest = rest._replace(gone=np.ones(more, np.float32), next_gone=np.ones(more, np.float32))
    return Looks(*(jnp.asarray(np.concatenate(pair)) for pair in zip(found, rest, strict=True)))


class RewardOf:
    """How a reward of a world is begun and asked."""

    def __init__(self, config: Reward, world: World, discount: float) -> None:
        self.config, self.world, self.discount = config, world, discount

    def init(self, key: Array) -> RewardNets:
        first, second = jax.random.split(key)
        config, state = self.config, self.world.seen.size + self.world.absorbs
        inputs = state + (self.world.head.vectors.size if config.inputs == "state, action" else 0)
        phi = net(second, state, config.hidden, 1) if config.shaped else None
        size = self.world.seen.size
        return RewardNets(net(first, inputs, config.hidden, 1), phi, jnp.zeros(size), jnp.ones(size), jnp.float32(0))

    def __call__(self, nets: RewardNets, at: Looks) -> Array:
        """f (...) of steps (..., D)."""
        state = self._state(nets, at.seen, at.gone)
        inputs = state if self.config.inputs == "state" else jnp.concatenate([state, at.taken], -1)
        found = says(nets.theta, inputs, self.config.activation)[..., 0]
        if nets.phi is None:
            return found
        after = self._state(nets, at.next_seen, at.next_gone)
        ahead, here = (says(nets.phi, x, self.config.activation)[..., 0] for x in (after, state))
        return found + self.discount * ahead - here

    def _state(self, nets: RewardNets, seen: Array, gone: Array) -> Array:
        if self.config.scaled:
            seen = self.world.seen.scaled(seen)
        if self.config.standardised:
            seen = (seen - nets.mean) / jnp.maximum(jnp.sqrt(nets.variance), 0.1)
        return seen if not self.world.absorbs else jnp.concatenate([seen * (1 - gone)[..., None], gone[..., None]], -1)

    def watched(self, nets: RewardNets, seen: Array) -> RewardNets:
        """The nets, with the mean and variance of more observations (N, D) in theirs."""
        if not self.config.standardised:
            return nets
        count = nets.count + len(seen)
        share, apart = len(seen) / count, seen.mean(0) - nets.mean
        variance = (1 - share) * nets.variance + share * seen.var(0) + share * (1 - share) * apart**2
        return nets._replace(mean=nets.mean + share * apart, variance=variance, count=count)

    def learned(self, nets: RewardNets, pay: str) -> LearnedReward:
        """What was learned, of NumPy arrays."""
        config = self.config
        mean, deviation = np.zeros(self.world.seen.size), np.ones(self.world.seen.size)
        if config.standardised:
            mean, deviation = np.asarray(nets.mean), np.maximum(np.sqrt(np.asarray(nets.variance)), 0.1)
        if config.scaled and self.world.seen.is_bounded:
            low, high = np.array(self.world.seen.low), np.array(self.world.seen.high)
            mean, deviation = low + (high - low) * mean, (high - low) * deviation
        return LearnedReward(
            self.world.seen, self.world.head.vectors, mean, deviation, _arrays(nets.theta),
            None if nets.phi is None else _arrays(nets.phi), config.activation, config.inputs == "state, action",
            self.world.absorbs, self.discount, pay,
        )  # fmt: skip


def _arrays(layers: Net) -> tuple[Any, ...]:
    return tuple((np.asarray(w, np.float64), np.asarray(b, np.float64)) for w, b in layers)
