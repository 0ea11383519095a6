"""Non-causal maximum entropy: trajectories in proportion to their likelihood times the exponential of their return.

    p(tau)  is proportional to  P(tau) exp(beta R(tau)),

where tau = (s0, a0, s1, ...) runs until the horizon or a terminal state, P(tau) is the product of
the start's and the transitions' probabilities (actions carry no factor of their own), and R(tau) is
its return, discounted by gamma as the task says. It is the model of Ziebart et al. 2008 for stochastic dynamics:
outcomes of chance are weighed by what they pay, as if the agent could choose them, and that is what
the causal model (`solve.soft`) does not do.

With Z_T = 1 and Z = 1 at terminal states,

    Z_t(s, a) = E[exp(beta gamma^t r) Z_{t+1}(s')],   Z_t(s) = sum over a of Z_t(s, a),

and the policy that acts as such trajectories do, given the state they are in, is Z_t(s, a)/Z_t(s).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from taskspec.model.model import Model, refuse
from taskspec.model.transitions import OutcomeTable, Steps
from taskspec.solve.backward import Rule
from taskspec.solve.bounded import SMALLEST, UNIT, Bound, Bounded, Policy


@dataclass(frozen=True)
class MaxEnt(Rule):
    """The policy of trajectories drawn in proportion to P(tau) exp(beta R(tau)), from the last time to the first.

    Q is log Z (A, S), and V is log Z (S,).
    """

    beta: float = 1.0
    is_rational: ClassVar[bool] = False
    is_planned: ClassVar[bool] = True

    def backup(self, numbers: Bounded) -> Callable[[int, Bound], Bound]:
        """Return the function that gives log Z (A, S) at t from log Z (S,) at t + 1.

        Raises:
            SpecError: (E712) where such trajectories have no distribution that could be worked out.
        """
        model = numbers.model
        if model.horizon is None:
            refuse("trajectories without a horizon have no maximum-entropy distribution", "give the task a horizon")
        if Steps(model.task).reward is not model.task.reward:
            refuse("maximum entropy depends on the whole distribution of a reward, and this one is continuous")
        table: _Table | None = None

        def back(t: int, log_z: Bound) -> Bound:
            nonlocal table
            if table is None or table.step is not model.step(t):
                table = _Table(numbers, t, self.beta)
            return table.log_q(log_z, t)

        return back

    def value(self, numbers: Bounded, q: Bound) -> Bound:
        return numbers.soft(q, 1.0)

    def policy(self, numbers: Bounded, t: int, q: Bound) -> Policy:
        return numbers.boltzmann(q, 1.0)

    def stationary(self, numbers: Any) -> Any:
        return self.backup(numbers)


class _Table:
    """Every outcome of one time: rows, columns, log probability, beta times the reward, whether it ends."""

    def __init__(self, numbers: Bounded, t: int, beta: float) -> None:
        model = numbers.model
        rows, columns, weights, rewards, ends, _ = outcome_table(model, t)
        order = np.argsort(rows, kind="stable")
        self.step = model.step(t)
        self.shape = (model.n_actions, model.n_states)
        self.columns = columns[order]
        self.ends = ends[order]
        size = model.n_actions * model.n_states
        self.discount = model.discount
        self.paid = beta * np.where(model.acting[rows % model.n_states], rewards, 0.0)[order]
        self.logs = np.log(weights[order])
        slack = numbers.slack
        off = slack.relative + 2 * slack.absolute / weights[order] + 8 * UNIT * (np.abs(self.logs) + 1)
        self.error = float(np.max(off, initial=0.0))
        if slack.missing > 0 or weights.min(initial=1.0) < SMALLEST:  # outcomes that are left out may pay anything
            self.error = np.inf
        self.starts = np.searchsorted(rows[order], np.arange(size))
        self.counts = np.diff(np.append(self.starts, len(rows)))

    def log_q(self, log_z: Bound, t: int) -> Bound:
        """log Z(s, a), (A, S), from log Z (S,) at the next time; 0 for rows without outcomes, where nobody acts."""
        paid = self.discount**t * self.paid
        largest = float(np.max(np.abs(paid), initial=0.0))
        rounded = 8 * UNIT * largest * (1 + (t if self.discount != 1 else 0))
        terms = self.logs + paid + np.where(self.ends, 0.0, log_z.value[self.columns])
        some = self.counts > 0
        starts = self.starts[some]
        top = np.maximum.reduceat(terms, starts)
        total = np.add.reduceat(np.exp(terms - np.repeat(top, self.counts[some])), starts)
        found = np.zeros(len(self.counts))
        found[some] = top + np.log(total)
        size = 1 + float(np.max(np.abs(found), initial=0.0))
        rounding = (16 * int(self.counts.max(initial=0)) + 32) * UNIT * size
        error = self.error + rounded + float(log_z.error.max(initial=0.0)) + rounding
        return Bound(found.reshape(self.shape), 0.0, error)


def outcome_table(model: Model, t: int = 0) -> OutcomeTable:
    """Return every outcome at a time that may happen and stays in the model."""
    found = Steps(model.task).table(model.codes, t)
    kept = (found.weight > 0) & found.inside
    return OutcomeTable(*(column[kept] for column in found))
