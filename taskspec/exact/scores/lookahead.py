"""Measures of difficulty from optimal action values: how far to look ahead, gaps of worse actions, how much chance matters.

Lookahead and the effective horizon follow C. Laidlaw, S. Russell and A. Dragan, "Bridging RL Theory and Practice with the
Effective Horizon" (NeurIPS 2023): Q1 is the action value of uniformly random actions, and Q(k+1) one Bellman backup of Qk. A
task is k-QVI-solvable if every policy that is greedy for Qk is optimal.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import small_fraction
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.transitions import Steps
from taskspec.exact.solve.backward import all_values, backward
from taskspec.exact.solve.bounded import Bound, Bounded
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon
from taskspec.exact.solve.plans import outcome_table

SWEEP_RATE = 1e8
"""Nominal number of transitions per second, in all backups together."""
OVERHEAD = 20_000


class _Lookahead:
    """Value functions V[t] (S,) for t = 0 to T, and the action values that follow from them."""

    def __init__(self, model: Model) -> None:
        if model.horizon is None:
            refuse("episodes have no horizon")
        self.model = model
        self.horizon = model.horizon
        self.numbers = Bounded(model)
        if 3 * 16 * (self.horizon + 1) * model.n_states > limits().megabytes * 1e6:
            refuse("the values at every time do not fit into memory")
        self.spent = 0.0

    @cached_property
    def random(self) -> list[Bound]:
        """The value functions V[t] of random actions, for t = 0 to T."""
        return self._values(lambda q: self.numbers.follow(self.numbers.uniform, q))

    @cached_property
    def best(self) -> list[Bound]:
        """The optimal value functions V*[t], for t = 0 to T."""
        return self._values(self.numbers.top)

    def _values(self, choose: Any) -> list[Bound]:
        end = self.numbers.zero()
        return [*all_values(backward(self.q, lambda t, q: choose(q), end, self.horizon)), end]

    def q(self, t: int, later: Bound) -> Bound:
        """Return the action values Q[t] (A, S) from V[t + 1]."""
        seconds = limits().seconds
        self.spent += (self.model.entries / len(self.model.steps) + OVERHEAD) / SWEEP_RATE
        if self.spent > seconds:
            refuse(f"lookahead takes more than {seconds} seconds", how_to_raise("seconds", 10 * seconds))
        return self.numbers.backup(t, later)

    def rounds(self) -> Iterator[tuple[int, list[Bound]]]:
        """Yield k and the value functions V[t] for t = 0 to T from which Qk is backed up."""
        values = self.random
        for k in range(1, self.horizon + 1):
            yield k, values
            values = [self.numbers.top(self.q(t, values[t + 1])) for t in range(self.horizon)]
            values.append(self.numbers.zero())

    def optimal(self, t: int) -> Array:
        """Return which actions bool (A, S) are optimal at a time."""
        return np.asarray(self.numbers.greedy(self.q(t, self.best[t + 1])).table > 0)

    def onwards(self, t: int, states: Array, taken: Array) -> Array:
        """Return the states bool (S,) that some actions bool (A, S) lead to from some states bool (S,)."""
        rows = (taken & states).reshape(-1).astype(np.float64)
        return np.asarray(self.model.step(t).P.T @ rows > 0)

    def is_solved(self, values: list[Bound]) -> bool:
        """Return whether every policy that is greedy for Qk is optimal."""
        states = self.model.start > 0
        for t in range(self.horizon):
            taken = self.numbers.greedy(self.q(t, values[t + 1])).table > 0
            if (taken & states & ~self.optimal(t)).any():
                return False
            states = self.onwards(t, states, taken)
        return True


def action_gaps(model: Model) -> Array:
    """Return the gaps (N,) V*[t, s] - Q*[t, s, a] of all actions that are not optimal, in all states that episodes act in."""
    gaps = []
    for acting, numbers, q in _optimal_action_values(model):
        worse = acting & (numbers.greedy(q).table == 0)
        if model.legal is not None:
            worse &= model.legal
        gap = numbers.top(q).value - q.value
        gaps.append(gap[worse])
    all_gaps = np.concatenate(gaps)
    if not len(all_gaps):
        refuse("every action is optimal")
    return all_gaps


def _optimal_action_values(model: Model) -> Iterator[tuple[Array, Bounded, Bound]]:
    """Yield, for each time, the states (S,) in which episodes act, the arithmetic, and Q* (A, S) in it."""
    if model.horizon is None:
        numbers = InfiniteHorizon(model)
        yield model.acting, numbers, numbers.q_values()
        return
    plan = _Lookahead(model)
    for t, acting in model.levels():
        yield acting, plan.numbers, plan.q(t, plan.best[t + 1])


def value_norm(model: Model) -> float:
    """Return the largest standard deviation of the optimal value of the next state, over states and actions of all times."""
    plan = _Lookahead(model)
    largest = 0.0
    for t, acting in model.levels():
        V = plan.best[t + 1].value
        P = model.step(t).P
        spread = P @ V**2 - (P @ V) ** 2
        variance = model.among_legal(spread.reshape(model.n_actions, model.n_states), 0.0)[:, acting]
        largest = max(largest, float(variance.max()))
    return math.sqrt(largest)


def least_lookahead(model: Model) -> int:
    """Return the least k for which every policy that is greedy for Qk is optimal."""
    ahead = _Lookahead(model)
    return next((k for k, values in ahead.rounds() if ahead.is_solved(values)), ahead.horizon)


def effective_horizon(model: Model) -> float:
    """Return the effective horizon of a deterministic task."""
    return Gorp(model, _Lookahead(model).optimal).horizon_in_steps()


# -- the effective horizon --------------------------------------------------------------------------------------------
#
# Greedy over random policy, GORP(k, m), judges in each step every sequence of k actions by the mean return of m episodes that
# continue at random, and takes the first action of the best one; of tied actions, each with equal probability. The effective
# horizon is the least k + log_A m for which all its actions are optimal with probability 1/2.
#
# The returns of random episodes are multiples of one number, so that the distribution of a sum of m of them is a power of a
# Fourier transform, and the distribution of the best sequence a product of distribution functions.

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
        n = self.model.n_states
        shape = (len(self.model.steps), self.model.n_actions, n)
        target = np.full(shape, END)
        paid = np.zeros(shape)
        for t in range(len(self.model.steps)):
            table = outcome_table(self.model, t)
            place = (t, table.row // n, table.row % n)
            target[place] = np.where(table.ends, END, table.column)
            paid[place] = table.reward
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
            value = np.zeros(self.model.n_states + 1, np.int64)  # the last one belongs to `END`
            depths = [0]
            for t in reversed(range(self.horizon)):
                later = self.reward[self.at(t)] + value[self.target[self.at(t)]]
                value = np.append(extreme(later, axis=0), 0)
                depths.append(int(extreme(value)))
            ends.append(int(extreme(depths)))
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
        levels = [last]
        for t in reversed(range(self.horizon)):
            now = np.zeros_like(last)
            now[END] = last[END]
            for target, paid in zip(self.target[self.at(t)], self.reward[self.at(t)], strict=True):
                for reward in np.unique(paid):
                    states = np.flatnonzero(paid == reward)
                    now[states] += _shifted(levels[-1][target[states]], int(reward)) / self.model.n_actions
            levels.append(now)
        return levels[::-1]

    def sequences(self, t: int, state: int, k: int) -> Sequences:
        """Return the sequences of k actions from a state; fewer where the horizon ends them."""
        counted: Sequences = Counter()
        for a in range(self.model.n_actions):
            counted[a, int(self.target[self.at(t), a, state]), int(self.reward[self.at(t), a, state])] += 1
        for later in range(t + 1, min(t + k, self.horizon)):
            longer: Sequences = Counter()
            for (first, s, paid), number in counted.items():
                if s == END:
                    longer[first, END, paid] += number * self.model.n_actions
                    continue
                for a in range(self.model.n_actions):
                    reward = int(self.reward[self.at(later), a, s])
                    longer[first, int(self.target[self.at(later), a, s]), paid + reward] += number
            counted = longer
        return counted

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
            row = self.random[min(t + k, self.horizon)][s]
            length = m * (len(row) - 1) + 1
            sums = np.maximum(np.fft.irfft(np.fft.rfft(row, length) ** m, length), 0.0)
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
    fractions = [small_fraction(float(value), DENOMINATOR) for value in values if value != 0]
    if None in fractions:
        refuse("rewards are not multiples of one number")
    whole = math.lcm(*(each.denominator for each in fractions if each is not None))
    return math.gcd(*(int(each * whole) for each in fractions if each is not None)) / whole or 1.0


def _shifted(rows: Array, by: int) -> Array:
    """Return distributions (..., W) of numbers that are larger by a number; what is shifted out has probability 0."""
    shifted = np.zeros_like(rows)
    if by >= 0:
        shifted[..., by:] = rows[..., : rows.shape[-1] - by]
    else:
        shifted[..., :by] = rows[..., -by:]
    return shifted
