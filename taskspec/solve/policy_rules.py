"""Interface of policies for any arithmetic, and values of policies from action values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

from taskspec.solve.backward import backward


class Rule(ABC):
    """A way to choose actions (`exact.planning.plans`).

    `numbers` is the arithmetic of a model, `Rational` or `Bounded`; Q (A, S) and V (S,) are in its numbers.
    """

    is_planned: ClassVar[bool] = False
    """Whether it depends on Q, which backward induction gives; otherwise Q is None."""
    is_timed: bool = True
    """Whether its policy may differ from time to time."""

    is_rational: ClassVar[bool] = True
    """Whether rational arithmetic has its policies, as far as can be said beforehand."""
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
