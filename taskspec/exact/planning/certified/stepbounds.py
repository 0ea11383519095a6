"""What a step is made of at one time, with the constants that bound the rounding of what is computed from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taskspec.exact.model.model import Step

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class StepBounds:
    """One time's matrices with the constants of their bounds.

    `c` bounds the rounding of a row relative to its size, and `lost` what is missing of it for values of size 1; with
    `faint` probabilities even values that are not 0 may leave no trace in a product. A reward whose `sizes` are expected to
    be so large is off by `paid` of them, and by `beyond`; `hidden` of it may be paid where the reward seems to be 0.
    """

    step: Step
    reward: Array
    sizes: Array
    paid: float
    beyond: float
    c: float
    inflate: float
    lost: float
    faint: bool
    hidden: float = 0.0

    def of(self, rows: Array) -> StepBounds:
        """Some rows alone."""
        step = replace(self.step, going=self.step.going[rows], ending=None)
        return replace(self, step=step, reward=self.reward[rows], sizes=self.sizes[rows])

    def reward_error(self, rows: slice) -> Array:
        """What the expected rewards of some rows are off by."""
        return self.paid * np.abs(self.sizes[rows]) + self.beyond
