"""The distance of a learned reward to the true one, and what is lost by optimising it.

The distance is a STARC metric (Skalse, Farnik, Motwani, Jenner, Gleave and Abate, 2024): rewards are made canonical, normalised,
and compared. The canonical form is their value-adjusted levelling, the advantage of every action under the uniform policy. It is
the same for two rewards that differ by potential shaping, with potentials of state and time that are 0 at the end, or in how a
reward is spread over the next states of a step; a norm of 1 takes the scale away. States that no episode reaches do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array, part_at
from taskspec.base.diagnostics import SpecError
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.model import misused, refuse
from taskspec.exact.policies.policy import greedy
from taskspec.exact.solve.backward import action_values, backward, first_values
from taskspec.exact.solve.infinite_horizon import chain_values
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.data.tabular import Tabular, tabular
from taskspec.learn.exam.dynamics import REWARD_CHANGES
from taskspec.learn.exam.operators import APART

NOTHING = 1e-11
"""Advantages that are this small, as a share of the largest value of an action, are rounding."""
ROUNDS = 1000
"""Improvements of a policy without a horizon, at the most."""


@dataclass(frozen=True, slots=True)
class RewardDistance:
    """The distance of a learned reward to the true one.

    Attributes:
        starc: from 0, where it differs by shaping and a positive scale alone, to 1, where it is the opposite; one half where one
            of the two makes no action better than another, and the other one does.
        lost: the optimal return less that of the best policy for the learned reward, by the true reward; of actions that are
            equally good for the learned one, each is taken as often.
    """

    starc: float
    lost: float


def reward_distance(task: TaskLike, reward: Any) -> RewardDistance:
    """Return how far a learned reward is from the true one; exact, on the exact model `taskspec.learn.data.tabular(task)`.

    Args:
        reward: float (S, A, S) over its states and actions, (S, A), (S,) of the state that is left; or a function of observations
            (N, *shape), actions (N, ...) and next observations (N, *shape) that gives rewards (N,). It is not called for steps
            after the end of an episode.

    Returns:
        Their STARC distance, 0 to 1, and the return that is lost by optimising the learned one.

    Raises:
        SpecError: E712 where there is no exact model, or one that is an abstraction, or where observations are no function of the
            state, or there is neither a horizon nor a discount; E713 for what is no reward.
    """
    task = load(task)
    if callable(reward) and abstraction(task) is not None:
        refuse(f"the exact model of {task.id} is an abstraction, whose states show no observations", "give a table")
    mdp = _mdp(task)
    learned = mdp.expected(reward)
    return RewardDistance(mdp.distance(mdp.true, learned), mdp.lost(learned))


def reward_fields(task: Task, reward: Any) -> dict[str, Any]:
    """Return the same as fields of a result, and the distances from `REWARDS`; None without an exact model.

    Those that are right on this task are left out.
    """
    try:
        distance = reward_distance(task, reward)
    except SpecError as error:
        if set(error.codes) != {"E712"}:
            raise
        return {"starc": None, "reward_regret": None, "rewards": None}
    mdp = _mdp(task)
    learned = mdp.canonical(mdp.expected(reward))
    distances = {}
    for name, canonical in mdp.known.items():
        if name == "right" or half_distance(canonical, mdp.known["right"]) >= APART:
            distances[name] = half_distance(canonical, learned)
    return {"starc": distance.starc, "reward_regret": distance.lost, "rewards": distances}


@lru_cache(maxsize=16)
def _mdp(task: Task) -> RewardMdp:
    return RewardMdp(task)


class RewardMdp:
    """The exact model, and rewards on it, as float64 (S, A); 0 where an episode has ended."""

    def __init__(self, task: Task) -> None:
        if task.mask:
            refuse(f"some actions of {task.id} are illegal, which the distance of rewards does not tell apart")
        model = tabular(task)
        self.task = task
        self.model = model
        if model.horizon is None and model.discount == 1:
            refuse(f"returns of {task.id} have no horizon and no discount", "give the task one of them")
        self.true = self._running(model)
        self.uniform = np.full_like(self.true, 1 / model.n_actions)

    def _running(self, model: Tabular) -> Array:
        return np.where(model.absorbed[:, None], 0.0, model.R)

    def changed(self, name: str) -> Array:
        """Return the expected rewards, after each was changed as `REWARD_CHANGES` says."""
        mapped = abstraction(self.task)
        if mapped is None:
            task = self.task
        else:
            task = mapped.stand_in
        return self._running(tabular(REWARD_CHANGES[name](task)))

    @cached_property
    def reached(self) -> list[Array]:
        """For each step the states (S,) that running episodes may be in; without a horizon, those of all steps in one."""
        model = self.model
        here = model.p0 > 0
        visited: list[Array] = []
        step = (model.going.T > 0).astype(np.float64)
        while len(visited) != model.horizon:
            visited.append(here & ~model.absorbed)
            after = step @ np.tile(here, model.n_actions) > 0
            if model.horizon is None:
                after |= here
                if (after == here).all():
                    return visited[-1:]
            here = after
        return visited

    def expected(self, reward: Any) -> Array:
        """Return the expected reward (S, A) of each step.

        Raises:
            SpecError: as for `reward_distance`.
        """
        model = self.model
        s = model.n_states
        a = model.n_actions
        table = None
        if not callable(reward):
            table = np.asarray(reward, np.float64)
        if table is not None and table.shape not in ((s, a, s), (s, a), (s,)):
            misused(f"a reward has shape ({s}, {a}, {s}), ({s}, {a}) or ({s},) here, not {table.shape}")
        R = np.zeros((s, a))
        running = np.logical_or.reduce(self.reached)
        for action, part in enumerate(model.sparse):
            steps = part.tocoo()
            counts = (steps.data > 0) & running[steps.row]
            left = steps.row[counts]
            next_state = steps.col[counts]
            if table is None:
                paid = self._call(reward, left, action, next_state)
            else:
                paid = table[(left, action, next_state)[: table.ndim]]
            if paid.shape != left.shape or not np.isfinite(paid).all():
                misused("a reward is a finite number for each step")
            R[:, action] = np.bincount(left, steps.data[counts] * paid, s)
        return R

    def _call(self, reward: Any, left: Array, action: int, next_state: Array) -> Array:
        layout = self.model.task.action_layout
        if layout.form == "discrete":
            one: Any = action + layout.starts[0]
        else:
            one = np.array(np.unravel_index(action, layout.counts))
        before = part_at(self.model.observations, left)
        after = part_at(self.model.observations, next_state)
        actions = np.broadcast_to(one, (len(left), *np.shape(one)))
        return np.asarray(reward(before, actions, after), np.float64)

    def _backward(self, R: Array, choose: Callable[[int, Array], Array]) -> Iterator[tuple[int, Array, Array]]:
        def backup(t: int, V: Array) -> Array:
            return self._q(R, V)

        return backward(backup, choose, np.zeros(self.model.n_states), self.model.horizon or 0)

    def _q(self, R: Array, V: Array) -> Array:
        return action_values(self.model.going, R.T, self.model.discount, V).T

    def _plan(self, R: Array) -> list[Array]:
        """Return the optimal policy of a reward, pi[t] (S, A); actions that are equally good are equally likely."""
        size = np.abs(R).max()
        if size > 0:
            R = R / size
        if self.model.horizon is not None:
            policies = [greedy(Q) for _, Q, _ in self._backward(R, lambda t, Q: Q.max(axis=1))]
            return policies[::-1]
        pi = self.uniform
        for _ in range(ROUNDS):
            better = greedy(self._q(R, self._stationary(R, pi)))
            if np.array_equal(better, pi):
                break
            pi = better
        return [pi]

    def _stationary(self, R: Array, pi: Array) -> Array:
        moves = sum(sparse.diags_array(pi[:, a]) @ part for a, part in enumerate(self.model.sparse))
        everywhere = np.ones(self.model.n_states, np.bool_)
        return chain_values((self.model.discount * moves).tocsr(), (pi * R).sum(axis=1), everywhere)

    def canonical(self, R: Array) -> Array:
        """Return the advantages of all actions under the uniform policy, as a vector of length 1; 0 where all are rounding."""
        if self.model.horizon is None:
            q_values = [self._q(R, self._stationary(R, self.uniform))]
        else:
            q_values = [Q for _, Q, _ in self._backward(R, lambda t, Q: Q.mean(axis=1))]
        known = [Q[here] for Q, here in zip(reversed(q_values), self.reached, strict=True)]
        advantages = np.concatenate([(Q - Q.mean(axis=1, keepdims=True)).reshape(-1) for Q in known])
        largest = max(float(np.abs(Q).max(initial=0)) for Q in known)
        if np.abs(advantages).max(initial=0) <= NOTHING * largest:
            return np.zeros_like(advantages)
        advantages /= np.abs(advantages).max()
        return np.asarray(advantages / np.linalg.norm(advantages))

    def distance(self, one: Array, other: Array) -> float:
        """Return half the distance of two rewards in canonical form: at most 1."""
        return half_distance(self.canonical(one), self.canonical(other))

    @cached_property
    def known(self) -> dict[str, Array]:
        """`REWARDS` in canonical form."""
        return {name: self.canonical(known(self)) for name, known in REWARDS.items()}

    @cached_property
    def visits(self) -> Array:
        """Expected visits of uniformly random episodes to each state, (S,)."""
        total = np.zeros(self.model.n_states)
        now = np.where(self.model.absorbed, 0.0, self.model.p0)
        for _ in range(ROUNDS if self.model.horizon is None else self.model.horizon):
            total += now
            now = self.next_visits(np.tile(now / self.model.n_actions, self.model.n_actions))
        return total

    def next_visits(self, weights: Array) -> Array:
        """Return the weights (S,) of the states that follow, from those of all pairs (A * S,), where the episode goes on."""
        return np.where(self.model.absorbed, 0.0, self.model.going.T @ weights)

    def lost(self, learned: Array) -> float:
        """Return the optimal true return less that of the best policy for a learned reward."""
        return max(0.0, self._true_return(self._plan(self.true)) - self._true_return(self._plan(learned)))

    def _true_return(self, pi: list[Array]) -> float:
        if self.model.horizon is None:
            V = self._stationary(self.true, pi[0])
        else:
            V = first_values(self._backward(self.true, lambda t, Q: (pi[t] * Q).sum(axis=1)))
        return float(self.model.p0 @ V)


def half_distance(one: Array, other: Array) -> float:
    """Return half the distance of canonical rewards: at most 1."""
    return min(1.0, float(np.linalg.norm(one - other)) / 2)


# -- rewards that are learned by mistake ------------------------------------------------------------------------------


def _step_before(mdp: RewardMdp) -> Array:
    weights = np.tile(mdp.visits / mdp.model.n_actions, mdp.model.n_actions)
    arrivals = mdp.next_visits(weights)
    paid = mdp.next_visits(weights * mdp.true.T.reshape(-1))
    mean = np.divide(paid, arrivals, out=np.zeros_like(paid), where=arrivals > 0)
    return np.broadcast_to(mean[:, None], mdp.true.shape)


def _arriving(mdp: RewardMdp) -> Array:
    """Return the mean reward of the steps that lead to each state by each action."""
    n = mdp.model.n_states
    weights = mdp.visits / mdp.model.n_actions
    means = np.zeros_like(mdp.true)
    for action in range(mdp.model.n_actions):
        leads = np.zeros((mdp.model.n_actions, n))
        leads[action] = weights
        arrivals = mdp.next_visits(leads.reshape(-1))
        leads[action] = weights * mdp.true[:, action]
        paid = mdp.next_visits(leads.reshape(-1))
        means[:, action] = np.divide(paid, arrivals, out=np.zeros_like(paid), where=arrivals > 0)
    return means


def _step_after(mdp: RewardMdp) -> Array:
    return action_values(mdp.model.going, np.zeros_like(mdp.true.T), 1.0, mdp.true.mean(axis=1)).T


def _action_mean(mdp: RewardMdp) -> Array:
    return np.broadcast_to(mdp.true.mean(axis=1, keepdims=True), mdp.true.shape)


def _state_mean(mdp: RewardMdp) -> Array:
    mean = mdp.visits @ mdp.true / mdp.visits.sum()
    return np.where(mdp.model.absorbed[:, None], 0.0, mean)


REWARDS: dict[str, Callable[[RewardMdp], Array]] = {
    "right": lambda mdp: mdp.true,
    "constant": lambda mdp: np.zeros_like(mdp.true),
    "reward negated": lambda mdp: -mdp.true,
    "reward before": _step_before,
    "reward after": _step_after,
    "observation overwritten": _arriving,
    "action unseen": _action_mean,
    "state unseen": _state_mean,
    "rewards clipped": lambda mdp: mdp.changed("clipped"),
    "signs of rewards": lambda mdp: mdp.changed("signs"),
}
"""Rewards (S, A) of a task by the name of the mistake, the true one first; averages are of uniformly random episodes."""
