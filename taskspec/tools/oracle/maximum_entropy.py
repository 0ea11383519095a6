"""Maximum entropy: soft values, causal or not, and expected features, for inverse reinforcement learning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.transitions import Steps
from taskspec.exact.solve.backward import action_values, backward
from taskspec.exact.solve.plans import outcome_table
from taskspec.language.task.task import TaskLike
from taskspec.tools.oracle.tables import model_of, plain
from taskspec.tools.oracle.values import PolicyEvaluation, evaluate


@dataclass(frozen=True, eq=False)
class SoftValues:
    """The soft values of a task with a horizon, float64.

    Attributes:
        pi: (T, S, A), the maximum-entropy policy; `evaluate(task, soft.pi)` has its occupancies and return.
        V: (T + 1, S), soft values; V[T] is 0.
        Q: (T, S, A), soft action values.
    """

    pi: Array
    V: Array
    Q: Array


def soft_values(task: TaskLike, beta: float = 1.0, *, reward: Any = None, causal: bool = True) -> SoftValues:
    """Return the soft values of a task, or of another reward in it, and the maximum-entropy policy.

        causal (MCE):          Q[t, s, a] = R(s, a) + gamma sum over s' of P(s' | s, a) V[t + 1, s'],
        not causal (MaxEnt):   Q[t, s, a] = log(sum over s' of P(s' | s, a) exp(beta (gamma^t r + V[t + 1, s']))) / beta,
        both:                  V[t, s] = log(sum over a of exp(beta Q[t, s, a])) / beta,   pi = exp(beta (Q - V)).

    Args:
        task: a finite task with a horizon, its id or its path.
        beta: the inverse temperature, not 0, at which values are infinite.
        reward: float (S, A), paid for an action in a state, in place of the task's reward.
        causal: MCE; else the distribution of trajectories in proportion to P(tau) exp(beta R(tau)).

    Returns:
        Soft values and the policy, float64, in the unit of the reward.

    Raises:
        SpecError: E712 without an exact model or a horizon; E713 for a reward of another shape, or a beta of 0.

    Source: B. Ziebart, Modeling Purposeful Adaptive Behavior with the Principle of Maximum Causal Entropy (2010), equations
    (9.1) to (9.3); B. Ziebart, A. Maas, J. Bagnell and A. Dey, Maximum entropy inverse reinforcement learning (2008).
    """
    if beta == 0:
        misused("soft values are infinite where beta is 0", '`evaluate(task, "random")`')
    model = model_of(task)
    if model.horizon is None:
        refuse(f"{model.task.id} has no horizon", "give it one")
    if not causal and reward is None and Steps(model.task).reward is not model.task.process.reward:
        refuse("maximum entropy depends on the whole distribution of a reward, and this one is continuous")
    paid = _by_action(model, reward)
    q_values = _maxent(model, paid, beta)
    if causal:
        q_values = _mce(model, paid)
    V = np.zeros((model.horizon + 1, model.n_states))
    Q = np.zeros((model.horizon, model.n_states, model.n_actions))

    def choose(t: int, q: Array) -> Array:
        return np.asarray(np.logaddexp.reduce(beta * model.among_legal(q, -np.inf), axis=0) / beta)

    for t, q, value in backward(q_values, choose, V[-1], model.horizon):
        Q[t] = q.T
        V[t] = value
    pi = np.exp(beta * (Q - V[:-1, :, None]))
    if model.legal is not None:
        pi = np.where(model.legal.T, pi, 0.0)
    return SoftValues(pi, V, Q)


def _by_action(model: Model, reward: Any) -> Array | None:
    if reward is None:
        return None
    rewards = plain(reward).astype(np.float64)
    if rewards.shape != (model.n_states, model.n_actions):
        misused(f"a reward has shape ({model.n_states}, {model.n_actions}), not {rewards.shape}")
    return np.asarray(rewards.T)


def _mce(model: Model, paid: Array | None) -> Callable[[int, Array], Array]:
    def backup(t: int, V: Array) -> Array:
        step = model.step(t)
        R = paid
        if R is None:
            R = step.R.reshape(model.n_actions, model.n_states)
        return action_values(step.P, R, model.discount, V)

    return backup


def _maxent(model: Model, paid: Array | None, beta: float) -> Callable[[int, Array], Array]:
    def backup(t: int, V: Array) -> Array:
        table = outcome_table(model, t)
        reward = table.reward
        if paid is not None:
            reward = paid.reshape(-1)[table.row]
        later = np.where(table.ends, 0.0, V[table.column])
        q = np.full(model.n_actions * model.n_states, -np.inf)
        np.logaddexp.at(q, table.row, np.log(table.weight) + beta * (model.discount**t * reward + later))
        q[np.isneginf(q)] = 0.0  # no outcome: no episode acts there
        return q.reshape(model.n_actions, model.n_states) / beta

    return backup


def feature_expectations(task: TaskLike, policy: Any, features: Any, *, last: bool = True) -> Array:
    """Return the expected discounted sum of features of the states that an episode visits.

        E[sum over t of gamma^t phi(S_t)]

    Args:
        task: a finite task with a horizon, its id or its path.
        policy: as `evaluate` takes it; `soft_values(task, reward=r).pi` for maximum-entropy inverse reinforcement learning.
        features: phi, float (S,) or (S, K), over the states of the model; `np.eye(S)` gives the visits of each state.
        last: whether the state in which an episode ends counts, once, as it does where all trajectories have T + 1 states.

    Returns:
        float64 () or (K,), in the unit of the features.

    Raises:
        SpecError: as for `evaluate`; E712 without a horizon; E713 for features of another shape.

    Source: Ziebart, Maas, Bagnell and Dey (2008), algorithm 1, steps 4 to 6.
    """
    evaluation = evaluate(task, policy)
    model = evaluation.model
    if model.horizon is None:
        refuse(f"{model.task.id} has no horizon", "give it one")
    phi = plain(features).astype(np.float64)
    if phi.ndim not in (1, 2) or len(phi) != model.n_states:
        misused(f"features have shape ({model.n_states},) or ({model.n_states}, K), not {phi.shape}")
    visits = evaluation.occupancy.sum(axis=0)
    if last:
        visits = visits + _last_states(evaluation)
    return np.asarray(visits @ phi)


def _last_states(evaluation: PolicyEvaluation) -> Array:
    model = evaluation.model
    total = np.zeros(model.n_states)
    for t, d in enumerate(evaluation.occupancy):
        acting = (evaluation.pi[t] * d[:, None]).T.reshape(-1)
        step = model.step(t)
        if step.P_end is not None:
            total += step.P_end.T @ acting
        if t + 1 == len(evaluation.occupancy):
            total += step.P.T @ acting
    return model.discount * total
