"""Bounds of the rounding errors of steps and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from taskspec.base.arrays import Array
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Draw, Node
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.choices import row_table
from taskspec.lang.variates.entry import Enumeration
from taskspec.model.model import Step

# ---------- slack
# How far probabilities in float64 may be from those that a spec writes: what rounding bounds start from.

UNIT = 2.0**-53
"""The relative error of one rounded operation."""
COMPUTED = 8 * UNIT
"""The error allowed for a probability that an expression computes, as `1 - s / 10`."""
FLOOR = 1e-300
"""More than what products that are too small for a float can lose."""
FAINT = 1e-20
TINIEST = 1e-320
"""More than a probability that no float holds may be off by: it counts as the smallest float (`variates.outcomes.FAINTEST`)."""
QUIET = np.errstate(over="ignore", invalid="ignore")
"""Values that no float holds are infinite, or none, and have no finite bounds: that is told of the answer."""
TAIL = 1e-20
"""More than the probability of the outcomes that are left out of a draw of infinitely many."""


@dataclass(frozen=True, slots=True)
class Slack:
    """Bounds on errors of probabilities.

    `relative` is that of every outcome, `absolute` is added to each for probabilities that are computed at run time;
    outcomes of probability `missing` together were left out, and pay at most `beyond` in size.
    """

    relative: float = 0.0
    absolute: float = 0.0
    missing: float = 0.0
    beyond: float = 0.0

    @classmethod
    def of(cls, draws: Sequence[Draw], builder: Builder, reward: Node | None = None) -> Slack:
        """For outcomes of some draws together, which may enter a reward."""
        if not draws:
            return cls()
        missing = sum(TAIL * d.type.size for d in draws if _enumeration(d).tail)
        beyond = max(map(abs, builder.bounds(reward))) if missing and reward is not None else 0.0
        absolute = sum(COMPUTED * _enumeration(d).chances(d) for d in draws if _is_computed(d))
        return cls(sum(map(_relative, draws)), absolute, missing, beyond)


def _relative(draw: Draw) -> float:
    """The relative error of the probability of one outcome."""
    return _enumeration(draw).steps(draw) * UNIT


def _is_computed(draw: Draw) -> bool:
    """Whether the probabilities come from arithmetic at run time rather than from numbers in the spec."""
    found = _enumeration(draw)
    if not found.weighted or isinstance(draw.args[0], Const):
        return False
    return not (found.by_row and row_table(draw.args[0]) is not None)


def _enumeration(draw: Draw) -> Enumeration:
    found = VARIATES[draw.base].outcomes
    assert found is not None, draw.base
    return found


# ---------- stepbounds
# What a step is made of at one time, with the constants that bound the rounding of what is computed from it.


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
