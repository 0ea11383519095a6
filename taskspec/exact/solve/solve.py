"""Answers about an exact model, in the arithmetic that gives them: rational where that is affordable, else bounded floats.

Shapes: S states, A actions, T steps. Values are (S,), action values Q and policies (A, S). With a horizon, T backward
steps give values for each time (the truncation pays nothing further); without one, values are the fixed point of the
discounted backup. A terminal state is worth 0.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.extras import is_installed
from taskspec.base.limits import tell
from taskspec.exact.model.model import Model
from taskspec.exact.model.probabilities import Inexact, Reader
from taskspec.exact.solve.backward import (
    FixedRule,
    Given,
    Plan,
    PlannedRule,
    Rule,
    backward,
    first_values,
)
from taskspec.exact.solve.bounded import QUIET, Bound, Bounded
from taskspec.exact.solve.enclosure import Enclosure
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon
from taskspec.exact.solve.rational import Rational

LONG = 300_000_000
"""Entries times steps from which compiled sweeps pay: NumPy takes a second or two for as many, and compiling may take two."""
MOST_STEPS = 1_000_000


class Finite:
    """Answers for models with a horizon, by backward induction; `numbers` is `Rational` or `Bounded` arithmetic."""

    def __init__(self, numbers: Any) -> None:
        self.numbers = numbers
        self._best: Enclosure | None = None

    def best(self) -> Enclosure:
        if self._best is None:
            self._best = self.numbers.at_start(extreme(self.numbers, True, at_start=True))
        return self._best

    def worst(self) -> Enclosure:
        found: Enclosure = self.numbers.at_start(extreme(self.numbers, False, at_start=True))
        return found

    @QUIET
    def value(self, rule: Rule, paid: Any = None) -> Enclosure:
        """Return the expected return of a policy.

        Args:
            paid: the numbers of the same model with the reward to sum up, if it is another than the policy is made for.
        """
        if rule.is_best and paid is None:
            return self.best()
        n = self.numbers
        if paid is not None:
            n = paid
        V = n.zero()
        for t, policy in self.policies(rule):
            V = n.follow(policy, n.backup(t, V))
        found: Enclosure = n.at_start(V)
        return found

    @QUIET
    def probability(self, rule: Rule, states: Array) -> Enclosure:
        """Return how likely an episode is ever in one of the states (S,), its last one included."""
        n = self.numbers
        V = n.marked(n.zero(), states)
        for t, policy in self.policies(rule):
            V = n.marked(n.follow(policy, n.reached(t, V, states)), states)
        found: Enclosure = n.at_start(V)
        return found

    def policies(self, rule: Rule) -> Iterator[tuple[int, Any]]:
        """Yield a rule's policy at each time, the last one first; one is held at a time."""
        numbers = self.numbers
        if isinstance(rule, PlannedRule):
            for t, q, _ in rule.plan(numbers):
                tell(f"following a policy, step {t + 1:,} of {numbers.horizon:,}")
                yield t, rule.policy(numbers, q)
            return
        assert isinstance(rule, FixedRule)
        policy = None
        for t in range(numbers.horizon - 1, -1, -1):
            tell(f"following a policy, step {t + 1:,} of {numbers.horizon:,}")
            if policy is None or rule.is_timed:
                policy = rule.policy(numbers, t)
            yield t, policy


Solver: TypeAlias = Finite | InfiniteHorizon
"""Answers about one model, all of them enclosures of the truth."""


@QUIET
def extreme(numbers: Any, largest: bool, at_start: bool = False) -> Any:
    """Return the best (or worst) values (S,) at the first time, in `Rational` or `Bounded` arithmetic.

    Args:
        at_start: only values of first states are asked for; others may be wrong.
    """
    is_long = numbers.model.entries * numbers.horizon >= LONG and numbers.model.legal is None
    if isinstance(numbers, Bounded) and is_long and is_installed("numba"):
        from taskspec.exact.solve.kernels_numba import extreme_values

        return extreme_values(numbers, largest, at_start)
    if largest:
        choose = numbers.top
    else:
        choose = numbers.bottom

    def chosen(t: int, q: Any) -> Any:
        tell(f"planning, step {t + 1:,} of {numbers.horizon:,}")
        return choose(q)

    return first_values(backward(numbers.backup, chosen, numbers.zero(), numbers.horizon))


class Solvers:
    """The solvers of one model, made when they are needed: one for each reading of floats, and one in floats."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._known: dict[bool, Solver] = {}
        self.ambiguous = False
        """Whether some answer depended on the reading."""

    def of(self, rule: Rule | None = None, as_written: bool = False) -> Solver:
        """Return the most exact solver for questions about a rule (None: about all policies)."""
        if self.model.horizon is None or (rule is not None and not rule.is_rational):
            return self.in_floats
        if as_written not in self._known:
            self._known[as_written] = self._made(as_written)
        found = self._known[as_written]
        if rule is not None and rule.is_drawn and isinstance(found.numbers, Rational):
            try:
                deque(found.policies(rule), maxlen=0)
            except Inexact:  # it has no such policies
                return self.in_floats
        return found

    def _made(self, as_written: bool) -> Solver:
        if as_written and not self.ambiguous and False in self._known:
            return self._known[False]
        reader = Reader(as_written)
        try:
            found = Finite(Rational(self.model, reader))
        except Inexact:
            return self.in_floats
        self.ambiguous |= reader.ambiguous
        return found

    @cached_property
    def in_floats(self) -> Solver:
        if self.model.horizon is None:
            return InfiniteHorizon(self.model)
        return Finite(Bounded(self.model))


def expectation(solvers: Solvers, rule: Rule, paid: Solvers, as_written: bool = False) -> Enclosure:
    """Return the expected sum of another reward under a policy; `paid` are the solvers of the same model with that reward."""
    solver = solvers.of(rule, as_written)
    other = paid.of(rule, as_written)
    if type(solver.numbers) is not type(other.numbers):
        solver = solvers.in_floats
        other = paid.in_floats
    return solver.value(rule, other.numbers)


def why_endless(solver: Solver) -> str:
    """Return why a value has no finite bounds, in words."""
    numbers = solver.numbers
    if isinstance(numbers, Bounded) and math.isinf(numbers.slack.beyond):
        return (
            "the reward grows without a bound with a draw that has infinitely many outcomes; "
            "`min(draw, 100)` in its place would bound it"
        )
    return "it has no finite value that floats could hold"


def best(model: Model) -> Bound:
    """Return the best values (S,) at the first time, as floats with bounds."""
    if model.horizon is None:
        return InfiniteHorizon(model).stationary_values()
    found: Bound = extreme(Bounded(model), True)
    return found


def policy_return(model: Model, plan: Plan) -> float:
    """Return the expected return of a policy given by its tables."""
    return Solvers(model).in_floats.value(Given(plan)).value


def occupancy(model: Model, plan: Plan) -> Array:
    """Return how often a policy is expected to act in each state, (S,), summed over the episode and discounted.

    The sum ends where less than 1e-12 is left.
    """
    total = np.zeros(model.n_states)
    factor = 1.0
    for now in visits_by_time(model, plan, model.horizon or MOST_STEPS):
        if factor * now.sum() <= 1e-12:
            break
        total += factor * now
        factor *= model.discount
    return total


def visits_by_time(model: Model, plan: Plan, times: int) -> Iterator[Array]:
    """Yield for so many times, from 0 on, the probability (S,) that a policy acts in each state then."""
    now = model.start
    for t in range(times):
        yield now
        now = model.step(t).P.T @ (plan(t) * now).reshape(-1)
