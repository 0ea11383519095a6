"""What is known of values without running anything: bounds, and whether they are always finite numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

INF = math.inf
Interval = tuple[float, float]
"""Ends of an int are ints, or infinite; those of a real are floats."""
EVERYTHING: Interval = (-INF, INF)
HUGE = 1e300
"""Bounds further out than this count as infinite."""


class Range(NamedTuple):
    """What is known of every element of a value: its bounds, and whether it is always a finite number."""

    low: float
    high: float
    finite: bool = True

    @property
    def bounded(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)

    def holds_zero(self) -> bool:
        return self.low <= 0 <= self.high


Args = Sequence[Range]
