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
from taskspec.exam.dynamics import Behaviour, Dynamics

TRACE = 0.95
"""The weight of later errors in advantages that is assumed."""

Backup = Callable[[Dynamics, Array, Array, Behaviour], Array]
"""From dynamics, Q (A, S), V (S,) and behaviour to the next Q (A, S)."""


@dataclass(frozen=True)
class BellmanOperator:
    """A Bellman operator.

    Attributes:
        backup: from Q and V to the next Q.
        reduce: the reduction of Q to V, where it is part of the mistake.
        of: whether it is about Q-values, or the values of a critic; of both if None.
        recognise: the distance of learned values (A, S), or (S,), where the mistake has no fixed point; None if they say nothing.
    """

    backup: Backup
    reduce: Callable[[Dynamics, Array, Behaviour], Array] | None = None
    of: Literal["q", "values"] | None = None
    recognise: Callable[[Dynamics, Array], float | None] | None = None


def _right(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.gamma * s.following(V)


def _ends_ignored(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.gamma * (s.following(V) + s.ending(V))


def _next_episode(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    first = float(s.model.start @ V)
    goes_on = (1 - acts.last) * s.following(V)
    starts_again = s.ending(np.ones_like(V)) + acts.last * s.going_on
    found: Array = s.R + s.gamma * (goes_on + first * starts_again)
    return found


def _reset_at_end(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    first = float(s.model.start @ V)
    found: Array = s.R + s.gamma * (s.following(V) + first * (1 - s.going_on))
    return found


def _reset_at_limit(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    first = float(s.model.start @ V)
    found: Array = s.R + s.gamma * ((1 - acts.last) * s.following(V) + first * acts.last * s.going_on)
    return found


def _limit_is_end(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.gamma * (1 - acts.last) * s.following(V)


def _mask_inverted(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.gamma * s.ending(V)


def _mask_late(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    found: Array = s.R + s.gamma * (1 - acts.after_end) * (s.following(V) + s.ending(V))
    return found


def _last_reward_masked(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.changed["unfinished"] + s.gamma * s.following(V)


def _same_state(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    found: Array = s.R + s.gamma * s.going_on * V
    return found


def _reward_discounted(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.gamma * (s.R + s.following(V))


def _discounted_twice(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.gamma**2 * s.following(V)


def _undiscounted(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R + s.following(V)


def _immediate(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R


def _clipped(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.changed["clipped"] + s.gamma * s.following(V)


def _signs(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.changed["signs"] + s.gamma * s.following(V)


def _negated(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return -s.R + s.gamma * s.following(V)


def _centred(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return s.R - acts.mean_reward + s.gamma * s.following(V)


def _reward_before(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return acts.reward_before + s.gamma * s.following(V)


def _reward_after(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    return acts.reward_after + s.gamma * s.following(V)


def _advantages(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    """Return the targets for V = E[sum of (gamma * trace)^k * errors], multiplied by (1 - gamma * trace * P) and solved for V."""
    return (s.R + s.gamma * (1 + TRACE) * s.following(V)) / 2


def _action_before(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    n = s.model.n_states
    following = np.stack([s.P[a * n : (a + 1) * n] @ s.learned(Q[a]) for a in range(s.model.n_actions)])
    return s.R + s.gamma * following


def _stale_action(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    """Return the targets of the state, for the actions that may come before it."""
    target = acts.expected(_right(s, Q, V, acts))
    return np.where(acts.comes_before, target, s.initial)


def _any_action(s: Dynamics, Q: Array, V: Array, acts: Behaviour) -> Array:
    target = acts.expected(_right(s, Q, V, acts))
    return np.broadcast_to(target, Q.shape)


def _mean(s: Dynamics, Q: Array, acts: Behaviour) -> Array:
    found: Array = Q.mean(axis=0)
    return found


def _least(s: Dynamics, Q: Array, acts: Behaviour) -> Array:
    found: Array = Q.min(axis=0)
    return found


def _all_states(s: Dynamics, Q: Array, acts: Behaviour) -> Array:
    return np.full(Q.shape[1], Q[:, s.acted].max())


def _on_policy(s: Dynamics, Q: Array, acts: Behaviour) -> Array:
    return acts.expected(Q)


def _grows(s: Dynamics, learned: Array) -> float | None:
    """Return 0 if values are larger than any return, and than those before anything was learned."""
    bound = np.abs(s.R).max() / (1 - s.gamma) if s.gamma < 1 else np.inf
    if np.abs(learned[..., s.acted]).max() > 2 * max(bound, abs(s.initial)):
        return 0.0
    return None


def _one_pair(s: Dynamics, learned: Array) -> float:
    """Return 0 if one value alone, of several, is not what it was before anything was learned, else 1."""
    changed = learned[:, s.acted] != s.initial
    return float(not changed.sum() == 1 < changed.size)


OPERATORS = {
    "right": BellmanOperator(_right),
    "on policy": BellmanOperator(_right, reduce=_on_policy, of="q"),
    "ends ignored": BellmanOperator(_ends_ignored),
    "next episode": BellmanOperator(_next_episode),
    "limit is an end": BellmanOperator(_limit_is_end),
    "reset at the end": BellmanOperator(_reset_at_end),
    "reset at the limit": BellmanOperator(_reset_at_limit),
    "mask inverted": BellmanOperator(_mask_inverted),
    "mask late": BellmanOperator(_mask_late),
    "last reward masked": BellmanOperator(_last_reward_masked),
    "same state": BellmanOperator(_same_state),
    "mean of actions": BellmanOperator(_right, reduce=_mean, of="q"),
    "least action": BellmanOperator(_right, reduce=_least, of="q"),
    "all states": BellmanOperator(_right, reduce=_all_states, of="q"),
    "action before": BellmanOperator(_action_before, of="q"),
    "reward discounted": BellmanOperator(_reward_discounted),
    "discounted twice": BellmanOperator(_discounted_twice),
    "undiscounted": BellmanOperator(_undiscounted),
    "immediate reward": BellmanOperator(_immediate),
    "rewards clipped": BellmanOperator(_clipped),
    "signs of rewards": BellmanOperator(_signs),
    "reward negated": BellmanOperator(_negated),
    "rewards centred": BellmanOperator(_centred),
    "reward before": BellmanOperator(_reward_before),
    "reward after": BellmanOperator(_reward_after),
    "stale action": BellmanOperator(_stale_action, of="q"),
    "any action": BellmanOperator(_any_action, of="q"),
    "advantages": BellmanOperator(_advantages, of="values"),
    "grows": BellmanOperator(_right, recognise=_grows),
    "one pair": BellmanOperator(_right, of="q", recognise=_one_pair),
}
"""Operators by the name of the mistake that makes a learner apply them; the right one first."""
GOOD = ("right", "on policy")
"""Operators that are no mistake."""
