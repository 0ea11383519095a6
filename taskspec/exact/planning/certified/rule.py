"""What a way to choose actions says, for whatever arithmetic."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar


class Rule(ABC):
    """A way to choose actions, worked out from the last time to the first (`exact.planning.plans`)."""

    is_rational: ClassVar[bool] = True
    """Whether rational arithmetic has its policies, as far as can be said beforehand."""
    is_drawn: bool = False
    """Whether its policies are probabilities that are worked out: they may be no rationals."""

    @property
    def is_best(self) -> bool:
        """Whether its return is the optimal one."""
        return False

    def start(self, numbers: Any) -> Any:
        """What is known at the end."""
        return None

    @abstractmethod
    def back(self, numbers: Any, t: int, inner: Any) -> tuple[Any, Any]:
        """The policy (A, S) at a time, and what is needed at the time before, from what is known at the time after."""

    @abstractmethod
    def settled(self, numbers: Any) -> Any:
        """The policy (A, S) without a horizon."""
