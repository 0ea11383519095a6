"""How far a learned reward is from the true one: up to what makes no difference, and in what is lost by optimising it.

The distance is a STARC metric (Skalse, Farnik, Motwani, Jenner, Gleave and Abate, 2024): rewards are made canonical, normalised,
and compared. The canonical form is their value-adjusted levelling, the advantage of every action where all that follows is
random. It is the same for two rewards that differ by potential shaping, with potentials of state and time that are 0 at the end,
or in how a reward is spread over what a step may lead to; a norm of 1 takes the scale away. What no episode can come to does not
count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import abstraction
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.data import Tabular, tabular
from taskspec.model.model import misused, refuse
from taskspec.policies.policy import greedy
from taskspec.registry import load
from taskspec.solve.backward import action_values, backward, first_values
from taskspec.solve.infinite_horizon import chain_values
from taskspec.task.task import Task, TaskLike

NOTHING = 1e-11
"""Advantages that are this small, as a share of the largest value of an action, are rounding."""
ROUNDS = 1000
"""Improvements of a plan without a horizon, at the most."""


@dataclass(frozen=True, eq=False)
class Learned:
    """A policy, and the reward that it was learned from.

    Args:
        reward: float64 (S, A, S) over the states and actions of `task.tabular()`, or a function of (obs, action, next_obs), all
            (N, ...); `reward_distance` says how far it is from the true one.
    """

    policy: Any
    reward: Any = None


@dataclass(frozen=True, slots=True)
class RewardDistance:
    """How far a learned reward is from the true one.

    Attributes:
        starc: from 0, where it differs by shaping and a positive scale alone, to 1, where it is the opposite; one half where one
            of the two makes no action better than another, and the other one does.
        lost: the optimal return less that of the best policy for the learned reward, by the true reward; of actions that are
            equally good for the learned one, each is taken as often.
    """

    starc: float
    lost: float


def reward_distance(task: TaskLike, reward: Any) -> RewardDistance:
    """Return how far a learned reward is from the true one; exact, on the exact model `taskspec.data.tabular(task)`.

    Args:
        reward: float (S, A, S) over its states and actions, (S, A), (S,) of the state that is left; or a function of observations
            (N, *shape), actions (N, ...) and next observations (N, *shape) that gives rewards (N,). What it says of steps after
            the end of an episode is not asked.

    Raises:
        SpecError: E712 where there is no exact model, or one that is an abstraction, or where observations are no function of the
            state, or there is neither a horizon nor a discount; E713 for what is no reward.
    """
    task = load(task)
    if callable(reward) and abstraction(task) is not None:
        refuse(f"the exact model of {task.id} is an abstraction, whose states show no observations", "give a table")
    chain = _Chain(tabular(task))
    learned = chain.of_steps(reward)
    return RewardDistance(chain.apart(chain.true, learned), chain.lost(learned))


def told(task: Task, reward: Any) -> dict[str, float | None]:
    """Return the same as fields of a result; None where it cannot be worked out."""
    try:
        found = reward_distance(task, reward)
    except SpecError as error:
        if {d.code for d in error.diagnostics} != {"E712"}:
            raise
        return {"starc": None, "reward_regret": None}
    return {"starc": found.starc, "reward_regret": found.lost}


class _Chain:
    """The exact model, and rewards on it, as float64 (S, A); 0 where an episode has ended."""

    def __init__(self, model: Tabular) -> None:
        self.model = model
        self.discount = model.discount
        self.horizon = model.horizon
        if self.horizon is None and self.discount == 1:
            refuse(f"returns of {model.task.id} have no horizon and no discount", "give the task one of them")
        self.true = np.where(model.absorbed[:, None], 0.0, model.R)

    @cached_property
    def acting(self) -> list[Array]:
        """For each step the states (S,) in which an episode may be that goes on; without a horizon, those of all steps in one."""
        here = self.model.p0 > 0
        found = []
        step = (self.model.going.T > 0).astype(np.float64)
        for _ in range(self.horizon or 0):
            found.append(here & ~self.model.absorbed)
            here = step @ np.tile(here, self.model.n_actions) > 0
        while self.horizon is None:
            more = here | (step @ np.tile(here, self.model.n_actions) > 0)
            if (more == here).all():
                return [here & ~self.model.absorbed]
            here = more
        return found

    # -- rewards ------------------------------------------------------------------------------------------------------

    def of_steps(self, reward: Any) -> Array:
        """Return the expected reward (S, A) of each step.

        Raises:
            SpecError: as for `reward_distance`.
        """
        given = None if callable(reward) else np.asarray(reward, np.float64)
        s = self.model.n_states
        a = self.model.n_actions
        if given is not None and given.shape not in ((s, a, s), (s, a), (s,)):
            misused(f"a reward has shape ({s}, {a}, {s}), ({s}, {a}) or ({s},) here, not {given.shape}")
        found = np.zeros((s, a))
        for action, part in enumerate(self.model.sparse):
            steps = part.tocoo()
            asked = (steps.data > 0) & ~self.model.absorbed[steps.row] & self._ever[steps.row]
            left = steps.row[asked]
            reached = steps.col[asked]
            chance = steps.data[asked]
            paid = (
                self._asked(reward, left, action, reached)
                if given is None
                else _looked_up(given, left, action, reached)
            )
            if paid.shape != left.shape or not np.isfinite(paid).all():
                misused("a reward is a finite number for each step")
            found[:, action] = np.bincount(left, chance * paid, s)
        return found

    @cached_property
    def _ever(self) -> Array:
        """The states (S,) in which an episode may ever be that goes on."""
        return np.asarray(np.logical_or.reduce(self.acting))

    def _asked(self, reward: Any, left: Array, action: int, reached: Array) -> Array:
        """Return what a function of observations says of steps."""
        layout = self.model.task.action_layout
        one = (
            action + layout.starts[0]
            if layout.form == "discrete"
            else np.array(np.unravel_index(action, layout.counts))
        )
        seen = self.model.observations
        before, after = (
            {k: v[i] for k, v in seen.items()} if isinstance(seen, dict) else seen[i] for i in (left, reached)
        )
        return np.asarray(reward(before, np.broadcast_to(one, (len(left), *np.shape(one))), after), np.float64)

    # -- values -------------------------------------------------------------------------------------------------------

    def _actions(self, reward: Array, following: Array) -> Array:
        """Return the values (S, A) of actions, given those of the states (S,) that follow."""
        return action_values(self.model.going, reward.T, self.discount, following).T

    def _backward(self, reward: Array, choose: Callable[[int, Array], Array]) -> Iterator[tuple[int, Array, Array]]:
        """Yield the time, the values (S, A) of actions and those (S,) of states, from the last step to the first."""
        end = np.zeros(self.model.n_states)
        return backward(lambda t, value: self._actions(reward, value), choose, end, self.horizon or 0)

    def _plan(self, reward: Array) -> list[Array]:
        """Return the best actions for a reward as probabilities (S, A), for each step; all that are best alike."""
        size = np.abs(reward).max()
        reward = reward / size if size > 0 else reward
        if self.horizon is None:
            return [self._stationary(reward)]
        found = [greedy(q) for _, q, _ in self._backward(reward, lambda t, q: q.max(axis=1))]
        return found[::-1]

    def _stationary(self, reward: Array) -> Array:
        plan = np.full_like(reward, 1 / self.model.n_actions)
        for _ in range(ROUNDS):
            better = greedy(self._actions(reward, self._lasting(reward, plan)))
            if np.array_equal(better, plan):
                break
            plan = better
        return plan

    def _value(self, reward: Array, plan: list[Array]) -> Array:
        """Return the values (S,) of the states at the beginning under a plan."""
        if self.horizon is None:
            return self._lasting(reward, plan[0])
        return first_values(self._backward(reward, lambda t, q: (plan[t] * q).sum(axis=1)))

    def _lasting(self, reward: Array, chances: Array) -> Array:
        """Return the values (S,) of a policy that does the same at all times, without a horizon."""
        from scipy import sparse

        moves = sum(sparse.diags_array(chances[:, a]) @ part for a, part in enumerate(self.model.sparse))
        everywhere = np.ones(self.model.n_states, np.bool_)
        return chain_values((self.discount * moves).tocsr(), (chances * reward).sum(axis=1), everywhere)

    # -- what is told -------------------------------------------------------------------------------------------------

    def canonical(self, reward: Array) -> Array:
        """Return the advantages of all actions where all that follows is random, as a vector of length 1; 0 where all are
        rounding.
        """
        chances = np.full_like(reward, 1 / self.model.n_actions)
        if self.horizon is None:
            values = [self._actions(reward, self._lasting(reward, chances))]
        else:
            values = [q for _, q, _ in self._backward(reward, lambda t, q: q.mean(axis=1))]
            values = values[::-1]
        known = [value[here] for value, here in zip(values, self.acting, strict=True)]
        found = np.concatenate([(value - value.mean(axis=1, keepdims=True)).reshape(-1) for value in known])
        largest = max(float(np.abs(value).max(initial=0)) for value in known)
        if np.abs(found).max(initial=0) <= NOTHING * largest:
            return np.zeros_like(found)
        found /= np.abs(found).max()
        return np.asarray(found / np.linalg.norm(found))

    def apart(self, one: Array, other: Array) -> float:
        """Return half the distance of two rewards in canonical form: at most 1."""
        return min(1.0, float(np.linalg.norm(self.canonical(one) - self.canonical(other))) / 2)

    def lost(self, learned: Array) -> float:
        """Return what the best policy for a learned reward earns less than the optimum, by the true one."""
        best, found = (float(self.model.p0 @ self._value(self.true, self._plan(r))) for r in (self.true, learned))
        return max(0.0, best - found)


def _looked_up(table: Array, left: Array, action: int, reached: Array) -> Array:
    match table.ndim:
        case 1:
            return np.asarray(table[left])
        case 2:
            return np.asarray(table[left, action])
        case _:
            return np.asarray(table[left, action, reached])
