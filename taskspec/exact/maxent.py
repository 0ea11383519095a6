"""Non-causal maximum entropy: trajectories in proportion to their likelihood times the exponential of their return.

    p(tau)  is proportional to  P(tau) exp(beta R(tau)),

where tau = (s0, a0, s1, ...) runs until the horizon or a terminal state, P(tau) is the product of
the start's and the transitions' probabilities (actions carry no factor of their own), and R(tau) is
the undiscounted sum of its rewards. It is the model of Ziebart et al. 2008 for stochastic dynamics:
outcomes of chance are weighed by what they pay, as if the agent could choose them, and that is what
the causal model (`solve.soft`) does not do.

With Z_T = 1 and Z = 1 at terminal states,

    Z_t(s, a) = E[exp(beta r) Z_{t+1}(s')],   Z_t(s) = sum over a of Z_t(s, a),

and the policy that acts as such trajectories do, given the state they are in, is Z_t(s, a)/Z_t(s).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.exact.failure import refuse, scipy_sparse
from taskspec.exact.model import Model
from taskspec.exact.transitions import Steps

Array = np.ndarray[Any, Any]


def maxent_policy(model: Model, beta: float = 1.0) -> list[Array]:
    """The policy (A, S) at each time of trajectories drawn in proportion to P(tau) exp(beta R(tau)).

    Raises:
        SpecError: (E712) without a horizon.
    """
    if model.horizon is None:
        refuse("trajectories without a horizon have no maximum-entropy distribution", "give the task a horizon")
    log_z = np.zeros(model.n_states)
    policies: list[Array] = []
    tables: dict[int, _Table] = {}
    for t in range(model.horizon - 1, -1, -1):
        key = id(model.step(t))
        if key not in tables:
            tables[key] = _table(model, t, beta)
        log_q = tables[key].log_q(log_z, model)
        top = log_q.max(axis=0)
        weights = np.exp(log_q - top)
        total = weights.sum(axis=0)
        policies.append(weights / total)
        log_z = top + np.log(total)
    return policies[::-1]


class _Table:
    """Every outcome of one time: rows, columns, log probability plus beta times the reward, whether it ends."""

    def __init__(self, rows: Array, columns: Array, log_weight: Array, ends: Array, count: int) -> None:
        order = np.argsort(rows, kind="stable")
        self.columns, self.log_weight, self.ends = columns[order], log_weight[order], ends[order]
        self.starts = np.searchsorted(rows[order], np.arange(count))
        self.counts = np.diff(np.append(self.starts, len(rows)))

    def log_q(self, log_z: Array, model: Model) -> Array:
        """log Z(s, a), (A, S), from log Z (S,) at the next time; -inf for rows without outcomes."""
        terms = self.log_weight + np.where(self.ends, 0.0, log_z[self.columns])
        some = self.counts > 0
        starts = self.starts[some]
        top = np.maximum.reduceat(terms, starts)
        total = np.add.reduceat(np.exp(terms - np.repeat(top, self.counts[some])), starts)
        found = np.full(len(self.counts), -np.inf)
        found[some] = top + np.log(total)
        return found.reshape(model.n_actions, model.n_states)


def _table(model: Model, t: int, beta: float) -> _Table:
    rows, columns, weights, rewards, ends = outcome_table(model, t)
    return _Table(rows, columns, np.log(weights) + beta * rewards, ends, model.n_actions * model.n_states)


def outcome_table(model: Model, t: int = 0) -> tuple[Array, Array, Array, Array, Array]:
    """Every outcome at a time: row a*S + s, column s', probability, reward, whether it ends; all (N,)."""
    steps, size = Steps(model.task), model.n_states
    parts: list[tuple[Array, ...]] = []
    for a in range(model.n_actions):
        for found in steps.outcomes(model.codes, np.array([a]), t):
            point = np.arange(size) if found.origin is None else found.origin
            n = len(point)
            weight = np.broadcast_to(found.weight, (n,))
            column = np.minimum(np.searchsorted(model.codes, found.code), size - 1)
            keep = weight > 0 if found.outside is None else (weight > 0) & ~found.outside
            values = (a * size + point, column, weight, found.reward, found.terminal)
            parts.append(tuple(np.broadcast_to(v, (n,))[keep] for v in values))
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return joined[0], joined[1], joined[2], joined[3], joined[4]


def reward_matrix(model: Model, t: int = 0) -> Any:
    """R(s, a, s') expected where it is also random, as a sparse matrix (A*S, S); entries of probability 0 are absent."""
    rows, columns, weights, rewards, _ = outcome_table(model, t)
    sparse = scipy_sparse()
    shape = (model.n_actions * model.n_states, model.n_states)
    mass = sparse.csr_array((weights, (rows, columns)), shape=shape)
    paid = sparse.csr_array((weights * rewards, (rows, columns)), shape=shape)
    paid.data = paid.data / mass.data
    return paid
