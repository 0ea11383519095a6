"""What random actions achieve: probability of a best episode, and expected lengths of episodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.model.model import Model, Step, refuse, scipy_sparse
from taskspec.model.transitions import Steps
from taskspec.solve.backward import Plan, action_values, all_values, backward, first_values
from taskspec.solve.infinite_horizon import chain_values, fixed_point, leading_to
from taskspec.solve.plans import optimal_plan, outcome_table
from taskspec.solve.solve import best, policy_return

# -- lengths: expected returns of the same model with a reward of 1 for each step -------------------------------------


def mean_length(model: Model, plan: Plan) -> float:
    """Return the expected number of steps of an episode under a policy."""
    if model.horizon is not None and all(step.P_end is None for step in model.steps):
        return model.horizon
    steps = {id(step): _with_reward(step, np.ones_like(step.R)) for step in model.steps}
    return policy_return(undiscounted(model, tuple(steps[id(step)] for step in model.steps)), plan)


def _with_reward(step: Step, reward: Array) -> Step:
    return replace(
        step, R=reward, rounding=replace(step.rounding, lowest=float(reward.min()), highest=float(reward.max()))
    )


def undiscounted(model: Model, steps: tuple[Step, ...]) -> Model:
    """Return the model with other steps, without a discount."""
    return replace(model, task=replace(model.task, discount=1.0), steps=steps)


def solution_length(model: Model) -> float:
    """Return the least expected number of steps in which an optimal policy reaches a state without further rewards."""
    plan = optimal_plan(model)
    if model.horizon is None:
        return _endless_solution(model, plan(0) > 0)
    shape = (model.n_actions, model.n_states)

    def backup(t: int, value: Array) -> Array:
        """Return (A, S, 2): more than 0 where something may be paid from now on, and the steps from now on."""
        step = model.step(t)
        reward = np.stack([_pays(model, t), np.ones(shape)], axis=-1)
        return action_values(step.P, reward, 1.0, value)

    def choose(t: int, q: Array) -> Array:
        is_busy = (q[..., 0] > 0).any(axis=0)
        length = np.where(plan(t) > 0, q[..., 1], np.inf).min(axis=0)
        return np.stack([is_busy, np.where(is_busy, length, 0.0)], axis=-1)

    length = first_values(backward(backup, choose, np.zeros((model.n_states, 2)), model.horizon))[:, 1]
    return float(model.start @ length)


def _pays(model: Model, t: int) -> Array:
    """Return 1 for actions in states (A, S) that may be paid other than 0 at a time, else 0."""
    step = model.step(t)
    paid = step.R != 0
    if step.rounding.lowest < 0 < step.rounding.highest:  # outcomes of both signs may cancel
        found = outcome_table(model, t)
        paid = np.bincount(found.row, found.reward != 0, len(paid)) > 0
    return np.asarray(paid.reshape(model.n_actions, model.n_states), np.float64)


def _endless_solution(model: Model, best: Array) -> float:
    """Return the solution length without a horizon: the shortest path if only optimal actions are allowed."""
    step = model.step(0)
    busy = leading_to(step.P, np.asarray(_pays(model, 0).any(axis=0)))

    def image(length: Array) -> Array:
        q = action_values(step.P, np.ones(best.shape), 1.0, length)
        return np.where(busy, np.where(best, q, np.inf).min(axis=0), 0.0)

    return float(model.start @ fixed_point(image, np.zeros(model.n_states), step.P.nnz))


# -- outcomes of one step ---------------------------------------------------------------------------------------------

CHUNK = 65_536
LISTING_RATE = 1_000_000
"""Nominal number of outcomes that are listed in a second."""


@dataclass(frozen=True)
class StepOutcomes:
    """All outcomes (N,) of one step of random actions, sorted by `state` and distinct: next state, reward, end, probability.

    `first` (S + 1,) has the index of the first outcome of each state.
    """

    state: Array
    target: Array
    reward: Array
    ends: Array
    weight: Array
    first: Array


class RandomSteps:
    """Outcomes of random actions at each time, in the states in which episodes act.

    Raises:
        SpecError: (E712) when there are too many, or infinitely many.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.steps = Steps(model.task, as_paid=True)
        self.acting = np.flatnonzero(model.acting)
        self._known: dict[int, StepOutcomes] = {}
        if self.steps.branching == np.inf:
            refuse("rewards are drawn from a distribution that has infinitely many outcomes")
        times = (model.horizon or 1) if self.steps.uses_time else 1
        size = times * len(self.acting) * model.n_actions * self.steps.branching
        if size > limits().seconds * LISTING_RATE:
            refuse(f"random steps have {count(int(size))} outcomes", how_to_raise("seconds", size / LISTING_RATE))

    def at(self, t: int) -> StepOutcomes:
        time = t if self.steps.uses_time else 0
        if time not in self._known:
            self._known[time] = self._listed(time)
        return self._known[time]

    def _listed(self, t: int) -> StepOutcomes:
        parts = list(self._parts(t))
        state, target, reward, ends, weight = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.lexsort((reward, ends, target, state))
        state, target, reward, ends, weight = (x[order] for x in (state, target, reward, ends, weight))
        new = np.ones(len(state), np.bool_)
        new[1:] = np.logical_or.reduce([x[1:] != x[:-1] for x in (state, target, reward, ends)])
        at = np.flatnonzero(new)
        total = np.add.reduceat(weight, at) / self.model.n_actions
        first = np.searchsorted(state[at], np.arange(self.model.n_states + 1))
        return StepOutcomes(state[at], target[at], reward[at], ends[at], total, first)

    def _parts(self, t: int) -> Iterator[tuple[Array, ...]]:
        """Yield states, next states, rewards, ends and probabilities of outcomes, in chunks of actions and states."""
        codes = self.model.codes
        rows = len(self.acting) * self.model.n_actions
        size = max(1, int(CHUNK // max(1.0, min(self.steps.branching, CHUNK))))
        for low in range(0, rows, size):
            action, which = np.divmod(np.arange(low, min(rows, low + size)), len(self.acting))
            state = self.acting[which]
            for found in self.steps.outcomes(codes[state], action, t):
                at = state if found.origin is None else state[found.origin]
                target = np.searchsorted(codes, found.code)
                given = (at, target, found.reward.astype(np.float64), found.terminal, found.weight)
                yield tuple(np.broadcast_to(x, (len(at),)) for x in given)


# -- probability of a reward ------------------------------------------------------------------------------------------


def reward_chance(model: Model) -> float:
    """Return the probability that an episode of random actions has a reward other than 0."""
    steps = RandomSteps(model)
    if model.horizon is None:
        return float(model.start @ _ever_paid(model, steps.at(0)))

    def backup(t: int, later: Array) -> Array:
        return _backed_up(steps.at(t), model.n_states, later)

    chance = first_values(backward(backup, lambda t, chance: chance, np.zeros(model.n_states), model.horizon))
    return float(model.start @ chance)


def _backed_up(found: StepOutcomes, states: int, later: Array) -> Array:
    """Return the probability (S,) of a reward now or, by `later`, after this step."""
    hit = np.where(found.reward != 0, 1.0, np.where(found.ends, 0.0, later[found.target]))
    return np.bincount(found.state, found.weight * hit, states)


def _ever_paid(model: Model, found: StepOutcomes) -> Array:
    """Return the probability (S,) of a reward at any time, without a horizon."""
    n = model.n_states
    unpaid = (found.reward == 0) & ~found.ends
    entries = (found.weight[unpaid], (found.state[unpaid], found.target[unpaid]))
    matrix = scipy_sparse().csr_array(entries, shape=(n, n))
    now = _backed_up(found, n, np.zeros(n))
    return chain_values(matrix, now, leading_to(matrix, now > 0))


# -- probability of a best episode ------------------------------------------------------------------------------------

RATE = 2_000_000
"""Nominal number of outcomes of pairs of a state and a return so far in a second."""
CLOSE = 1e-9
"""Relative tolerance for optimality, as a share of the largest return."""
GRAIN = 2.0**-40


def best_chance(model: Model) -> float:
    """Return the probability that a return of random actions is at least the optimal value of its first state."""
    if model.horizon is None:
        refuse("episodes have no horizon")
    return _Trials(model, model.horizon).chance()


class _Trials:
    """Distribution of random episodes over pairs of a state and the return still missing to the best one.

    The missing return is an integer multiple of `grain`, so that sums do not depend on their order. A pair is dropped once its
    outcome is decided: `most` and `least`, (S,) for each time, are the largest and the smallest return from there on.
    """

    def __init__(self, model: Model, horizon: int) -> None:
        self.model = model
        self.horizon = horizon
        self.steps = RandomSteps(model)
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
        """Return the largest or smallest possible return (S,) from each time on."""

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
        missing = self._grains(self.wanted[state])
        weight = self.model.start[state]
        total = 0.0
        factor = 1.0
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
        """Return states, missing returns and probabilities after a step, and the probability of best episodes that it ends."""
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
    """Merge equal pairs of a state and a missing return."""
    if not len(state):
        return state, missing, weight
    order = np.lexsort((missing, state))
    state = state[order]
    missing = missing[order]
    new = np.ones(len(state), np.bool_)
    new[1:] = (state[1:] != state[:-1]) | (missing[1:] != missing[:-1])
    at = np.flatnonzero(new)
    return state[at], missing[at], np.add.reduceat(weight[order], at)
