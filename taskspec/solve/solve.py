"""Planning on an exact model: values, returns and visits as plain floats.

Shapes: S states, A actions, T steps. Values are (S,), action values Q and policies (A, S). With a horizon, T backward
steps give values for each time (the truncation pays nothing further); without one, values are the fixed point of the
discounted backup. An action value at time t is r(s, a) + discount * sum over s' of P(going on to s') V(s'): a terminal
state is worth 0.

The arithmetic is that of `certified.bounded`, whose bounds are what `Results` and claims use; here they are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.model.model import Model
from taskspec.solve.backward import first_values
from taskspec.solve.bounded import Bound, Bounded
from taskspec.solve.infinite_horizon import InfiniteHorizon
from taskspec.solve.plans import Boltzmann, Given, Greedy, Plan, Uniform, tables
from taskspec.solve.solver import Solver, Solvers, extreme

MOST_STEPS = 1_000_000


@dataclass(frozen=True)
class Solution:
    """Values (S,) at the start, and their expectation over the start."""

    value: Array
    expected: float


def solve(model: Model, rule: Callable[[Model], Bound] | None = None) -> Solution:
    """Return values at the first time under a rule: `best` (or None), `worst`, or `soft(beta)`."""
    value = (rule or best)(model).value
    return Solution(value, float(model.start @ value))


def best(model: Model) -> Bound:
    if model.horizon is None:
        return InfiniteHorizon(model).stationary_values(1)
    found: Bound = extreme(Bounded(model), True)
    return found


def worst(model: Model) -> Bound:
    if model.horizon is None:
        return InfiniteHorizon(model).stationary_values(-1).negative()
    value: Bound = extreme(Bounded(model), False)
    return value


def soft(beta: float) -> Callable[[Model], Bound]:
    """Return the causal maximum-entropy value: log sum exp(beta Q) / beta."""

    def rule(model: Model) -> Bound:
        if model.horizon is None:
            numbers = InfiniteHorizon(model)
            return numbers.soft(numbers.soft_q_values(beta), beta)
        found: Bound = first_values(Boltzmann(beta).plan(Bounded(model)))
        return found

    return rule


# -- returns ----------------------------------------------------------------------------------------------------------


def _solver(model: Model) -> Solver:
    return Solvers(model).of()


def optimal_return(model: Model) -> float:
    """Return the expected return of the best policy."""
    return _solver(model).best().value


def worst_return(model: Model) -> float:
    return _solver(model).worst().value


def random_return(model: Model) -> float:
    """Return the expected return of uniformly random actions."""
    return _solver(model).value(Uniform()).value


def policy_return(model: Model, plan: Plan) -> float:
    """Return the expected return of a policy given by its tables."""
    return Solvers(model).of(Given(plan)).value(Given(plan)).value


def visit_probability(model: Model, plan: Plan, states: Array) -> float:
    """Return the probability that an episode under a policy is ever in one of the states (S,), its last one included."""
    return Solvers(model).of(Given(plan)).probability(Given(plan), states).value


def occupancy(model: Model, plan: Plan, steps: int | None = None) -> Array:
    """Return how often a policy is expected to act in each state, (S,), summed over the episode and discounted.

    Without a horizon the sum is over `steps` steps, or until less than 1e-12 is left.
    """
    total = np.zeros(model.n_states)
    now = model.start.copy()
    last = model.horizon if steps is None else steps
    t = 0
    factor = 1.0
    while (last is None or t < last) and factor * now.sum() > 1e-12 and t < MOST_STEPS:
        total += factor * now
        now = model.step(t).P.T @ (plan(t) * now).reshape(-1)
        t = t + 1
        factor = factor * model.discount
    return total


def first_choices(model: Model) -> Array:
    """Return which actions (A, S) are best in the first step."""
    return np.asarray(tables(model, Greedy())(0) > 0)
