"""A decision process of few states, its numbers in fractions: what brute force and Storm are given."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, NamedTuple

from tests.verification.oracle.compare.exact import exact
from tests.verification.oracle.reference.model import Model, expert_shares

Key = tuple[Any, ...]
Shares = dict[int, Fraction]
"""How likely each action is."""


class Outcome(NamedTuple):
    probability: Fraction
    state: Key
    reward: Fraction
    terminated: bool


@dataclass(frozen=True, eq=False)
class Process:
    """`row(state, action, t)` lists what may follow; `expert(state, t)` the shares of its actions."""

    actions: int
    horizon: int | None
    discount: Fraction
    start: dict[Key, Fraction]
    row: Callable[[Key, int, int], list[Outcome]]
    expert: Callable[[Key, int], Shares] | None = None

    @cached_property
    def states(self) -> list[Key]:
        """All that episodes can be in, the last one of an episode included."""
        found = dict.fromkeys(self.start)
        for t, layer in enumerate(self.layers()):
            found.update(dict.fromkeys(o.state for k in layer for o in self._outcomes(k, t)))
        return list(found)

    def acting(self) -> list[Key]:
        """Those in which episodes act."""
        return list(dict.fromkeys(k for layer in self.layers() for k in layer))

    def layers(self) -> Iterator[list[Key]]:
        """The states that an episode can act in at time 0, 1, ...; without a horizon, those that are new."""
        here = list(self.start)
        seen = set(self.start)
        t = 0
        while here and (self.horizon is None or t < self.horizon):
            yield here
            going = dict.fromkeys(o.state for k in here for o in self._outcomes(k, t) if not o.terminated)
            here = [k for k in going if self.horizon is not None or k not in seen]
            seen.update(here)
            t += 1

    def _outcomes(self, key: Key, t: int) -> list[Outcome]:
        return [o for a in range(self.actions) for o in self.row(key, a, t)]


def of_model(model: Model) -> Process:
    """The process of a spec as the second interpreter reads it."""

    @cache
    def row(key: Key, action: int, t: int) -> list[Outcome]:
        return [Outcome(o.probability, o.state, exact(o.reward), o.terminated) for o in model.row(key, action, t)]

    task = model.task
    written = task.sections.get("expert")
    is_planned = written is None or written == "optimal" or str(written).startswith("soft(")
    return Process(
        len(model.actions), task.horizon, exact(task.discount), model.start(), row,
        None if is_planned else lambda key, t: expert_shares(model, key, t),
    )  # fmt: skip
