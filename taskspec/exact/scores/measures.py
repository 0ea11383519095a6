"""Measures of difficulty: lengths of episodes, the success of random and constant actions, rewards of states, and coverage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy import sparse

from taskspec.base.arrays import Array
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.space import entries_of, holds
from taskspec.exact.model.transitions import Steps, merge_outcomes
from taskspec.exact.scores.lookahead import SWEEP_RATE
from taskspec.exact.scores.returns import Results, normalised
from taskspec.exact.solve.backward import Plan, action_values, all_values, backward, first_values
from taskspec.exact.solve.infinite_horizon import chain_values, fixed_point, leading_to
from taskspec.exact.solve.plans import optimal_plan, outcome_table, stationary, timed, uniform_plan
from taskspec.exact.solve.solve import best, occupancy, policy_return
from taskspec.language.registry import role

# -- lengths: expected returns of the same model with a reward of 1 for each step -----------------------------------------


def mean_length(model: Model, plan: Plan) -> float:
    """Return the expected number of steps of an episode under a policy."""
    if model.horizon is not None and all(step.P_end is None for step in model.steps):
        return model.horizon
    steps = {id(step): step.with_reward(np.ones_like(step.R), 1.0, 1.0) for step in model.steps}
    paid = replace(undiscounted(model), steps=tuple(steps[id(step)] for step in model.steps))
    return policy_return(paid, plan)


def undiscounted(model: Model) -> Model:
    """Return the model without a discount."""
    return replace(model, task=replace(model.task, discount=1.0))


def solution_length(model: Model) -> float:
    """Return the least expected number of steps in which an optimal policy reaches a state without further rewards."""
    plan = optimal_plan(model)
    shape = (model.n_actions, model.n_states)
    if model.horizon is None:  # the shortest path if only optimal actions are allowed
        P = model.step(0).P
        busy = leading_to(P, np.asarray(_pays(model, 0).any(axis=0)))
        allowed = plan(0) > 0

        def image(length: Array) -> Array:
            q = action_values(P, np.ones(shape), 1.0, length)
            return np.where(busy, np.where(allowed, q, np.inf).min(axis=0), 0.0)

        return float(model.start @ fixed_point(image, np.zeros(model.n_states), P.nnz))

    def backup(t: int, value: Array) -> Array:
        """Return (A, S, 2): more than 0 where something may be paid from now on, and the steps from now on."""
        reward = np.stack([_pays(model, t), np.ones(shape)], axis=-1)
        return action_values(model.step(t).P, reward, 1.0, value)

    def choose(t: int, q: Array) -> Array:
        is_busy = (model.among_legal(q[..., 0], 0.0) > 0).any(axis=0)
        length = np.where(plan(t) > 0, q[..., 1], np.inf).min(axis=0)
        return np.stack([is_busy, np.where(is_busy, length, 0.0)], axis=-1)

    length = first_values(backward(backup, choose, np.zeros((model.n_states, 2)), model.horizon))[:, 1]
    return float(model.start @ length)


def _pays(model: Model, t: int) -> Array:
    step = model.step(t)
    paid = step.R != 0
    if step.rounding.lowest < 0 < step.rounding.highest:  # outcomes of both signs may cancel
        table = outcome_table(model, t)
        paid = np.bincount(table.row, table.reward != 0, len(paid)) > 0
    return np.asarray(model.among_legal(paid.reshape(model.n_actions, model.n_states), False), np.float64)


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
        self._known: dict[int, StepOutcomes] = {}
        if self.steps.branching == np.inf:
            refuse("rewards are drawn from a distribution that has infinitely many outcomes")
        times = 1
        if self.steps.uses_time:
            times = model.horizon or 1
        size = times * model.n_states * model.n_actions * self.steps.branching
        if size > limits().seconds * LISTING_RATE:
            refuse(f"random steps have {count(int(size))} outcomes", how_to_raise("seconds", size / LISTING_RATE))

    def at(self, t: int) -> StepOutcomes:
        time = t if self.steps.uses_time else 0
        if time not in self._known:
            self._known[time] = self._listed(time)
        return self._known[time]

    def _listed(self, t: int) -> StepOutcomes:
        n = self.model.n_states
        table = self.steps.table(self.model.codes, t)
        uniform = self.model.uniform
        acting = self.model.acting[table.row % n] & (uniform.reshape(-1)[table.row] > 0)
        keys = (table.row % n, table.column, table.ends, table.reward.astype(np.float64))
        (state, target, ends, reward), weight = merge_outcomes([key[acting] for key in keys], table.weight[acting])
        first = np.searchsorted(state, np.arange(n + 1))
        number = np.count_nonzero(uniform, axis=0)  # of actions
        return StepOutcomes(state, target, reward, ends, weight / number[state], first)


def reward_chance(model: Model) -> float:
    """Return the probability that an episode of random actions has a reward other than 0."""
    steps = RandomSteps(model)
    n = model.n_states

    def backup(t: int, later: Array) -> Array:
        outcomes = steps.at(t)
        hit = np.where(outcomes.ends, 0.0, later[outcomes.target])
        hit[outcomes.reward != 0] = 1.0
        return np.bincount(outcomes.state, outcomes.weight * hit, n)

    if model.horizon is not None:
        return float(model.start @ first_values(backward(backup, lambda t, V: V, np.zeros(n), model.horizon)))
    outcomes = steps.at(0)
    unpaid = (outcomes.reward == 0) & ~outcomes.ends
    entries = (outcomes.weight[unpaid], (outcomes.state[unpaid], outcomes.target[unpaid]))
    matrix = sparse.csr_array(entries, shape=(n, n))
    now = backup(0, np.zeros(n))
    return float(model.start @ chain_values(matrix, now, leading_to(matrix, now > 0)))


RATE = 2_000_000
"""Nominal number of outcomes of pairs of a state and a return so far in a second."""
CLOSE = 1e-9
"""Relative tolerance for optimality, as a share of the largest return."""
GRAIN = 2.0**-40


def best_chance(model: Model) -> float:
    """Return the probability that a return of random actions is at least the optimal value of its first state.

    The distribution of random episodes is over pairs of a state and the return still missing to the best one, an integer
    multiple of `grain`, so that sums do not depend on their order. A pair is dropped once its outcome is decided: `most` and
    `least`, (S,) for each time, are the largest and the smallest return from there on.
    """
    if model.horizon is None:
        refuse("episodes have no horizon")
    horizon = model.horizon
    steps = RandomSteps(model)
    if 2 * (horizon + 1) * model.n_states * 8 > limits().megabytes * 1e6:
        refuse("returns from every time on do not fit into memory")
    most = _extremes(steps, horizon, np.maximum)
    least = _extremes(steps, horizon, np.minimum)
    wanted = best(model).value
    largest = max(float(np.abs(x).max()) for x in (*most, *least, wanted))
    grain = GRAIN * 2.0 ** np.ceil(np.log2(max(largest, 1e-300)))
    slack = CLOSE * largest + horizon * grain
    state = np.flatnonzero(model.start)
    missing = np.rint(wanted[state] / grain).astype(np.int64)
    weight = model.start[state]
    total = 0.0
    spent = 0
    factor = 1.0
    for t in range(horizon):
        off = missing * grain
        sure = off <= factor * least[t][state] + slack
        total += float(weight[sure].sum())
        is_open = ~sure & (off <= factor * most[t][state] + slack)
        outcomes = steps.at(t)
        first = outcomes.first[state[is_open]]
        counts = outcomes.first[state[is_open] + 1] - first
        spent += int(counts.sum())
        if spent > limits().seconds * RATE:
            refuse("random episodes have too many different returns", how_to_raise("seconds", 10 * limits().seconds))
        entry = entries_of(first, counts)
        missing = np.repeat(missing[is_open], counts) - np.rint(factor * outcomes.reward[entry] / grain).astype(
            np.int64
        )
        weight = np.repeat(weight[is_open], counts) * outcomes.weight[entry]
        ends = outcomes.ends[entry]
        total += float(weight[ends & (missing * grain <= slack)].sum())
        (state, missing), weight = merge_outcomes([outcomes.target[entry][~ends], missing[~ends]], weight[~ends])
        factor *= model.discount
    return total + float(weight[missing * grain <= slack].sum())


def _extremes(steps: RandomSteps, horizon: int, extreme: np.ufunc) -> list[Array]:
    n = steps.model.n_states

    def backup(t: int, value: Array) -> Array:
        table = steps.at(t)
        later = np.where(table.ends, 0.0, value[table.target])
        return np.asarray(table.reward + steps.model.discount * later)

    def choose(t: int, outcomes: Array) -> Array:
        first = steps.at(t).first
        acting = np.flatnonzero(first[1:] > first[:-1])
        value = np.zeros(n)
        value[acting] = extreme.reduceat(outcomes, first[acting])
        return value

    return all_values(backward(backup, choose, np.zeros(n), horizon))


# -- baselines: what constant actions and rewards of the state alone achieve, and what demonstrations cover -----------------

NOTHING = 1e-11
"""Differences of action values that are this small, as a share of the largest value, are rounding."""
SOLVE_RATE = 3e9
"""Nominal number of entries of a matrix times its columns for which a least-squares problem is solved per second."""


def score_of(results: Results, value: float) -> float:
    """Return a return on the scale where random actions have 0 and the optimal policy has 1."""
    optimal = results.enclosure("optimal")
    random = results.enclosure("random")
    if optimal is None or random is None:
        refuse(results.unsettled or "the optimal or the random return is not known")
    if optimal.value == random.value:
        refuse("random actions are optimal")
    return normalised(value, random.value, optimal.value, floor=None)


def best_constant(model: Model) -> float:
    """Return the largest return of a policy that always takes the same action; where it is illegal, a random one."""
    work = model.entries / len(model.steps) * (model.horizon or 1) * model.n_actions
    if work > limits().seconds * SWEEP_RATE:
        refuse("there are too many constant actions", how_to_raise("seconds", work / SWEEP_RATE))
    returns = []
    for a in range(model.n_actions):
        pi = np.zeros((model.n_actions, model.n_states))
        pi[a] = 1
        if model.legal is not None:
            pi = np.where(model.legal[a], pi, model.uniform)
        returns.append(policy_return(model, stationary(pi)))
    return max(returns)


def best_state_reward(model: Model) -> float:
    """Return the return of the optimal policy for the reward of the next state alone that is nearest to the true reward.

    Two rewards are as near as the advantages that they give to actions under the uniform policy, which neither potential shaping
    nor a constant changes. These are linear in the rewards of the states, so that the nearest ones solve a least-squares problem.
    Of actions that are equally good for them, each is taken as often.

    Sources: J. Skalse, L. Farnik, S. Motwani, E. Jenner, A. Gleave and A. Abate, "STARC: A General Framework For Quantifying
    Differences Between Reward Functions" (2024), for the canonical form.
    """
    if model.horizon is None:
        refuse("episodes have no horizon")
    entered = np.flatnonzero(model.entered)
    size = model.n_actions * model.n_states * (len(entered) + 1) * model.horizon
    work = size * len(entered)
    if 8 * size > limits().megabytes * 1e6:
        refuse("the rewards of all states do not fit into memory")
    if work > limits().seconds * SOLVE_RATE:
        refuse("the rewards of all states take too long to fit", how_to_raise("seconds", work / SOLVE_RATE))
    nearest = _nearest_rewards(model, entered)
    plans = []

    def backup(t: int, V: Array) -> Array:
        return action_values(model.step(t).P, _rewards(model, t, entered)[..., :-1] @ nearest, model.discount, V)

    def top(t: int, Q: Array) -> Array:
        V: Array = model.among_legal(Q, -np.inf).max(axis=0)
        rounding = 100 * NOTHING * np.abs(Q).max()
        lost = V - Q
        best = model.among_legal(lost <= rounding, False)
        plans.append(best / best.sum(axis=0))
        return V

    first_values(backward(backup, top, np.zeros(model.n_states), model.horizon))
    return policy_return(model, timed(plans[::-1]))


def _nearest_rewards(model: Model, entered: Array) -> Array:
    levels = dict(model.levels())
    advantages = []
    largest = np.zeros(len(entered) + 1)

    def backup(t: int, V: Array) -> Array:
        return action_values(model.step(t).P, _rewards(model, t, entered), model.discount, V)

    def mean(t: int, Q: Array) -> Array:
        return (model.uniform[:, :, None] * Q).sum(axis=0)

    for t, Q, V in backward(backup, mean, np.zeros((model.n_states, len(entered) + 1)), model.horizon or 0):
        if t in levels:
            advantages.append((Q - V)[(model.uniform > 0) & levels[t]])
            largest = np.maximum(largest, np.abs(Q).max(axis=(0, 1)))
    table = np.concatenate(advantages)
    table[np.abs(table) <= NOTHING * largest] = 0
    return np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=NOTHING)[0]


def _rewards(model: Model, t: int, entered: Array) -> Array:
    """Return expected rewards (A, S, K + 1) at a time: those of a reward of 1 for each of K next states, then the true one."""
    step = model.step(t)
    matrix: Any = sum(step.matrices[1:], step.matrices[0])
    arrivals = matrix.toarray()[:, entered]
    rewards = np.concatenate([arrivals, step.R[:, None]], axis=1)
    return rewards.reshape(model.n_actions, model.n_states, -1)


def coverage(results: Results) -> float:
    """Return the overlap of the states that the expert visits with those that random actions visit, from 0 to 1.

    Where a spec has roles, the expert acts in its variant and random actions in the learner's. Without an expert the optimal
    policy is taken.
    """
    shows = _in_role(results, "expert")
    expert = shows.known_model
    learner = _in_role(results, "learner").known_model
    if expert.states.components != learner.states.components:
        misused("expert and learner have different states")
    if shows.task.annotations.expert is not None and shows.expert_plan is None:
        refuse("the actions of the expert are not known for each state")
    shown = _shares(expert, shows.expert_plan or optimal_plan(expert))
    visited = _shares(learner, uniform_plan(learner))
    both = expert.codes[holds(expert.codes, learner.codes)]
    of_expert = shown[np.searchsorted(expert.codes, both)]
    of_learner = visited[np.searchsorted(learner.codes, both)]
    return float(np.minimum(of_expert, of_learner).sum())


def _in_role(results: Results, who: Literal["expert", "learner"]) -> Results:
    task = role(results.task, who)
    if task is results.task:
        return results
    return Results(task, limit=results.limit)


def _shares(model: Model, plan: Plan) -> Array:
    visits: Any = occupancy(model, plan)
    return np.asarray(visits / visits.sum())
