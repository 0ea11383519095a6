"""The effective horizon: how far greedy over random policy (GORP) has to look ahead, from its exact probability of success.

After C. Laidlaw, S. Russell and A. Dragan, "Bridging RL Theory and Practice with the Effective Horizon" (NeurIPS 2023). In each
step GORP(k, m) judges every sequence of k actions by the mean return of m episodes that continue at random, and takes the
first action of the best one; of tied actions, each with equal probability. The effective horizon is the least k + log_A m for
which all its actions are optimal with probability 1/2.

The returns of random episodes are multiples of one number, so that the distribution of a sum of m of them is a power of a
Fourier transform, and that of the best sequence a product of distribution functions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import small_fraction
from taskspec.base.limits import how_to_raise, limits
from taskspec.model.model import Model, refuse
from taskspec.model.transitions import Steps
from taskspec.solve.plans import outcome_table

DENOMINATOR = 1000
"""The largest denominator of a reward."""
RATE = 3e6
"""Nominal number of entries of distributions in a second."""
END = -1
"""The state after the end of an episode."""
ENOUGH = 0.5 - 1e-9
"""The probability of success, with room for rounding errors."""

Sequences = Counter[tuple[int, int, int]]
"""The number of sequences of actions by their first action, the state they lead to, and what they are paid."""


class Gorp:
    """Greedy over random policy on a deterministic task with one first state.

    Args:
        optimal: from a time to the optimal actions, bool (A, S).

    Raises:
        SpecError: E712 for other tasks, and where returns are not multiples of one number, or there are too many.
    """

    def __init__(self, model: Model, optimal: Callable[[int], Array]) -> None:
        is_drawn = Steps(model.task).reward is not model.task.process.reward
        if is_drawn or np.count_nonzero(model.start) > 1 or any(step.rounding.terms > 1 for step in model.steps):
            refuse("it is known for deterministic tasks with one first state")
        if model.horizon is None:
            refuse("episodes have no horizon")
        if model.discount != 1:
            refuse("it is known for tasks without a discount")
        self.model = model
        self.horizon = model.horizon
        self.optimal = [optimal(t) for t in range(model.horizon)]
        self.target, self.reward = self._steps()
        self.spent = 0.0

    def _steps(self) -> tuple[Array, Array]:
        """Return the next state, `END` after an end, and the reward in units, both (T, A, S)."""
        n = self.model.n_states
        shape = (len(self.model.steps), self.model.n_actions, n)
        target = np.full(shape, END)
        paid = np.zeros(shape)
        for t in range(len(self.model.steps)):
            found = outcome_table(self.model, t)
            place = (t, found.row // n, found.row % n)
            target[place] = np.where(found.ends, END, found.column)
            paid[place] = found.reward
        target[:, :, ~self.model.acting] = END
        paid[:, :, ~self.model.acting] = 0.0
        unit = _unit(np.unique(paid))
        return target, np.rint(paid / unit).astype(np.int64)

    def at(self, t: int) -> int:
        """Return the index of the dynamics at a time."""
        return t if len(self.target) > 1 else 0

    @cached_property
    def span(self) -> tuple[int, int]:
        """The least and the largest return from any time on."""
        ends = []
        for extreme in (np.min, np.max):
            value = np.zeros(self.model.n_states + 1, np.int64)  # the last one is that of `END`
            found = [0]
            for t in reversed(range(self.horizon)):
                later = self.reward[self.at(t)] + value[self.target[self.at(t)]]
                value = np.append(extreme(later, axis=0), 0)
                found.append(int(extreme(value)))
            ends.append(int(extreme(found)))
        return ends[0], ends[1]

    @cached_property
    def random(self) -> list[Array]:
        """The distributions (S + 1, W) of the returns of random actions from each time on, over `span`."""
        low, high = self.span
        width = high - low + 1
        n = self.model.n_states
        if 8 * (self.horizon + 1) * (n + 1) * width > limits().megabytes * 1e6:
            refuse("random episodes have too many different returns")
        last = np.zeros((n + 1, width))
        last[:, -low] = 1.0
        found = [last]
        for t in reversed(range(self.horizon)):
            now = np.zeros_like(last)
            now[END] = last[END]
            for target, paid in zip(self.target[self.at(t)], self.reward[self.at(t)], strict=True):
                for reward in np.unique(paid):
                    states = np.flatnonzero(paid == reward)
                    now[states] += _shifted(found[-1][target[states]], int(reward)) / self.model.n_actions
            found.append(now)
        return found[::-1]

    def sequences(self, t: int, state: int, k: int) -> Sequences:
        """Return the sequences of k actions from a state; fewer where the horizon ends them."""
        found: Sequences = Counter()
        for a in range(self.model.n_actions):
            found[a, int(self.target[self.at(t), a, state]), int(self.reward[self.at(t), a, state])] += 1
        for later in range(t + 1, min(t + k, self.horizon)):
            longer: Sequences = Counter()
            for (first, s, paid), number in found.items():
                if s == END:
                    longer[first, END, paid] += number * self.model.n_actions
                    continue
                for a in range(self.model.n_actions):
                    reward = int(self.reward[self.at(later), a, s])
                    longer[first, int(self.target[self.at(later), a, s]), paid + reward] += number
            found = longer
        return found

    def choice(self, t: int, state: int, k: int, m: int) -> Array:
        """Return the probabilities (A,) with which GORP(k, m) takes each action in a state."""
        groups = self.sequences(t, state, k)
        low, high = self.span
        size = m * (high - low) + 1
        self.spent += len(groups) * size
        if self.spent > limits().seconds * RATE:
            refuse("the sums of returns have too many different values", how_to_raise("seconds", 10 * limits().seconds))
        at_most = np.ones((self.model.n_actions, size))
        for (first, s, paid), number in groups.items():
            sums = _power(self.random[min(t + k, self.horizon)][s], m)
            at_most[first] *= np.minimum(1.0, np.cumsum(_shifted(sums, m * paid))) ** number
        below = np.concatenate([np.zeros((len(at_most), 1)), at_most[:, :-1]], axis=1)
        exactly = at_most - below
        points, weights = np.polynomial.legendre.leggauss(-(-len(at_most) // 2))
        chosen = np.zeros(len(at_most))
        for point, weight in zip((points + 1) / 2, weights / 2, strict=True):  # exact: the integrand is a polynomial
            reached = below + point * exactly
            for a in range(len(at_most)):
                chosen[a] += weight * (exactly[a] * np.delete(reached, a, axis=0).prod(axis=0)).sum()
        return chosen

    def success(self, k: int, m: int) -> float:
        """Return the probability that all actions of GORP(k, m) are optimal."""
        weight = {int(np.flatnonzero(self.model.start)[0]): 1.0}
        total = 0.0
        for t in range(self.horizon):
            following: dict[int, float] = {}
            for state, probability in weight.items():
                chosen = self.choice(t, state, k, m)
                for a in np.flatnonzero(self.optimal[t][:, state]):
                    after = int(self.target[self.at(t), a, state])
                    following[after] = following.get(after, 0.0) + probability * float(chosen[a])
            total += following.pop(END, 0.0)
            weight = following
        return total + sum(weight.values())

    def episodes(self, k: int, most: int) -> int | None:
        """Return the least m, by doubling and bisection, for which GORP(k, m) succeeds; None where that is above `most`."""
        low = 0
        high = 1
        while self.success(k, high) < ENOUGH:
            if high >= most:
                return None
            low = high
            high = min(2 * high, most)
        while high - low > 1:
            middle = (low + high) // 2
            if self.success(k, middle) < ENOUGH:
                low = middle
            else:
                high = middle
        return high

    def horizon_in_steps(self) -> float:
        """Return the least k + log_A m for which GORP(k, m) succeeds."""
        if self.model.n_actions == 1:
            refuse("there is only one action")
        least = float(self.horizon)  # all sequences of all actions, one episode each
        for k in range(1, self.horizon):
            if k >= least:
                break
            m = self.episodes(k, math.floor(self.model.n_actions ** (least - k) + 1e-9))
            if m is not None:
                least = min(least, k + math.log(m, self.model.n_actions))
        return least


def _unit(values: Iterable[float]) -> float:
    """Return the largest number that values are multiples of."""
    fractions = [small_fraction(float(value), DENOMINATOR) for value in values if value != 0]
    if None in fractions:
        refuse("rewards are not multiples of one number")
    whole = math.lcm(*(each.denominator for each in fractions if each is not None))
    return math.gcd(*(int(each * whole) for each in fractions if each is not None)) / whole or 1.0


def _shifted(rows: Array, by: int) -> Array:
    """Return distributions (..., W) of numbers that are larger by a number; what is shifted out has probability 0."""
    found = np.zeros_like(rows)
    if by >= 0:
        found[..., by:] = rows[..., : rows.shape[-1] - by]
    else:
        found[..., :by] = rows[..., -by:]
    return found


def _power(row: Array, m: int) -> Array:
    """Return the distribution of the sum of m numbers of a distribution (W,)."""
    size = m * (len(row) - 1) + 1
    return np.maximum(np.fft.irfft(np.fft.rfft(row, size) ** m, size), 0.0)
