"""How far probabilities in float64 may be from those that a spec writes: what rounding bounds start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.draws.layout import row_table
from taskspec.exact.model.outcomes import highest_rate, poisson_terms
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Draw, Node

UNIT = 2.0**-53
"""The relative error of one rounded operation."""
COMPUTED = 8 * UNIT
"""The error allowed for a probability that an expression computes, as `1 - s / 10`."""
TAIL = 1e-20
"""More than the probability of the counts that are left out of a Poisson draw."""


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
        missing = sum(TAIL * d.type.size for d in draws if d.base == "poisson")
        beyond = max(map(abs, builder.bounds(reward))) if missing and reward is not None else 0.0
        absolute = sum(COMPUTED * _chances(d) for d in draws if _is_computed(d))
        return cls(sum(map(_relative, draws)), absolute, missing, beyond)


def _relative(draw: Draw) -> float:
    """The relative error of the probability of one outcome: its row is rounded, added up and divided."""
    if draw.base == "poisson":  # products of as many ratios as there are counts
        return draw.type.size * 6 * poisson_terms(highest_rate(draw)) * UNIT
    if draw.base == "arrangement":  # a quotient of whole numbers
        return UNIT
    if draw.base == "total":  # two products and a sum for each condition, of what was rounded
        return (4 * _chances(draw) + 4) * UNIT
    outcomes = draw.args[0].type.shape[-1] if draw.base == "categorical" else 2
    return draw.type.size * (outcomes + 4) * UNIT


def _chances(draw: Draw) -> int:
    """How many chances are computed for one outcome."""
    return draw.args[0].type.size if draw.base == "total" else draw.type.size


def _is_computed(draw: Draw) -> bool:
    """Whether the probabilities come from arithmetic at run time rather than from numbers in the spec."""
    if draw.base in ("index", "permutation", "arrangement") or isinstance(draw.args[0], Const):
        return False
    return draw.base != "categorical" or row_table(draw.args[0]) is None
