"""Bellman operators: the right one, and those that learners with a mistake apply, on the exact model of a finite task.

Symbols: P[a, s, s'] is the probability that the episode goes on in s', P_end[a, s, s'] that it ends there, R[a, s] the expected
reward, V(s) = max over a of Q(s, a) unless an operator says otherwise; for the critic of an actor, V(s) is the mean of Q(s, a)
under its policy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.learn.exam.dynamics import Behaviour, Dynamics

TRACE = 0.95
"""The weight of later errors in advantages that is assumed."""


@dataclass(frozen=True)
class BellmanOperator:
    """A Bellman operator: Q = reward + gamma * ahead, unless `backup` says otherwise.

    Attributes:
        reward: of each step, (A, S).
        ahead: the value of what follows each step, (A, S), from V (S,).
        backup: from Q (A, S) and V to the next Q.
        reduce: from Q to V, where this is part of the mistake.
        of: whether it is about Q-values, or the values of a critic; of both if None.
        recognise: the distance of learned values (A, S), or (S,), where the mistake has no fixed point; None if they say nothing.
    """

    reward: Callable[[Dynamics, Behaviour], Array] = lambda s, acts: s.R
    ahead: Callable[[Dynamics, Behaviour, Array], Array] = lambda s, acts, V: s.following(V)
    backup: Callable[[Dynamics, Behaviour, Array, Array], Array] | None = None
    reduce: Callable[[Dynamics, Behaviour, Array], Array] | None = None
    of: Literal["q", "values"] | None = None
    recognise: Callable[[Dynamics, Array], float | None] | None = None

    def targets(self, s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
        """Return the next Q (A, S)."""
        if self.backup is not None:
            return self.backup(s, acts, Q, V)
        ahead: Array = s.gamma * self.ahead(s, acts, V)
        return self.reward(s, acts) + ahead


def _next_episode(s: Dynamics, acts: Behaviour, V: Array) -> Array:
    goes_on = (1 - acts.last) * s.following(V)
    starts_again = s.ending(np.ones_like(V)) + acts.last * s.going_on
    found: Array = goes_on + s.first(V) * starts_again
    return found


def _reset_at_limit(s: Dynamics, acts: Behaviour, V: Array) -> Array:
    return (1 - acts.last) * s.following(V) + s.first(V) * acts.last * s.going_on


def _advantages(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the targets for V = E[sum of (gamma * trace)^k * errors], multiplied by (1 - gamma * trace * P) and solved for V."""
    return (s.R + s.gamma * (1 + TRACE) * s.following(V)) / 2


def _action_before(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    n = s.model.n_states
    following = np.stack([s.P[a * n : (a + 1) * n] @ s.learned(Q[a]) for a in range(s.model.n_actions)])
    return s.R + s.gamma * following


def _any_action(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    return np.broadcast_to(acts.expected(OPERATORS["right"].targets(s, acts, Q, V)), Q.shape)


def _stale_action(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    return np.where(acts.comes_before, _any_action(s, acts, Q, V), s.initial)


def _grows(s: Dynamics, learned: Array) -> float | None:
    if s.gamma < 1:
        bound = np.abs(s.R).max() / (1 - s.gamma)
    else:
        bound = np.inf
    if np.abs(learned[..., s.acted]).max() > 2 * max(bound, abs(s.initial)):
        return 0.0
    return None


def _one_pair(s: Dynamics, learned: Array) -> float:
    changed = learned[:, s.acted] != s.initial
    return float(not changed.sum() == 1 < changed.size)


OPERATORS = {
    "right": BellmanOperator(),
    "on policy": BellmanOperator(reduce=lambda s, acts, Q: acts.expected(Q), of="q"),
    # -- ends and limits
    "ends ignored": BellmanOperator(ahead=lambda s, acts, V: s.following(V) + s.ending(V)),
    "next episode": BellmanOperator(ahead=_next_episode),
    "limit is an end": BellmanOperator(ahead=lambda s, acts, V: (1 - acts.last) * s.following(V)),
    "reset at the end": BellmanOperator(ahead=lambda s, acts, V: s.following(V) + s.first(V) * (1 - s.going_on)),
    "reset at the limit": BellmanOperator(ahead=_reset_at_limit),
    "mask inverted": BellmanOperator(ahead=lambda s, acts, V: s.ending(V)),
    "mask late": BellmanOperator(ahead=lambda s, acts, V: (1 - acts.after_end) * (s.following(V) + s.ending(V))),
    "last reward masked": BellmanOperator(reward=lambda s, acts: s.changed["unfinished"]),
    # -- what follows
    "same state": BellmanOperator(ahead=lambda s, acts, V: s.going_on * V),
    "mean of actions": BellmanOperator(reduce=lambda s, acts, Q: Q.mean(axis=0), of="q"),
    "least action": BellmanOperator(reduce=lambda s, acts, Q: Q.min(axis=0), of="q"),
    "all states": BellmanOperator(reduce=lambda s, acts, Q: np.full(Q.shape[1], Q[:, s.acted].max()), of="q"),
    "action before": BellmanOperator(backup=_action_before, of="q"),
    # -- discounts
    "reward discounted": BellmanOperator(reward=lambda s, acts: s.gamma * s.R),
    "discounted twice": BellmanOperator(ahead=lambda s, acts, V: s.gamma * s.following(V)),
    "undiscounted": BellmanOperator(backup=lambda s, acts, Q, V: s.R + s.following(V)),
    "immediate reward": BellmanOperator(ahead=lambda s, acts, V: np.zeros_like(s.R)),
    # -- rewards
    "rewards clipped": BellmanOperator(reward=lambda s, acts: s.changed["clipped"]),
    "signs of rewards": BellmanOperator(reward=lambda s, acts: s.changed["signs"]),
    "reward negated": BellmanOperator(reward=lambda s, acts: -s.R),
    "rewards centred": BellmanOperator(reward=lambda s, acts: s.R - acts.mean_reward),
    "reward before": BellmanOperator(reward=lambda s, acts: np.broadcast_to(acts.reward_before, s.R.shape)),
    "reward after": BellmanOperator(reward=lambda s, acts: acts.reward_after),
    # -- what is updated
    "stale action": BellmanOperator(backup=_stale_action, of="q"),
    "any action": BellmanOperator(backup=_any_action, of="q"),
    "advantages": BellmanOperator(backup=_advantages, of="values"),
    "grows": BellmanOperator(recognise=_grows),
    "one pair": BellmanOperator(of="q", recognise=_one_pair),
}
"""Operators by the name of the mistake that makes a learner apply them; the right one first."""
GOOD = ("right", "on policy")
"""Operators that are no mistake."""
