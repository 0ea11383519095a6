"""Exact values, occupancies and policy gradients of a policy.

With T steps, pi[t, s, a] the policy and V[T] = 0,

    Q[t, s, a] = sum over (s', r) of p(s', r | s, a, t) (r + gamma V[t + 1, s']),    V[t + 1, s'] = 0 after a termination,
    V[t, s] = sum over a of pi[t, s, a] Q[t, s, a],    A[t, s, a] = Q[t, s, a] - V[t, s],
    d[t, s] = gamma^t Pr(S_t = s, the episode has not ended).

The horizon truncates an episode and nothing is paid after it, so that V[T] is 0 there as well. Without a horizon there is one
time: V is the fixed point, and d[0, s] the sum of gamma^t Pr(S_t = s) over all t.

Source: R. Sutton and A. Barto, Reinforcement Learning (2018), equations (4.3), (4.6) and section 13.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.probabilities import Inexact, Reader
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.exact.solve.backward import action_values, backward
from taskspec.exact.solve.infinite_horizon import chain_values, followed
from taskspec.exact.solve.rational import Rational, Scaled
from taskspec.language.task.task import Task, TaskLike
from taskspec.tools.oracle.tables import model_of, policy_table

By = Literal["state", "observation"]
"""Which rows a table has."""


@dataclass(frozen=True, eq=False)
class ObservedValues:
    """The values of a policy by time and observation: means over the states behind an observation, as often as they occur.

    Entries are nan where the policy never makes the observation at that time.

    Attributes:
        V: (T, O), the expected return from an observation.
        Q: (T, O, A), the expected return from an observation and an action.
        occupancy: (T, O), the discounted probability to make an observation and act.
    """

    V: Array
    Q: Array
    occupancy: Array

    @property
    def A(self) -> Array:
        """(T, O, A), the advantages Q - V."""
        return self.Q - self.V[..., None]


@dataclass(frozen=True, eq=False)
class PolicyEvaluation:
    """The exact values of a policy by time and state: float64, or fractions in object arrays.

    Attributes:
        model: the exact model that numbers states and actions: `model.state(i)`, `model.state_name(i)`, `model.action(i)`.
        pi: (T, S, A), the policy.
        V: (T + 1, S), the expected return from a state; V[T] is 0. (1, S) without a horizon.
        Q: (T, S, A), the expected return from a state and an action.
        occupancy: (T, S), gamma^t Pr(S_t = s), the discounted probability to act in a state at a time.
        expected_return: of the policy, from the start.
    """

    model: Model
    pi: Array
    V: Array
    Q: Array
    occupancy: Array
    expected_return: Any

    @property
    def task(self) -> Task:
        """The task."""
        return self.model.task

    @property
    def A(self) -> Array:
        """(T, S, A), the advantages Q - V."""
        return self.Q - self.V[: len(self.Q), :, None]

    @cached_property
    def seen(self) -> StateObservations:
        """The observations of the states, and their rows in tables over observations."""
        return StateObservations(self.model)

    def by_observation(self) -> ObservedValues:
        """Return the values by time and observation.

        Returns:
            Means over the states that look alike, weighted by occupancy; row o of a discrete observation is the number o, counted
            from the least.

        Raises:
            SpecError: E712 where observations are drawn.
        """
        weight = self._over_observations(self.occupancy)
        Q = _ratio(self._over_observations(self.occupancy[..., None] * self.Q), weight[..., None])
        V = _ratio(self._over_observations(self.occupancy * self.V[: len(self.Q)]), weight)
        return ObservedValues(V, Q, weight)

    def _over_observations(self, values: Array) -> Array:
        total = np.zeros((len(values), self.seen.count, *values.shape[2:]), dtype=values.dtype)
        for t, rows in enumerate(self.seen.rows):
            np.add.at(total[t], rows, values[t])
        return total


def _ratio(part: Array, whole: Array) -> Array:
    """Return part / whole; nan where both are 0."""
    whole = np.broadcast_to(whole, part.shape)
    ratios = np.full(part.shape, np.nan, dtype=part.dtype)
    is_there = whole != 0
    ratios[is_there] = part[is_there] / whole[is_there]
    return ratios


def evaluate(task: TaskLike, policy: Any, *, exact: bool = False) -> PolicyEvaluation:
    """Evaluate a policy exactly: V, Q, A, occupancies and the return, by time and state, or by observation.

    Args:
        task: a finite task, its id or its path.
        policy: a name ("random", "expert", "optimal", "soft(1)", "epsilon(0.1)"); a table of probabilities (S, A) or (T, S, A),
            or of actions (S,) or (T, S), over the states of the model or over observations; a function from one observation to
            probabilities (A,) or an action; a module of PyTorch from observations to logits (S, A) or a categorical
            distribution; or an object with `predict`, as models of Stable-Baselines3 are, which samples its actions. Illegal
            actions keep the probabilities that tables, functions and modules give them; those of an object are left out.
        exact: in rationals, with the numbers as the spec writes them (0.1 is 1/10) and probabilities as short fractions.

    Returns:
        The values, float64 or object arrays of fractions, in the unit of the reward.

    Raises:
        SpecError: E712 where there is no exact model, the policy has no table, or it is too large for rationals; E713 for
            anything that is not a policy.
    """
    model = model_of(task)
    pi = policy_table(model, policy, exact)
    if model.horizon is None:
        if exact:
            refuse(f"{model.task.id} has no horizon: its values are floats", "take `exact=False`, or give it a horizon")
        return _stationary(model, pi)
    if exact:
        return _in_rationals(model, pi)
    return _in_floats(model, pi)


def _in_floats(model: Model, pi: Array) -> PolicyEvaluation:
    shape = (model.n_actions, model.n_states)

    def backup(t: int, V: Array) -> Array:
        step = model.step(t)
        return action_values(step.P, step.R.reshape(shape), model.discount, V)

    def choose(t: int, q: Array) -> Array:
        return np.asarray((pi[t].T * q).sum(axis=0))

    V = np.zeros((len(pi) + 1, model.n_states))
    Q = np.zeros(pi.shape)
    for t, q, value in backward(backup, choose, V[-1], len(pi)):
        Q[t] = q.T
        V[t] = value
    d = np.zeros((len(pi), model.n_states))
    now = model.start
    for t in range(len(pi)):
        d[t] = now
        now = model.discount * (model.step(t).P.T @ (pi[t].T * now).reshape(-1))
    return PolicyEvaluation(model, pi, V, Q, d, float(model.start @ V[0]))


def _in_rationals(model: Model, pi: Array) -> PolicyEvaluation:
    try:
        numbers = Rational(model, Reader(as_written=True))
    except Inexact:
        refuse(
            f"{model.task.id} is too large for rationals, or draws with irrational probabilities", "take `exact=False`"
        )

    def choose(t: int, q: Scaled) -> Scaled:
        return numbers.follow(Scaled.of(pi[t].T), q)

    V = np.full((len(pi) + 1, model.n_states), Fraction(0), dtype=object)
    Q = np.full(pi.shape, Fraction(0), dtype=object)
    for t, q, value in backward(numbers.backup, choose, numbers.zero(), len(pi)):
        Q[t] = q.fractions().T
        V[t] = value.fractions()
    d = np.full((len(pi), model.n_states), Fraction(0), dtype=object)
    start = numbers.start.fractions()
    now = start
    for t in range(len(pi)):
        d[t] = now
        now = numbers.discount * _moved(numbers, t, now[:, None] * pi[t])
    return PolicyEvaluation(model, pi, V, Q, d, (start * V[0]).sum())


def _moved(numbers: Rational, t: int, acting: Array) -> Array:
    after = np.full(len(acting), Fraction(0), dtype=object)
    over = numbers.step(t).weights.over
    for s, a in zip(*np.nonzero(acting), strict=True):
        for column, weight in numbers.goes_on(t, a * len(acting) + s):
            after[column] += acting[s, a] * Fraction(weight, over)
    return after


def _stationary(model: Model, pi: Array) -> PolicyEvaluation:
    """Return the values of a policy without a horizon: solutions of linear equations."""
    step = model.step(0)
    policy = np.ascontiguousarray(pi[0].T)
    R = step.R.reshape(policy.shape)
    P = model.discount * followed(step.P, policy)
    V = chain_values(P, (policy * R).sum(axis=0), model.acting)
    d = chain_values(P.T.tocsr(), model.start, model.acting)
    Q = action_values(step.P, R, model.discount, V)
    return PolicyEvaluation(model, pi, V[None], Q.T[None], d[None], float(model.start @ V))


# -- gradients --------------------------------------------------------------------------------------------------------


def policy_gradient(
    task: TaskLike, policy: Any, *, by: By = "state", discounted: bool = True, exact: bool = False
) -> Array:
    """Return the exact gradient of the expected return with respect to the logits theta of a softmax table.

        pi(a | x) = exp(theta[x, a]) / sum over b of exp(theta[x, b]),
        dJ / dtheta[x, a] = sum over t, s with row x of d[t, s] pi(a | x) A[t, s, a].

    The policy alone determines its logits, up to a constant in each row that changes nothing.

    Args:
        task: a finite task, its id or its path.
        policy: as `evaluate` takes it; probabilities that a table of logits gives.
        by: the rows x of the table: states of the model, or observations.
        discounted: whether d has the weight gamma^t. Usual implementations leave it out, and then follow no gradient (C. Nota
            and P. Thomas, Is the policy gradient a gradient?, 2020).
        exact: in rationals.

    Returns:
        (S, A) or (O, A), float64 or an object array of fractions, in the unit of the reward.

    Raises:
        SpecError: as for `evaluate`; E712 without a horizon where `discounted` is False.

    Source: R. Sutton, D. McAllester, S. Singh and Y. Mansour, Policy gradient methods (2000), theorem 1; Sutton and Barto
    (2018), equation (13.5).
    """
    evaluation = evaluate(task, policy, exact=exact)
    weights = evaluation.occupancy
    if not discounted:
        weights = _undiscounted(evaluation, exact)
    each = weights[..., None] * evaluation.pi * evaluation.A
    if by == "observation":
        each = evaluation._over_observations(each)
    elif by != "state":
        misused(f"'{by}' is no kind of row", '"state" or "observation"')
    return np.asarray(each.sum(axis=0))


def _undiscounted(evaluation: PolicyEvaluation, exact: bool) -> Array:
    """Return Pr(S_t = s) (T, S) from gamma^t Pr(S_t = s)."""
    if evaluation.model.horizon is None:
        refuse(f"{evaluation.task.id} has no horizon: states may be visited infinitely often")
    gamma: Any = evaluation.model.discount
    if exact:
        gamma = Reader(as_written=True)(gamma)
    if gamma == 0:
        misused("with a discount of 0 later states have no weight to take away")
    return np.stack([d / gamma**t for t, d in enumerate(evaluation.occupancy)])
