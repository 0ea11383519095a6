"""Backward induction, in numbers of any kind.

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
from typing import Any, ClassVar, TypeVar

from taskspec.base.arrays import Array

Q = TypeVar("Q")
V = TypeVar("V")


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


class Rule(ABC):
    """A policy, or the way to one from Q-values, for any arithmetic (`plans`).

    `numbers` is the arithmetic of a model, `Rational` or `Bounded`; Q (A, S) and V (S,) are in its numbers.
    """

    is_planned: ClassVar[bool] = False
    """Whether it depends on Q, which backward induction gives; otherwise Q is None."""
    is_timed: bool = True
    """Whether its policy may differ from time to time."""

    is_rational: ClassVar[bool] = True
    """Whether rational arithmetic has its policies, as far as is known beforehand."""
    is_drawn: bool = False
    """Whether its policies are probabilities that are worked out: they may be no rationals."""

    @property
    def is_best(self) -> bool:
        """Whether its return is the optimal one."""
        return False

    def backup(self, numbers: Any) -> Callable[[int, Any], Any]:
        """Return the function that gives Q[t] from t and V[t + 1]."""
        found: Callable[[int, Any], Any] = numbers.backup
        return found

    def value(self, numbers: Any, q: Any) -> Any:
        """Return V[t] from Q[t]."""
        raise NotImplementedError

    @abstractmethod
    def policy(self, numbers: Any, t: int, q: Any) -> Any:
        """Return the policy (A, S) at a time."""

    @abstractmethod
    def stationary(self, numbers: Any) -> Any:
        """Return the policy (A, S) without a horizon."""

    def plan(self, numbers: Any) -> Iterator[tuple[int, Any, Any]]:
        """Yield t, Q[t] and V[t] from the last time to the first."""
        return backward(self.backup(numbers), lambda t, q: self.value(numbers, q), numbers.zero(), numbers.horizon)
