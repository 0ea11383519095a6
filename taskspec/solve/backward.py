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

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

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
