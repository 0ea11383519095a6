"""Dynamics of finite tasks, and how learners act in them: what Bellman operators are made of.

Symbols: P[a, s, s'] is the probability that the episode goes on in s', P_end[a, s, s'] that it ends there, R[a, s] the expected
reward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.extract import extract, lasting
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.policies.policy import best_actions
from taskspec.language.expressions.types import Kind
from taskspec.language.modifiers.core import paying
from taskspec.language.task.task import Task

STEPS = 5000
"""Steps of episodes that do not end by themselves, at most."""
EXPLORATIONS = (0.1, 0.2, 0.4)
"""The shares of random actions of learners that act greedily otherwise."""
DENSE = 200_000
"""Entries of a matrix that is not sparse, at most."""
LARGEST = 20_000
"""State-action pairs of a task, at most."""


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Dynamics of a finite task that does not depend on the time, with the learner's discount.

    Attributes:
        model: the exact model.
        gamma: the learner's discount.
        P, P_end: (A * S, S), dense where that is small, else sparse.
        R: float64 (A, S), expected rewards.
        changed: the same, after each reward was changed as `REWARD_CHANGES` says.
        acted: bool (S,), the states in which episodes act before the limit.
        initial: the value before anything is learned, which that of the other states stays.
    """

    model: Model
    gamma: float
    P: Any
    P_end: Any
    R: Array
    changed: Mapping[str, Array]
    acted: Array
    initial: float = 0.0

    def following(self, V: Array) -> Array:
        """Return the expected value (A, S) of the next state, 0 where the episode ends."""
        return self.expected(self.P, self.learned(V))

    def first(self, V: Array) -> float:
        """Return the expected value of the first state."""
        return float(self.model.start @ V)

    @cached_property
    def going_on(self) -> Array:
        """Probabilities (A, S) that the episode goes on."""
        return np.asarray(self.P.sum(axis=1)).reshape(self.R.shape)

    def learned(self, V: Array) -> Array:
        """Return values with those that no episode learns at what they were at first."""
        return np.where(self.acted, V, self.initial)

    def ending(self, V: Array) -> Array:
        """Return the expected value (A, S) of the state in which the episode ends, 0 where it goes on."""
        if self.P_end is None:
            return np.zeros_like(self.R)
        return self.expected(self.P_end, self.learned(V))

    @cached_property
    def most(self) -> float:
        """The largest sum of sizes of rewards, discounted, that any policy collects; infinite where there is no bound."""
        size = np.abs(self.R)
        Q = np.zeros_like(size)
        for _ in range(STEPS):
            before = Q
            Q = size + self.gamma * self.expected(self.P, Q.max(axis=0))
            if np.abs(Q - before).max() <= 1e-6 * (1 + Q.max()):
                return float(Q.max())
        return np.inf

    @staticmethod
    def row(P: Any, action: int, state: int) -> Array:
        """Return the probabilities (S,) of what follows an action in a state."""
        row = P[action * P.shape[1] + state]
        if hasattr(row, "toarray"):
            row = row.toarray()
        return np.asarray(row).reshape(-1)

    def expected(self, P: Any, V: Array) -> Array:
        """Return the expectation (A, S) of V (S,) under probabilities (A * S, S)."""
        return (P @ V).reshape(self.R.shape)

    def visits(self, pi: Array) -> Array:
        """Return float64 (H, S): how often a policy (A, S) acts in each state at each time; without a horizon, one row."""
        rows = []
        now = self.model.start.copy()
        steps = STEPS
        if self.model.horizon is not None:
            steps = self.model.horizon
        for _ in range(steps):
            rows.append(now)
            now = self.P.T @ (pi * now).reshape(-1)
            if now.sum() < 1e-9:
                break
        counts = np.array(rows)
        return counts.sum(axis=0, keepdims=True) if self.model.horizon is None else counts


@dataclass(frozen=True, eq=False)
class Behaviour:
    """A policy by which a learner acts while it learns, and what its episodes consist of then.

    Attributes:
        pi: probabilities of actions (A, S).
    """

    dynamics: Dynamics
    pi: Array

    @cached_property
    def counts(self) -> Array:
        """Visits (H, S) of an episode."""
        return self.dynamics.visits(self.pi)

    @cached_property
    def total(self) -> Array:
        """Visits (S,) of an episode."""
        return self.counts.sum(axis=0)

    @cached_property
    def rates(self) -> Array:
        """The share (A, S) of all steps that each action takes in each state."""
        return self.pi * self.total / self.total.sum()

    @cached_property
    def visited(self) -> Array:
        """1 for actions (A, S) that are ever taken, else 0."""
        return (self.rates > 0).astype(np.float64)

    @cached_property
    def at_limit(self) -> Array:
        """Visits (S,) in the last step before the limit."""
        horizon = self.dynamics.model.horizon
        if horizon is None or len(self.counts) < horizon:
            return np.zeros_like(self.total)
        return self.counts[-1]

    @cached_property
    def last(self) -> Array:
        """The share (S,) of the visits to each state in the last step before the limit."""
        return self._share(self.at_limit, self.total)

    @cached_property
    def last_states(self) -> Array:
        """Number of episodes (S,) that are over in each state."""
        s = self.dynamics
        states: Array = s.P.T @ (self.pi * self.at_limit).reshape(-1)
        if s.P_end is not None:
            states = states + s.P_end.T @ (self.pi * self.total).reshape(-1)
        return states

    @cached_property
    def after_end(self) -> Array:
        """The share (S,) of the visits to each state that begin an episode after one that ended by itself."""
        truncated = float((self.at_limit * self.pi * self.dynamics.going_on).sum())
        return self._share((1 - truncated) * self.dynamics.model.start, self.total)

    @cached_property
    def mean_reward(self) -> float:
        return float((self.rates * self.dynamics.R).sum())

    @cached_property
    def deviation(self) -> float:
        """The standard deviation of rewards over all steps."""
        mean_square = float((self.rates * self.dynamics.changed["squared"]).sum())
        return math.sqrt(max(0.0, mean_square - self.mean_reward**2))

    def so_far(self, gamma: float) -> Array:
        """Return the sum (H, S) of rewards of an episode before each state, discounted from its start: the mean, times visits."""
        s = self.dynamics
        n = s.model.n_states
        rows = []
        now = np.zeros(n)
        for t, visits in enumerate(self.counts):
            rows.append(now)
            after = self.pi * (now + gamma**t * visits * s.R)
            now = s.P.T @ after.reshape(-1)
        return np.array(rows)

    @cached_property
    def reward_before(self) -> Array:
        """The mean reward (S,) of the step before; at the start, of the last step of an episode."""
        s = self.dynamics
        steps = (self.pi * (self.total - self.at_limit)).reshape(-1)
        last_reward = float((self.pi * self.total * (s.R - s.changed["unfinished"])).sum())
        last_reward += float((self.pi * self.at_limit * s.changed["unfinished"]).sum())
        paid = s.P.T @ (steps * s.R.reshape(-1)) + last_reward * s.model.start
        return self._share(paid, s.P.T @ steps + s.model.start)

    @staticmethod
    def arriving(P: Any, steps: Array) -> Array:
        """Return what arrives (A, S) in each state by each action under probabilities (A * S, S), of what leaves (A, S)."""
        n = P.shape[1]
        return np.stack([P[a * n : (a + 1) * n].T @ leaving for a, leaving in enumerate(steps)])

    @cached_property
    def comes_before(self) -> Array:
        """The actions (A, S) that may be those of the step before; at the start, of the last step of an episode."""
        s = self.dynamics
        steps = self.pi * (self.total - self.at_limit)
        leads = self.arriving(s.P, steps)
        ends = self.pi * (self.total - (self.total - self.at_limit) * s.going_on)
        return leads + np.outer(ends.sum(axis=1), s.model.start) > 0

    @cached_property
    def reward_after(self) -> Array:
        """The mean reward (A, S) of the step after; at an end, of the first step of an episode."""
        s = self.dynamics
        paid = (self.pi * s.R).sum(axis=0)
        first = s.first(paid)
        following = s.expected(s.P, paid)
        return (1 - self.last) * following + first * (1 - (1 - self.last) * s.going_on)

    def expected(self, Q: Array) -> Array:
        """Return V (..., S) of the policy from Q (..., A, S)."""
        return (self.pi * Q).sum(axis=-2)

    @staticmethod
    def _share(part: Array, whole: Array) -> Array:
        return np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0)


@lru_cache(maxsize=32)
def dynamics_of(task: Task, gamma: float) -> Dynamics:
    """Return the dynamics of a task.

    Raises:
        SpecError: E712 where there is no exact model, where it depends on the time, or is too large.
    """
    if task.mask:
        refuse(f"some actions of {task.id} are illegal, and operators over the legal ones alone are not known")
    model = lasting(extract(task))
    if model.is_timed:
        refuse(f"{task.id} depends on the time, which values of states leave out", "add the time to the state")
    if model.n_states * model.n_actions > LARGEST:
        refuse(f"{task.id} has more than {LARGEST:,} pairs of states and actions")
    shape = (model.n_actions, model.n_states)
    step = model.step(0)
    changed = {}
    for name, change in REWARD_CHANGES.items():
        changed[name] = lasting(extract(change(task))).step(0).R.reshape(shape)
    P = step.P
    P_end = step.P_end
    if P.shape[0] * P.shape[1] <= DENSE:
        P = P.toarray()
        if P_end is not None:
            P_end = P_end.toarray()
    dynamics = Dynamics(model, gamma, P, P_end, step.R.reshape(shape), changed, model.acting)
    uniform = np.full(shape, 1 / model.n_actions)
    return replace(dynamics, acted=dynamics.visits(uniform).sum(axis=0) > 0)


class EpsilonGreedy:
    """Greedy actions for Q (A, S), with a share of random ones: probabilities (A, S)."""

    def __init__(self, exploration: float) -> None:
        self.exploration = exploration
        self._known: dict[bytes, Array] = {}
        """The probabilities by the best actions, which stay the same while Q-values change."""

    def __call__(self, Q: Array) -> Array:
        best = best_actions(Q.T)
        key = best.tobytes()
        if key not in self._known:
            pi = best / best.sum(axis=-1, keepdims=True)
            self._known[key] = (1 - self.exploration) * pi.T + self.exploration / len(Q)
        return self._known[key]


# -- rewards that a learner sees in place of the true ones ------------------------------------------------------------


def _clipped(task: Task) -> Task:
    b = task.new_builder()
    at_least = b.apply("max2", task.process.reward, b.scalar(-1))
    return paying(b, task, b.apply("min2", at_least, b.scalar(1)))


def _sign(task: Task) -> Task:
    b = task.new_builder()
    return paying(b, task, b.apply("sign", task.process.reward))


def _squashed(task: Task) -> Task:
    b = task.new_builder()
    return paying(b, task, b.apply("tanh", task.process.reward))


def _whole(task: Task) -> Task:
    """Pay what an array of whole numbers keeps of a reward: the part after the point is lost."""
    b = task.new_builder()
    size = b.apply("floor", b.apply("abs", task.process.reward))
    return paying(b, task, b.apply("mul", b.apply("sign", task.process.reward), size))


def _squared(task: Task) -> Task:
    b = task.new_builder()
    return paying(b, task, b.apply("mul", task.process.reward, task.process.reward))


def _unfinished(task: Task) -> Task:
    """Pay 0 where the step ends the episode."""
    b = task.new_builder()
    reward = b.cast(task.process.reward, Kind.REAL)
    return paying(b, task, b.apply("where", task.process.terminal, b.scalar(0.0), reward))


REWARD_CHANGES: dict[str, Callable[[Task], Task]] = {
    "clipped": _clipped, "signs": _sign, "squashed": _squashed, "whole": _whole, "squared": _squared, "unfinished": _unfinished,
}  # fmt: skip
"""Tasks whose every reward is changed, by the name of the change.

Expected rewards of the result are not those of the task, changed: what is random is changed outcome by outcome.
"""
