"""Bellman operators: the right one, and those that learners with a mistake apply, on the exact model of a finite task.

Symbols: P[a, s, s'] is the probability that the episode goes on in s', P_end[a, s, s'] that it ends there, R[a, s] the expected
reward, V(s) = max over a of Q(s, a) unless an operator says otherwise; for the critic of an actor, V(s) is the mean of Q(s, a)
under its policy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exam.reward_changes import REWARD_CHANGES, with_changed_reward
from taskspec.model.extract import extract
from taskspec.model.model import Model, refuse
from taskspec.policies.policy import greedy
from taskspec.solve.backward import action_values
from taskspec.task.task import Task

STEPS = 5000
"""Steps of episodes that do not end by themselves, at most."""
EXPLORATION = 0.1
"""The share of random actions that is assumed where an operator depends on how the learner behaves."""
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
        acted: bool (S,), the states in which episodes act before the limit: values of others are never learned, and stay 0.
        shares: what `last_share` found last.
        pi: for the critic of an actor, the probabilities of actions (A, S) of its policy.
    """

    model: Model
    gamma: float
    P: Any
    P_end: Any
    R: Array
    changed: Mapping[str, Array]
    acted: Array
    shares: dict[bytes, Array] = field(default_factory=dict)
    pi: Array | None = None

    def following(self, V: Array) -> Array:
        """Return the expected value (A, S) of the next state, 0 where the episode ends."""
        return action_values(self.P, np.zeros_like(self.R), 1.0, self.learned(V))

    @property
    def going_on(self) -> Array:
        """Probabilities (A, S) that the episode goes on."""
        found: Array = np.asarray(self.P.sum(axis=1)).reshape(self.R.shape)
        return found

    def learned(self, V: Array) -> Array:
        """Return values with those at 0 that no episode learns."""
        return np.where(self.acted, V, 0.0)

    def ending(self, V: Array) -> Array:
        """Return the same of the states in which the episode ends, 0 where it goes on."""
        if self.P_end is None:
            return np.zeros_like(self.R)
        return action_values(self.P_end, np.zeros_like(self.R), 1.0, V)

    def visits(self, policy: Array) -> Array:
        """Return float64 (H, S): how often a policy (A, S) acts in each state at each time; without a horizon, one row."""
        rows = []
        now = self.model.start.copy()
        steps = STEPS if self.model.horizon is None else self.model.horizon
        for _ in range(steps):
            rows.append(now)
            now = self.P.T @ (policy * now).reshape(-1)
            if now.sum() < 1e-9:
                break
        counts = np.array(rows)
        return counts.sum(axis=0, keepdims=True) if self.model.horizon is None else counts

    def last_share(self, Q: Array) -> Array:
        """Return float64 (S,): of the learner's visits to a state, the share in the last step before the limit.

        An actor acts as it does; others are greedy for Q (A, S), with a share of random actions.
        """
        policy = self.pi
        if policy is None:
            policy = behaviour(Q)
        key = policy.tobytes()
        if key not in self.shares:
            self.shares.clear()  # a policy that has settled is asked for again and again, and no other one
            self.shares[key] = self._last_share(policy)
        return self.shares[key]

    def _last_share(self, policy: Array) -> Array:
        horizon = self.model.horizon
        counts = self.visits(policy)
        if horizon is None or len(counts) < horizon:
            return np.zeros(self.model.n_states)
        total = counts.sum(axis=0)
        share: Array = np.divide(counts[-1], total, out=np.zeros_like(total), where=total > 0)
        return share


@lru_cache(maxsize=32)
def dynamics_of(task: Task, gamma: float) -> Dynamics:
    """Return the dynamics of a task.

    Raises:
        SpecError: E712 where there is no exact model, where it depends on the time, or is too large.
    """
    if task.mask:
        refuse(f"some actions of {task.id} are illegal, and operators over the legal ones alone are not known")
    model = extract(task)
    if model.is_timed:
        refuse(f"{task.id} depends on the time, which values of states leave out", "add the time to the state")
    if model.n_states * model.n_actions > LARGEST:
        refuse(f"{task.id} has more than {LARGEST:,} pairs of states and actions")
    shape = (model.n_actions, model.n_states)
    step = model.step(0)
    changed = {}
    for name in REWARD_CHANGES:
        changed[name] = extract(with_changed_reward(task, name)).step(0).R.reshape(shape)
    P = step.P
    P_end = step.P_end
    if P.shape[0] * P.shape[1] <= DENSE:
        P = P.toarray()
        if P_end is not None:
            P_end = P_end.toarray()
    found = Dynamics(model, gamma, P, P_end, step.R.reshape(shape), changed, model.acting)
    uniform = np.full(shape, 1 / model.n_actions)
    return replace(found, acted=found.visits(uniform).sum(axis=0) > 0)


# -- operators --------------------------------------------------------------------------------------------------------

Backup = Callable[[Dynamics, Array, Array], Array]
"""From dynamics, Q (A, S) and V (S,) to the next Q (A, S)."""


@dataclass(frozen=True)
class BellmanOperator:
    """A Bellman operator, and the mistake that makes a learner apply it.

    Attributes:
        backup: from Q and V to the next Q.
        mistake: a sentence that follows "your values are those of a learner".
        code: what such code usually looks like.
        fix: what to do.
        reduce: the reduction of Q to V, where it is part of the mistake.
        on_policy: whether V is the expectation of Q under what the learner does.
    """

    name: str
    backup: Backup
    mistake: str
    code: str
    fix: str
    reduce: Callable[[Dynamics, Array], Array] | None = None
    on_policy: bool = False


def _right(s: Dynamics, Q: Array, V: Array) -> Array:
    return action_values(s.P, s.R, s.gamma, s.learned(V))


def _ends_ignored(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma * (s.following(V) + s.ending(s.learned(V)))


def _next_episode(s: Dynamics, Q: Array, V: Array) -> Array:
    first = float(s.model.start @ V)
    last = s.last_share(Q)
    goes_on = (1 - last) * s.following(V)
    starts_again = s.ending(np.ones_like(V)) + last * s.going_on
    found: Array = s.R + s.gamma * (goes_on + first * starts_again)
    return found


def _limit_is_end(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma * (1 - s.last_share(Q)) * s.following(V)


def _same_state(s: Dynamics, Q: Array, V: Array) -> Array:
    found: Array = s.R + s.gamma * s.going_on * V
    return found


def _reward_discounted(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.gamma * (s.R + s.following(V))


def _discounted_twice(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.gamma**2 * s.following(V)


def _undiscounted(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R + s.following(V)


def _immediate(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.R


def _clipped(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.changed["clipped"] + s.gamma * s.following(V)


def _signs(s: Dynamics, Q: Array, V: Array) -> Array:
    return s.changed["signs"] + s.gamma * s.following(V)


def _negated(s: Dynamics, Q: Array, V: Array) -> Array:
    return -s.R + s.gamma * s.following(V)


def _action_before(s: Dynamics, Q: Array, V: Array) -> Array:
    n = s.model.n_states
    following = np.stack([s.P[a * n : (a + 1) * n] @ s.learned(Q[a]) for a in range(s.model.n_actions)])
    return s.R + s.gamma * following


def behaviour(Q: Array, exploration: float = EXPLORATION) -> Array:
    """Return probabilities (A, S): greedy for Q, with a share of random actions."""
    return (1 - exploration) * greedy(Q.T).T + exploration / len(Q)


def _mean(s: Dynamics, Q: Array) -> Array:
    found: Array = Q.mean(axis=0)
    return found


def _least(s: Dynamics, Q: Array) -> Array:
    found: Array = Q.min(axis=0)
    return found


def _all_states(s: Dynamics, Q: Array) -> Array:
    return np.full(Q.shape[1], Q[:, s.model.acting].max())


OPERATORS = {
    operator.name: operator
    for operator in (
        BellmanOperator("right", _right, "without a mistake in its targets", "r + gamma * (1 - terminated) * V(s')", ""),
        BellmanOperator(
            "on policy", _right, "that learns the values of what it does, exploration included (SARSA)",
            "target = r + gamma * Q(s', a')", "Nothing, if that is meant; else take the maximum over actions.",
            on_policy=True,
        ),
        BellmanOperator(
            "ends ignored", _ends_ignored, "that bootstraps past the end of an episode",
            "target = r + gamma * V(s')", "Multiply V(s') by (1 - terminated).",
        ),
        BellmanOperator(
            "next episode", _next_episode, "for which an episode continues with the first state of the next one",
            "next_obs taken after the environment was reset",
            "Take the last observation of the episode (final_obs), and mask its value where it is terminal.",
        ),
        BellmanOperator(
            "limit is an end", _limit_is_end, "for which the time limit ends the world",
            "done = terminated or truncated", "Mask V(s') by terminated alone; truncated episodes keep their value.",
        ),
        BellmanOperator(
            "same state", _same_state, "that takes the state it left for the one it reached",
            "next_obs = obs, or a buffer that shares memory", "Store the observation that step() returned, as a copy.",
        ),
        BellmanOperator(
            "mean of actions", _right, "that averages over the next actions instead of choosing the best",
            "q(s').mean(axis=-1)", "Take the maximum over actions.", _mean,
        ),
        BellmanOperator(
            "least action", _right, "that expects the worst of the next actions",
            "q(s').min(axis=-1), or a minimum over the wrong axis", "Take the maximum over actions.", _least,
        ),
        BellmanOperator(
            "all states", _right, "that takes the best value of any state for the next one",
            "q.max() without an axis", "Take the maximum over the axis of actions.", _all_states,
        ),
        BellmanOperator(
            "action before", _action_before, "that looks up the next state with the action that was just taken",
            "q[s', a]", "Update the action before the look-up, or take the maximum.",
        ),
        BellmanOperator(
            "reward discounted", _reward_discounted, "that discounts the reward, too",
            "gamma * (r + V(s'))", "Move the parenthesis: r + gamma * V(s').",
        ),
        BellmanOperator(
            "discounted twice", _discounted_twice, "that discounts twice a step",
            "gamma in the buffer and in the target", "Apply gamma once.",
        ),
        BellmanOperator(
            "undiscounted", _undiscounted, "that does not discount", "target = r + V(s')",
            "Multiply V(s') by gamma.",
        ),
        BellmanOperator(
            "immediate reward", _immediate, "that sees no further than the next reward",
            "target = r, or gamma = 0", "Add gamma * V(s'), and check that its mask is not inverted; or train longer.",
        ),
        BellmanOperator(
            "rewards clipped", _clipped, "whose rewards are clipped to [-1, 1]",
            "a wrapper or option for Atari was left on", "Remove it.",
        ),
        BellmanOperator(
            "signs of rewards", _signs, "that sees the signs of rewards alone",
            "np.sign(r), as wrappers for Atari do", "Remove it.",
        ),
        BellmanOperator(
            "reward negated", _negated, "that takes rewards for costs", "target = -r + ...", "Remove the minus sign.",
        ),
    )
}  # fmt: skip
"""Operators by name: the right one first, then those of mistakes."""
GOOD = ("right", "on policy")
"""Operators that are no mistake."""
