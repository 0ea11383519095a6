"""Measures of difficulty: what constant actions and rewards of the state alone achieve, and what demonstrations cover."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import how_to_raise, limits
from taskspec.model.model import Model, misused, refuse
from taskspec.model.space import holds
from taskspec.registry import role
from taskspec.scores.returns import Results, normalised
from taskspec.solve.backward import Plan, action_values, backward, first_values
from taskspec.solve.plans import optimal_plan, stationary, timed, uniform_plan
from taskspec.solve.solve import occupancy, policy_return

NOTHING = 1e-11
"""Differences of action values that are this small, as a share of the largest value, are rounding."""
SWEEP_RATE = 1e8
"""Nominal number of transitions per second, in all backups together."""
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
        best = model.among_legal(100 * NOTHING * np.abs(Q).max() >= V - Q, False)
        plans.append(best / best.sum(axis=0))
        return V

    first_values(backward(backup, top, np.zeros(model.n_states), model.horizon))
    return policy_return(model, timed(plans[::-1]))


def _nearest_rewards(model: Model, entered: Array) -> Array:
    """Return the rewards (K,) of states that are entered whose advantages are nearest to those of the true reward."""
    levels = dict(model.levels())
    advantages = []
    largest = np.zeros(len(entered) + 1)

    def backup(t: int, V: Array) -> Array:
        return action_values(model.step(t).P, _rewards(model, t, entered), model.discount, V)

    def mean(t: int, Q: Array) -> Array:
        V: Array = (model.uniform[:, :, None] * Q).sum(axis=0)
        return V

    for t, Q, V in backward(backup, mean, np.zeros((model.n_states, len(entered) + 1)), model.horizon or 0):
        if t in levels:
            advantages.append((Q - V)[(model.uniform > 0) & levels[t]])
            largest = np.maximum(largest, np.abs(Q).max(axis=(0, 1)))
    table = np.concatenate(advantages)
    table[np.abs(table) <= NOTHING * largest] = 0
    found: Array = np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=NOTHING)[0]
    return found


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
    """Return the results of the variant in which somebody acts."""
    task = role(results.task, who)
    if task is results.task:
        return results
    return Results(task, limit=results.limit)


def _shares(model: Model, plan: Plan) -> Array:
    """Return the share (S,) of an episode's actions that are taken in each state; discounted."""
    visits: Any = occupancy(model, plan)
    return np.asarray(visits / visits.sum())
