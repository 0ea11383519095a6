"""What may be laid over a figure: a value, a policy or an occupancy for every state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

State = Mapping[str, Any]
PARTS = ("values", "policy", "occupancy")


@dataclass(frozen=True)
class Overlay:
    """Results by code of the state (`exact.space.Space` of the state's components).

    `values` are written beside states; `policy` gives the indices of the actions taken, whose
    transitions stand out; `occupancy` in [0, 1] shades the states that are visited. `legend` gives the scale of each of
    them and says what it is; how it is drawn, a figure knows. Where a figure has no place for them, `told` says in words
    what is known of a state.
    """

    values: Mapping[int, float] = field(default_factory=dict)
    policy: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    occupancy: Mapping[int, float] = field(default_factory=dict)
    legend: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    told: Callable[[State], Mapping[str, str]] | None = field(default=None, compare=False)
    here: State | None = None  # the present state, for a frame of an episode
    seen: Mapping[int, State] = field(default_factory=dict)  # states of that episode by time, the present one included

    def chosen(self, code: int, action: int) -> bool:
        return action in self.policy.get(code, ())

    def only(self, part: str | None) -> Overlay:
        """One of the three alone, or nothing but the present state."""
        return Overlay(here=self.here, seen=self.seen, **({} if part is None else {part: getattr(self, part)}))
