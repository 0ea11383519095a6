"""What may be laid over a figure: a value, a policy or an occupancy for every state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

State = Mapping[str, Any]


@dataclass(frozen=True)
class Overlay:
    """Results by code of the state (`exact.space.Space` of the state's components).

    `values` are written beside states; `policy` gives the indices of the actions taken, whose
    transitions stand out; `occupancy` in [0, 1] shades the states that are visited. `legend` says below the figure
    what is shown.
    """

    values: Mapping[int, float] = field(default_factory=dict)
    policy: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    occupancy: Mapping[int, float] = field(default_factory=dict)
    legend: tuple[str, ...] = ()
    here: State | None = None  # the present state, for a frame of an episode

    def chosen(self, code: int, action: int) -> bool:
        return action in self.policy.get(code, ())
