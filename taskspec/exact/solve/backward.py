"""Backward induction, in numbers of any kind, and the rules by which actions are chosen in it.

With T steps, and the values V[T] of what comes after the last one,

    Q[t, a, s] = R[t, a, s] + gamma * sum over s' of P[t, a, s, s'] V[t + 1, s'],
    V[t, s] = choose(Q[t, :, s]).

`choose` is max for the best policy and min for the worst, the expectation under pi for a policy pi, and
log(sum over a of exp(beta Q[t, a, s])) / beta for the causal maximum-entropy policy.

Sources: R. Bellman, Dynamic Programming (1957); M. Puterman, Markov Decision Processes (1994), section 4.5; B. Ziebart,
Modeling Purposeful Adaptive Behavior with the Principle of Maximum Causal Entropy (2010), for soft values.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, Literal, TypeVar

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.transitions import outcome_count
from taskspec.exact.solve.bounded import Bound, Bounded, Policy
from taskspec.language.expressions.types import Expression
from taskspec.language.task.parts import Soft
from taskspec.language.task.questions import is_random, reads_time

Q = TypeVar("Q")
V = TypeVar("V")
Plan = Callable[[int], Array]
"""The probability of each action in each state, (A, S), at a time."""
MOST_OUTCOMES = 10_000
"""Outcomes of an expert's draws up to which it has a table."""


def backward(
    backup: Callable[[int, V], Q], choose: Callable[[int, Q], V], end: V, last: int, first: int = 0
) -> Iterator[tuple[int, Q, V]]:
    """Yield t, Q[t] and V[t] for t = last - 1, ..., first.

    Args:
        backup: gives Q[t] from t and V[t + 1]. The numbers are its own: floats (`action_values`), floats with bounds of their
            errors (`Bounded.backup`) or rationals (`Rational.backup`).
        choose: gives V[t] from t and Q[t].
        end: V[last].
        last: T, or an earlier time at which values are known.
        first: the time to stop at.
    """
    value = end
    for t in range(last - 1, first - 1, -1):
        q = backup(t, value)
        value = choose(t, q)
        yield t, q, value


def first_values(steps: Iterable[tuple[int, Q, V]]) -> V:
    """Return the values that `backward` comes to in the end."""
    for _, _, value in steps:
        found = value
    return found


def all_values(steps: Iterable[tuple[int, Q, V]]) -> list[V]:
    """Return the values at all times that `backward` comes to, the first time first."""
    found = [value for _, _, value in steps]
    return found[::-1]


def action_values(P: Any, R: Array, gamma: float, V: Array) -> Array:
    """Return Q, float64 (A, S, ...), of one time.

    Args:
        P: sparse (A * S, S), the probability that the episode goes on in a state; row a * S + s.
        R: float64 (A, S, ...), the expected reward; further axes for several rewards at once.
        gamma: the discount.
        V: float64 (S, ...), values at the next time.
    """
    later: Array = (P @ V).reshape(R.shape)
    return R + gamma * later


# -- rules: policies for any arithmetic (`numbers`), `Rational` or `Bounded`; policies (A, S), Q (A, S), V (S,) -----------


class Rule(ABC):
    """A policy, or the way to one from Q-values."""

    is_rational: ClassVar[bool] = True
    """Whether rational arithmetic has its policies, as far as is known beforehand."""
    is_drawn: bool = False
    """Whether its policies are probabilities that are worked out: they may be no rationals."""
    is_best: bool = False
    """Whether its return is the optimal one."""

    @abstractmethod
    def stationary(self, numbers: Any) -> Any:
        """Return the policy without a horizon."""


class FixedRule(Rule):
    """A policy that depends on the state and the time alone."""

    is_timed: bool = True
    """Whether it may differ from time to time."""

    @abstractmethod
    def policy(self, numbers: Any, t: int) -> Any:
        """Return the policy at a time."""

    def stationary(self, numbers: Any) -> Any:
        return self.policy(numbers, 0)


class PlannedRule(Rule):
    """A policy that depends on Q, which backward induction gives."""

    def backup(self, numbers: Any) -> Callable[[int, Any], Any]:
        """Return the function that gives Q[t] from t and V[t + 1]."""
        found: Callable[[int, Any], Any] = numbers.backup
        return found

    @abstractmethod
    def value(self, numbers: Any, q: Any) -> Any:
        """Return V[t] from Q[t]."""

    @abstractmethod
    def policy(self, numbers: Any, q: Any) -> Any:
        """Return the policy at a time from Q[t]."""

    def plan(self, numbers: Any) -> Iterator[tuple[int, Any, Any]]:
        """Yield t, Q[t] and V[t] from the last time to the first."""
        return backward(self.backup(numbers), lambda t, q: self.value(numbers, q), numbers.zero(), numbers.horizon)


class Uniform(FixedRule):
    """Uniformly random actions."""

    is_timed = False

    def policy(self, numbers: Any, t: int) -> Any:
        return numbers.uniform


@dataclass(frozen=True)
class Expressed(FixedRule):
    """Actions given by expressions, which may draw (finitely many outcomes) and read the time."""

    nodes: tuple[Expression, ...]

    @cached_property
    def is_drawn(self) -> bool:  # type: ignore[override]
        return is_random(self.nodes)

    @cached_property
    def is_timed(self) -> bool:  # type: ignore[override]
        return reads_time(self.nodes)

    def policy(self, numbers: Any, t: int) -> Any:
        return numbers.tabulated(self.nodes, t)

    def stationary(self, numbers: Any) -> Any:
        if self.is_timed:
            refuse("the expert depends on the time, and there is no horizon")
        return self.policy(numbers, 0)


@dataclass(frozen=True)
class Given(FixedRule):
    """Tables of probabilities from outside."""

    tables: Plan
    is_rational: ClassVar[bool] = False

    def policy(self, numbers: Any, t: int) -> Policy:
        return Policy(self.tables(t))


@dataclass(frozen=True)
class Greedy(PlannedRule):
    """The best actions, all of them alike where several are best, for the reward plus a constant.

    A reward that was learnt from behaviour of a fixed length is only known up to a constant per
    step. That is harmless there, and not where episodes may end early: with the value of terminal
    states fixed at 0, a positive constant says to linger and a negative one to leave. `shift` is
    that constant; 0 is the task's own reward.
    """

    shift: Fraction = Fraction(0)

    @cached_property
    def is_best(self) -> bool:  # type: ignore[override]
        return not self.shift

    def backup(self, numbers: Any) -> Callable[[int, Any], Any]:
        if not self.shift:
            return super().backup(numbers)
        return lambda t, value: numbers.plus(numbers.backup(t, value), self.shift)

    def value(self, numbers: Any, q: Any) -> Any:
        return numbers.top(q)

    def policy(self, numbers: Any, q: Any) -> Any:
        return numbers.greedy(q)

    def stationary(self, numbers: Any) -> Any:
        return numbers.greedy(numbers.q_values(self.shift))


@dataclass(frozen=True)
class Boltzmann(PlannedRule):
    """The causal maximum-entropy policy: exp(beta Q) of the soft values, normalised."""

    beta: float
    is_rational: ClassVar[bool] = False

    def value(self, numbers: Bounded, q: Bound) -> Bound:
        return numbers.soft(q, self.beta)

    def policy(self, numbers: Bounded, q: Bound) -> Policy:
        return numbers.boltzmann(q, self.beta)

    def stationary(self, numbers: Any) -> Policy:
        return self.policy(numbers, numbers.soft_q_values(self.beta))


def rule_of(model: Model, given: Literal["optimal"] | Soft | None = None) -> Rule | None:
    """Return the expert that the task's spec gives, or the one given here; None where there is none, or it draws too many
    outcomes.

    An expert that remembers is a function of the state in `Task.remembering` alone.
    """
    match given or model.task.annotations.expert:
        case "optimal":
            return Greedy()
        case Soft(beta=beta):
            return Boltzmann(beta)
        case tuple() as nodes if model.task.annotations.memory is None and outcome_count(nodes) <= MOST_OUTCOMES:
            return Expressed(nodes)
    return None
