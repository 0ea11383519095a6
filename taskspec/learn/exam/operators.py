"""Bellman operators: the right one, and those that learners with a mistake apply, on the exact model of a finite task.

Symbols: P[a, s, s'] is the probability that the episode goes on in s', P_end[a, s, s'] that it ends there, R[a, s] the expected
reward, V(s) = max over a of Q(s, a) unless an operator says otherwise; for the critic of an actor, V(s) is the mean of Q(s, a)
under its policy.

A fixed point fits all values of a task or none: it has no number of its own that is free. A recogniser may have some; how much it
explains is counted without these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from taskspec.base.arrays import Array
from taskspec.learn.exam.dynamics import EXPLORATIONS, Behaviour, Dynamics, EpsilonGreedy

TRACE = 0.95
"""The weight of later errors in advantages that is assumed."""
APART = 0.15
"""Values that differ by more than this share of their spread are told apart."""
MOVED = 0.1
"""Values that differ by more than this share of what they should have moved."""
BEYOND = 10
"""Values that are so many times larger than the most that can be earned have grown; a few rewards too many are not enough."""
FRESH = 0.3
"""The size of the values of a network before anything is learned, at most."""
DRIFTED, ASIDE = 0.6, 2
"""The size of values that are moved by what else the network learns, at most, and how many times larger they are than what they
have of right ones."""
MULTIPLE = 0.7
"""The share of the size of values that a multiple of right ones has, from which they are trained."""
FAR = 5
"""Right values that are so many times larger than this are too far to be taken for fresh ones."""
SCALED = 1.5
"""Values are taken for a multiple of right ones from this factor on."""
FEWEST = 3
"""Values that a mistake has to explain, at least, to be named."""


class Fit(NamedTuple):
    """Distance of learned values from a mistake, and the number of values in which it differs from right ones."""

    distance: float
    values: int


@dataclass(frozen=True)
class BellmanOperator:
    """A Bellman operator: Q = reward + gamma * ahead, unless `backup` says otherwise.

    Attributes:
        reward: of each step, (A, S).
        ahead: the value of what follows each step, (A, S), from V (S,).
        backup: from Q (A, S) and V to the next Q.
        reduce: from Q to V, where this is part of the mistake.
        of: whether it is about Q-values, or the values of a critic; of both if None.
        recognise: how learned values (A, S), or (S,), fit, where the mistake has no fixed point, from what the learner does,
            these and the right ones, of the greedy policy first; None if they say nothing.
        free: numbers of a task that the fit chooses.
        vague: whether many mistakes lead to it, so that any other that explains the values says more.
        varies: whether each run has an outcome of its own, so that runs add values that differ.
    """

    reward: Callable[[Dynamics, Behaviour], Array] = lambda s, acts: s.R
    ahead: Callable[[Dynamics, Behaviour, Array], Array] = lambda s, acts, V: s.following(V)
    backup: Callable[[Dynamics, Behaviour, Array, Array], Array] | None = None
    reduce: Callable[[Dynamics, Behaviour, Array], Array] | None = None
    of: Literal["q", "values"] | None = None
    recognise: Callable[[Dynamics, Behaviour, Array, Sequence[Array]], Fit | None] | None = None
    free: int = 0
    vague: bool = False
    varies: bool = False

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


def _until_limit(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the mean return until the limit after each step, in the mean over the times at which a state is visited."""
    return _mean_returns(s, acts, V, 1.0)


def _mask_early(s: Dynamics, acts: Behaviour, V: Array) -> Array:
    ends_next = acts.expected(1 - s.going_on)
    ends_first = s.first(ends_next)
    within = (1 - acts.last) * s.following((1 - ends_next) * V)
    across = acts.last * s.following(V) + s.ending(V)
    found: Array = within + (1 - ends_first) * across
    return found


def _limit_twice(s: Dynamics, acts: Behaviour, V: Array) -> Array:
    return (1 + acts.last) * s.following(V)


def _from_the_start(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the mean return after each step, discounted from the first step of the episode on."""
    return _mean_returns(s, acts, V, s.gamma)


def _whole_return(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the mean return of the episodes in which each step is taken, from their first step to their last."""
    later = _mean_returns(s, acts, V, s.gamma)
    if s.model.horizon is None:
        return later
    earlier = acts.so_far(s.gamma).sum(axis=0)
    return later + np.divide(earlier, acts.total, out=np.zeros_like(earlier), where=acts.total > 0)


def _mean_returns(s: Dynamics, acts: Behaviour, V: Array, factor: float) -> Array:
    """Return the mean (A, S) of returns until the limit, times factor**t at time t; right targets without a limit."""
    if s.model.horizon is None:
        return s.R + s.gamma * s.following(V)
    summed = np.zeros_like(s.R)
    left = np.zeros_like(V)
    for t in reversed(range(len(acts.counts))):
        returns = s.R + s.gamma * s.expected(s.P, left)
        summed += factor**t * acts.counts[t] * returns
        left = acts.expected(returns)
    return _per_visit(s, summed, acts.total)


def _per_visit(s: Dynamics, summed: Array, visits: Array) -> Array:
    """Return sums (A, S) by the visits, (S,) or (A, S); the value before anything is learned where there are none."""
    mean: Array = np.divide(summed, visits, out=np.full_like(s.R, s.initial), where=visits > 0)
    return mean


def _rewards_added(s: Dynamics, acts: Behaviour) -> Array:
    if s.model.horizon is None:
        return s.R
    earlier = acts.so_far(1.0).sum(axis=0)
    return s.R + np.divide(earlier, acts.total, out=np.zeros_like(earlier), where=acts.total > 0)


def _standardised(s: Dynamics, acts: Behaviour) -> Array:
    centred = s.R - acts.mean_reward
    if acts.deviation == 0:
        return centred
    return centred / acts.deviation


def _ends_punished(s: Dynamics, acts: Behaviour) -> Array:
    goes_on = (1 - acts.last) * s.going_on
    return (1 - acts.last) * s.changed["unfinished"] - (1 - goes_on)


def _batch_mean(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    targets = s.R + s.gamma * s.following(V)
    return np.full_like(Q, (acts.rates * targets).sum())


def _overwritten(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the targets of steps whose observation is the one that they lead to."""
    steps = acts.pi * acts.total
    going_on = acts.arriving(s.P, steps)
    arrivals = going_on
    paid = acts.arriving(s.P, steps * s.R)
    if s.P_end is not None:
        arrivals = arrivals + acts.arriving(s.P_end, steps)
        paid = paid + acts.arriving(s.P_end, steps * s.R)
    summed = paid + going_on * s.gamma * s.learned(V)
    return _per_visit(s, summed, arrivals)


def _start_unseen(s: Dynamics, acts: Behaviour, Q: Array, V: Array) -> Array:
    """Return the targets of a learner that takes the last state of an episode for the first one of the next."""
    right = s.R + s.gamma * s.following(V)
    of_first = (right @ s.model.start)[:, None]
    seen = acts.total - acts.counts[0]
    taken = acts.last_states
    visits = seen + taken
    mixed = seen * right + taken * of_first
    return _per_visit(s, mixed, visits)


# -- mistakes without a fixed point, recognised by the values alone ---------------------------------------------------


def _grows(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
    values = learned[..., s.acted]
    beyond = int((np.abs(values) > BEYOND * max(s.most, abs(s.initial))).sum())
    if beyond == 0:
        return None
    _, rest = _multiple(values, rights[0][..., s.acted])
    if rest <= APART:
        return None
    return Fit(0.0, beyond)


def _scaled(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
    """Compare values with the nearest multiple of right ones, which is more than `SCALED` times as large, or as small."""
    fits = []
    for right in rights:
        shown = right[..., s.acted]
        values = learned[..., s.acted]
        scale, rest = _multiple(values, shown)
        spread = float(shown.std())
        if scale > 0 and abs(np.log(scale)) > np.log(SCALED) and spread > 0:
            apart = rest * float(np.sqrt(((values / scale) ** 2).mean())) / spread
            fits.append(Fit(min(1.0, apart), shown.size))
    return min(fits, default=None)


def _weighed(name: Literal["ahead", "shift"]) -> Callable[[Dynamics, Behaviour, Array, Sequence[Array]], Fit | None]:
    """Return a recogniser of what follows that is weighed by another factor, or of a constant that is added to each reward.

    Learned values less rewards and what follows are compared with the multiple of either that fits best: the share of them that
    it leaves. It says nothing where a multiple of the other one, or of rewards, leaves as little.
    """

    def recognise(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
        right = rights[0][..., s.acted]
        size = APART * (float(right.std()) or float(np.abs(right).max()))
        fits = []
        for paid, following in _parts(s, acts, learned):
            terms = {"ahead": following[..., s.acted], "shift": np.ones_like(right), "paid": paid[..., s.acted]}
            left = learned[..., s.acted] - terms["paid"] - s.gamma * terms["ahead"]
            shares = {term: _multiple(left, each)[1] for term, each in terms.items()}
            told = int((np.abs(left) >= size).sum())
            own = shares.pop(name)
            if told > 1 and own <= min(shares.values()) / 2:
                fits.append(Fit(own, told))
        return min(fits, default=None)

    return recognise


def _parts(s: Dynamics, acts: Behaviour, learned: Array) -> list[tuple[Array, Array]]:
    """Return rewards and what follows, (S,) of a critic, or (A, S) for several shares of random actions."""
    if learned.ndim == 1:
        return [(acts.expected(s.R), acts.expected(s.following(learned)))]
    policies = [EpsilonGreedy(share)(learned) for share in (0.0, *EXPLORATIONS)]
    return [(s.R, s.following((pi * learned).sum(axis=0))) for pi in policies]


def _multiple(values: Array, right: Array) -> tuple[float, float]:
    """Return the factor by which right values are nearest to others, and the difference as a share of the size of these."""
    largest = float(np.abs(values).max())
    squared = float((right**2).sum())
    if squared == 0 or largest == 0:
        return 0.0, 1.0
    shape = values / largest
    factor = float((shape * right).sum()) / squared
    rest = float(((shape - factor * right) ** 2).sum() / (shape**2).sum())
    return factor * largest, float(np.sqrt(rest))


def _one_pair(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
    right = rights[0]
    paid = int((np.abs(right[:, s.acted] - s.initial) > APART * np.abs(right).max()).sum())
    if paid < FEWEST:
        return None
    changed = learned[:, s.acted] != s.initial
    return Fit(float(changed.sum() != 1), paid)


def _untrained(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
    """Compare values with those of a fresh network, which are small, or moved by what else is learned: away from right ones, or
    aside. Values that move towards right ones, or are a small multiple of them, are trained, however slowly.
    """
    right = rights[0][..., s.acted]
    squared = float((right**2).sum())
    if squared == 0:
        return None
    values = learned[..., s.acted] - s.initial
    likeness = float((values * right).sum()) / squared
    size = float(np.sqrt((values**2).mean()))
    of_right = float(np.sqrt((right**2).mean()))
    is_aside = likeness < 0 or size >= ASIDE * likeness * of_right
    limit = DRIFTED if is_aside else FRESH
    is_multiple = likeness * of_right > MULTIPLE * size
    if likeness > 0.5 or size > limit or is_multiple:
        return Fit(1.0, values.size)
    if values.any() and of_right < FAR * FRESH:
        return None
    return Fit(min(1.0, abs(likeness)), values.size)


def _one_outcome(s: Dynamics, acts: Behaviour, learned: Array, rights: Sequence[Array]) -> Fit | None:
    """Compare values after chance with the value of one outcome: how near the nearest is, where half of their range is 1.

    What follows is worth what was learned, so that mistakes do not add up on the way. Values of steps with one outcome have to be
    right.
    """
    V = s.learned(learned.max(axis=0))
    size = APART * float(np.ptp(rights[0][:, s.acted]))
    apart = []
    certain = []
    for a, state in zip(*np.nonzero(np.broadcast_to(s.acted, learned.shape)), strict=True):
        row = s.row(s.P, a, state)
        outcomes = list(s.R[a, state] + s.gamma * V[row > 0])
        if s.going_on[a, state] < 1 - 1e-9:
            outcomes.append(s.R[a, state])
        if np.ptp(outcomes) > size:
            nearest = np.abs(np.array(outcomes) - learned[a, state]).min()
            apart.append(min(1.0, nearest / (np.ptp(outcomes) / 2)))
        else:
            certain.append(abs(np.mean(outcomes) - learned[a, state]))
    if not apart:
        return None
    if certain and float(np.mean(certain)) > size:
        return Fit(1.0, len(apart))
    return Fit(float(np.sqrt(np.mean(np.square(apart)))), len(apart))


OPERATORS = {
    "right": BellmanOperator(),
    "on policy": BellmanOperator(reduce=lambda s, acts, Q: acts.expected(Q), of="q"),
    "until the limit": BellmanOperator(backup=_until_limit),
    # -- ends and limits
    "ends ignored": BellmanOperator(ahead=lambda s, acts, V: s.following(V) + s.ending(V)),
    "next episode": BellmanOperator(ahead=_next_episode),
    "limit is an end": BellmanOperator(ahead=lambda s, acts, V: (1 - acts.last) * s.following(V)),
    "end at the limit": BellmanOperator(ahead=lambda s, acts, V: s.following(V) + acts.last * s.ending(V)),
    "flags exchanged": BellmanOperator(ahead=lambda s, acts, V: (1 - acts.last) * (s.following(V) + s.ending(V))),
    "reset at the end": BellmanOperator(ahead=lambda s, acts, V: s.following(V) + s.first(V) * (1 - s.going_on)),
    "limit counted twice": BellmanOperator(ahead=_limit_twice),
    "reset at the limit": BellmanOperator(ahead=_reset_at_limit),
    "mask inverted": BellmanOperator(ahead=lambda s, acts, V: s.ending(V)),
    "mask late": BellmanOperator(ahead=lambda s, acts, V: (1 - acts.after_end) * (s.following(V) + s.ending(V))),
    "mask early": BellmanOperator(ahead=_mask_early),
    "start unseen": BellmanOperator(backup=_start_unseen),
    "last reward masked": BellmanOperator(reward=lambda s, acts: s.changed["unfinished"]),
    # -- what follows
    "same state": BellmanOperator(ahead=lambda s, acts, V: s.going_on * V),
    "mean of actions": BellmanOperator(reduce=lambda s, acts, Q: Q.mean(axis=0), of="q"),
    "least action": BellmanOperator(reduce=lambda s, acts, Q: Q.min(axis=0), of="q"),
    "soft maximum": BellmanOperator(reduce=lambda s, acts, Q: np.logaddexp.reduce(Q, axis=0), of="q"),
    "all states": BellmanOperator(reduce=lambda s, acts, Q: np.full(Q.shape[1], Q[:, s.acted].max()), of="q"),
    "action before": BellmanOperator(backup=_action_before, of="q"),
    # -- discounts
    "reward discounted": BellmanOperator(reward=lambda s, acts: s.gamma * s.R),
    "discounted twice": BellmanOperator(ahead=lambda s, acts, V: s.gamma * s.following(V)),
    "undiscounted": BellmanOperator(backup=lambda s, acts, Q, V: s.R + s.following(V)),
    "discounted from the start": BellmanOperator(backup=_from_the_start),
    "another discount": BellmanOperator(recognise=_weighed("ahead"), free=1, vague=True),
    "immediate reward": BellmanOperator(ahead=lambda s, acts, V: np.zeros_like(s.R)),
    # -- rewards
    "rewards clipped": BellmanOperator(reward=lambda s, acts: s.changed["clipped"]),
    "rewards squashed": BellmanOperator(reward=lambda s, acts: s.changed["squashed"]),
    "whole rewards": BellmanOperator(reward=lambda s, acts: s.changed["whole"]),
    "rewards scaled": BellmanOperator(recognise=_scaled, free=1),
    "signs of rewards": BellmanOperator(reward=lambda s, acts: s.changed["signs"]),
    "reward negated": BellmanOperator(reward=lambda s, acts: -s.R),
    "rewards centred": BellmanOperator(reward=lambda s, acts: s.R - acts.mean_reward),
    "rewards shifted": BellmanOperator(recognise=_weighed("shift"), free=1, vague=True),
    "rewards standardised": BellmanOperator(reward=_standardised),
    "rewards added up": BellmanOperator(reward=_rewards_added),
    "return of the episode": BellmanOperator(backup=_whole_return),
    "ends punished": BellmanOperator(reward=_ends_punished),
    "reward before": BellmanOperator(reward=lambda s, acts: np.broadcast_to(acts.reward_before, s.R.shape)),
    "reward after": BellmanOperator(reward=lambda s, acts: acts.reward_after),
    # -- what is updated
    "stale action": BellmanOperator(backup=_stale_action, of="q"),
    "any action": BellmanOperator(backup=_any_action, of="q"),
    "mean of the batch": BellmanOperator(backup=_batch_mean),
    "observation overwritten": BellmanOperator(backup=_overwritten),
    "never negative": BellmanOperator(backup=lambda s, acts, Q, V: np.maximum(s.R + s.gamma * s.following(V), 0)),
    "kept within one": BellmanOperator(backup=lambda s, acts, Q, V: np.clip(s.R + s.gamma * s.following(V), -1, 1)),
    "advantages": BellmanOperator(backup=_advantages, of="values"),
    "grows": BellmanOperator(recognise=_grows, vague=True),
    "one pair": BellmanOperator(of="q", recognise=_one_pair, free=1),
    "untrained": BellmanOperator(recognise=_untrained),
    "one outcome": BellmanOperator(of="q", recognise=_one_outcome, varies=True),
}
"""Operators by the name of the mistake that makes a learner apply them; the right one first."""
GOOD = ("right", "on policy", "until the limit")
"""Operators that are no mistake."""
