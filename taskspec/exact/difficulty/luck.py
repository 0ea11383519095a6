"""What random actions come to by luck: the chance of a best episode, and that of any reward at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.difficulty.chances import RandomSteps, StepOutcomes
from taskspec.exact.model.failure import refuse, scipy_sparse
from taskspec.exact.model.model import Model
from taskspec.exact.planning.certified.chains import Chain
from taskspec.exact.planning.certified.components import leading_to
from taskspec.exact.planning.solve import best
from taskspec.limits import how_to_raise, limits
from taskspec.solve.backward import all_values, backward, first_values

Array = np.ndarray[Any, Any]
RATE = 2_000_000
"""Outcomes of pairs of a state and a return so far that are gone through in a second, nominally."""
CLOSE = 1e-9
"""By how much of the largest return one may miss the best and still be as good."""
GRAIN = 2.0**-40


def reward_chance(model: Model) -> float:
    """The probability that an episode of random actions is ever paid a reward other than 0."""
    steps = RandomSteps(model)
    if model.horizon is None:
        return float(model.start @ _ever_paid(model, steps.at(0)))

    def backup(t: int, later: Array) -> Array:
        return _paid(steps.at(t), model.n_states, later)

    chance = first_values(backward(backup, lambda t, chance: chance, np.zeros(model.n_states), model.horizon))
    return float(model.start @ chance)


def _paid(found: StepOutcomes, states: int, later: Array) -> Array:
    """The chance (S,) of a reward now, or else of one after this step."""
    hit = np.where(found.reward != 0, 1.0, np.where(found.ends, 0.0, later[found.target]))
    return np.bincount(found.state, found.weight * hit, states)


def _ever_paid(model: Model, found: StepOutcomes) -> Array:
    """The chance (S,) of a reward at some time, without a horizon."""
    n = model.n_states
    unpaid = (found.reward == 0) & ~found.ends
    entries = (found.weight[unpaid], (found.state[unpaid], found.target[unpaid]))
    matrix = scipy_sparse().csr_array(entries, shape=(n, n))
    now = _paid(found, n, np.zeros(n))
    return Chain(matrix, lambda x: x, leading_to(matrix, now > 0)).solved(now)


# -- the chance of a best episode -------------------------------------------------------------------------------------


def best_chance(model: Model) -> float:
    """The probability that the return of random actions is at least what the optimal policy expects from the same first state."""
    if model.horizon is None:
        refuse("episodes have no horizon")
    return _Trials(model, model.horizon).chance()


class _Trials:
    """Random episodes, as states with what is still missing to the best return, alike ones together.

    What is missing is counted in whole grains of the largest possible return, so that sums in whatever order are equal.
    A state is followed no further once whatever happens decides: `most` and `least`, (S,) for each time, are the largest and the
    smallest return that anything may still bring.
    """

    def __init__(self, model: Model, horizon: int) -> None:
        self.model, self.horizon, self.steps = model, horizon, RandomSteps(model)
        if 2 * (horizon + 1) * model.n_states * 8 > limits().megabytes * 1e6:
            refuse("what may still be earned at every time does not fit into memory")
        self.most = self._extremes(np.maximum)
        self.least = self._extremes(np.minimum)
        self.wanted = best(model).value
        largest = max(float(np.abs(x).max()) for x in (*self.most, *self.least, self.wanted))
        self.grain = GRAIN * 2.0 ** np.ceil(np.log2(max(largest, 1e-300)))
        self.slack = CLOSE * largest + horizon * self.grain
        self.spent = 0

    def _extremes(self, extreme: np.ufunc) -> list[Array]:
        """Return the largest or smallest return (S,) that anything may still bring, at each time."""

        def backup(t: int, value: Array) -> Array:
            """Return the return (N,) of each outcome."""
            found = self.steps.at(t)
            later = np.where(found.ends, 0.0, value[found.target])
            return np.asarray(found.reward + self.model.discount * later)

        def choose(t: int, outcomes: Array) -> Array:
            first = self.steps.at(t).first
            acting = np.flatnonzero(first[1:] > first[:-1])
            value = np.zeros(self.model.n_states)
            value[acting] = extreme.reduceat(outcomes, first[acting])
            return value

        return all_values(backward(backup, choose, np.zeros(self.model.n_states), self.horizon))

    def chance(self) -> float:
        state = np.flatnonzero(self.model.start)
        missing, weight = self._grains(self.wanted[state]), self.model.start[state]
        total, factor = 0.0, 1.0
        for t in range(self.horizon):
            off = missing * self.grain
            sure = off <= factor * self.least[t][state] + self.slack
            total += float(weight[sure].sum())
            open_ = ~sure & (off <= factor * self.most[t][state] + self.slack)
            state, missing, weight, done = self._stepped(t, factor, state[open_], missing[open_], weight[open_])
            total += done
            factor *= self.model.discount
        return total + float(weight[missing * self.grain <= self.slack].sum())

    def _grains(self, value: Array) -> Array:
        return np.asarray(np.rint(value / self.grain), np.int64)

    def _stepped(
        self, t: int, factor: float, state: Array, missing: Array, weight: Array
    ) -> tuple[Array, Array, Array, float]:
        """States, what is missing, and probabilities after a step, and the probability of a best episode that it ends."""
        found = self.steps.at(t)
        counts = found.first[state + 1] - found.first[state]
        self._spend(int(counts.sum()))
        owner = np.repeat(np.arange(len(state)), counts)
        entry = np.arange(len(owner)) + np.repeat(found.first[state] - np.cumsum(counts) + counts, counts)
        missing = missing[owner] - self._grains(factor * found.reward[entry])
        weight = weight[owner] * found.weight[entry]
        ends = found.ends[entry]
        done = float(weight[ends & (missing * self.grain <= self.slack)].sum())
        return (*_merged(found.target[entry][~ends], missing[~ends], weight[~ends]), done)

    def _spend(self, outcomes: int) -> None:
        self.spent += outcomes
        if self.spent > limits().seconds * RATE:
            refuse("random episodes have too many different returns", how_to_raise("seconds", 10 * limits().seconds))


def _merged(state: Array, missing: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Alike ones together."""
    if not len(state):
        return state, missing, weight
    order = np.lexsort((missing, state))
    state, missing = state[order], missing[order]
    new = np.ones(len(state), np.bool_)
    new[1:] = (state[1:] != state[:-1]) | (missing[1:] != missing[:-1])
    at = np.flatnonzero(new)
    return state[at], missing[at], np.add.reduceat(weight[order], at)
