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
    """A Bellman operator, and the mistake that makes a learner apply it.

    Attributes:
        backup: from Q and V to the next Q.
        mistake: a sentence that follows "your values are those of a learner".
        code: what such code usually looks like.
        fix: what to do.
        reduce: the reduction of Q to V, where it is part of the mistake.
        of: whether it is about Q-values, or the values of a critic; of both if None.
        recognise: the distance of learned values (A, S), or (S,), where the mistake has no fixed point; None if they say nothing.
    """

    name: str
    backup: Backup
    mistake: str
    code: str
    fix: str
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
    operator.name: operator
    for operator in (
        BellmanOperator("right", _right, "without a mistake in its targets", "r + gamma * (1 - terminated) * V(s')", ""),
        BellmanOperator(
            "on policy", _right, "that learns the values of what it does, exploration included (SARSA)",
            "target = r + gamma * Q(s', a')", "Nothing, if that is meant; else take the maximum over actions.", _on_policy,
            "q",
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
            "reset at the end", _reset_at_end, "for which an episode that ended by itself continues with the next one",
            "next_obs taken after the environment was reset, where it is terminated", "Multiply V(s') by (1 - terminated).",
        ),
        BellmanOperator(
            "reset at the limit", _reset_at_limit, "for which an episode that was cut off continues with the next one",
            "next_obs taken after the environment was reset, masked by terminated",
            "Take the last observation of the episode (final_obs).",
        ),
        BellmanOperator(
            "mask inverted", _mask_inverted, "that bootstraps at the ends of episodes alone",
            "gamma * terminated * V(s')", "Multiply V(s') by (1 - terminated).",
        ),
        BellmanOperator(
            "mask late", _mask_late, "whose mask is that of the step before",
            "dones[t - 1] beside obs[t]", "Store the flag of a step with the observation that the step left.",
        ),
        BellmanOperator(
            "last reward masked", _last_reward_masked, "that masks the reward of the last step, too",
            "(r + gamma * V(s')) * (1 - terminated)", "Move the parenthesis: r + gamma * (1 - terminated) * V(s').",
        ),
        BellmanOperator(
            "same state", _same_state, "that takes the state it left for the one it reached",
            "next_obs = obs, or a buffer that shares memory", "Store the observation that step() returned, as a copy.",
        ),
        BellmanOperator(
            "mean of actions", _right, "that averages over the next actions instead of choosing the best",
            "q(s').mean(axis=-1)", "Take the maximum over actions.", _mean, "q",
        ),
        BellmanOperator(
            "least action", _right, "that expects the worst of the next actions",
            "q(s').min(axis=-1), or a minimum over the wrong axis", "Take the maximum over actions.", _least, "q",
        ),
        BellmanOperator(
            "all states", _right, "that takes the best value of any state for the next one",
            "q.max() without an axis", "Take the maximum over the axis of actions.", _all_states, "q",
        ),
        BellmanOperator(
            "action before", _action_before, "that looks up the next state with the action that was just taken",
            "q[s', a]", "Update the action before the look-up, or take the maximum.",
            of="q",
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
            "target = r, gamma = 0, or a target network that stays as it was",
            "Add gamma * V(s'); copy the target network now and then.",
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
        BellmanOperator(
            "rewards centred", _centred, "whose rewards have their mean subtracted", "r - r.mean()",
            "Divide by a deviation, if anything: the mean makes ends better or worse.",
        ),
        BellmanOperator(
            "reward before", _reward_before, "that gets the reward of the step before", "rewards[t - 1] beside obs[t]",
            "Store each reward with the observation and the action that it was paid for.",
        ),
        BellmanOperator(
            "reward after", _reward_after, "that gets the reward of the step after", "rewards[t + 1] beside obs[t]",
            "Store each reward with the observation and the action that it was paid for.",
        ),
        BellmanOperator(
            "stale action", _stale_action, "that learns about the action of the step before", "actions[t - 1] beside obs[t]",
            "Store each action with the observation that it was chosen for.", of="q",
        ),
        BellmanOperator(
            "any action", _any_action, "that learns about all actions what it sees of one", "q[s] += rate * error",
            "Update q[s, a], of the action that was taken.", of="q",
        ),
        BellmanOperator(
            "advantages", _advantages, "whose critic learns advantages in place of returns", "value_loss of advantages",
            "Train the critic on returns = advantages + values.", of="values",
        ),
        BellmanOperator(
            "grows", _right, "whose values grow past everything that can be earned",
            "q -= rate * error, q[s'] += rate * error, or advantages that are not cut where an episode ends",
            "Add the error to the value of the state that was left; cut advantages; then try a smaller step.", recognise=_grows,
        ),
        BellmanOperator(
            "one pair", _right, "that learned about one state and one action alone", "buffer[0] in each batch",
            "Sample all transitions that are stored.", of="q", recognise=_one_pair,
        ),
    )
}  # fmt: skip
"""Operators by name: the right one first, then those of mistakes."""
GOOD = ("right", "on policy")
"""Operators that are no mistake."""
