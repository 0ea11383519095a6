"""What a way to choose actions says, for whatever arithmetic."""

from __future__ import annotations

from typing import Any, ClassVar


class Rule:
    """A way to choose actions, worked out from the last time to the first (`exact.plans`).

    `is_rational` says whether rational arithmetic has its policies; `back` gives the policy (A, S) at a time, and what
    is needed at the time before, from what is known at the time after it.
    """

    is_rational: ClassVar[bool] = True

    @property
    def is_best(self) -> bool:
        """Whether its return is the optimal one."""
        return False

    def start(self, numbers: Any) -> Any:
        """What is known at the end."""
        return None

    def back(self, numbers: Any, t: int, inner: Any) -> tuple[Any, Any]:
        raise NotImplementedError

    def settled(self, numbers: Any) -> Any:
        """The policy (A, S) without a horizon."""
        raise NotImplementedError
