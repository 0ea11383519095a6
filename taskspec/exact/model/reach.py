"""Which states episodes visit: a search from the start, level by level, up to the horizon."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.exact.model.codes import Growing, distinct, union
from taskspec.exact.model.cost import Budget, Cost
from taskspec.exact.model.failure import refuse
from taskspec.exact.model.transitions import Steps
from taskspec.progress import tell

Array = np.ndarray[Any, Any]
CHUNK = 65_536
LEVEL = 2e-4
"""Seconds that a level of the search takes, however few states there are."""
SORTED = 10
"""Operations for which a state has its place among those that a step leads to."""
CODED = 3
"""Operations by which an element of a state is read from its code, or written into it."""
MERGED = 300
"""Operations by which a state is looked up among those that are known, and put among them."""
OUTCOMES = 4_000_000
"""How many outcomes of steps are held at once."""


@dataclass(frozen=True)
class Visits:
    """Codes of states, sorted: those where an action is taken, and all that are entered."""

    acting: Array
    entered: Array


def visits(steps: Steps, limit: int | None = None, hint: str | None = None, each: str = "") -> Visits:
    """The states of all episodes, whatever the actions and draws. Steps out of the state space are passed over.

    Raises:
        SpecError: (E712) beyond `limit` states (and what `each` costs), with a hint, and where it takes too long.
    """
    horizon = steps.task.horizon
    level = distinct(steps.starts()[0])
    acting, entered = Growing(), Growing()
    entered.add(level)
    budget = Budget("the steps until episodes find no new state")
    elements = sum(map(len, steps.states.strides))
    cost = Cost(steps.roots, beside=SORTED + CODED * elements)
    merging = Cost((), beside=MERGED)
    t = 0
    _check_few(entered.size, limit, hint, each)
    while len(level) and (horizon is None or t < horizon):
        budget.spend(merging, len(level), LEVEL)
        acting.add(level)
        going, ended = _successors(steps, level, t, lambda outcomes: budget.spend(cost, outcomes))
        entered.add(union([going, ended]))
        _check_few(entered.size, limit, hint, each)
        level = going if steps.uses_time else acting.without(going)
        t += 1
    return Visits(acting.all(), entered.all())


def _check_few(entered: int, limit: int | None, hint: str | None, each: str) -> None:
    if limit is not None and entered > limit:
        told = f"more than {limit:,} states can be reached{each and ', '}{each}"
        refuse(told, f"choose smaller parameters, or: {hint}" if hint else None)


def _successors(steps: Steps, states: Array, t: int, spend: Callable[[int], None]) -> tuple[Array, Array]:
    """States entered from the given ones: those where the episode goes on, and those where it ends.

    `spend` is told of outcomes before they are sorted.
    """
    going, ended = [states[:0]], [states[:0]]
    per_chunk = max(1, int(min(CHUNK, OUTCOMES // max(1.0, steps.branching))) // steps.actions.size)
    for low in range(0, len(states), per_chunk):
        some = states[low : low + per_chunk]
        tell(f"looking for states, step {t + 1:,}: {low:,} of {len(states):,} looked at")
        for actions in _action_chunks(steps.actions.size):
            here, there = np.tile(some, len(actions)), np.repeat(actions, len(some))
            for found in steps.outcomes(here, there, t):
                spend(len(found.code))
                inside = np.ones(len(found.code), np.bool_) if found.outside is None else ~found.outside
                terminal = np.broadcast_to(found.terminal, found.code.shape)
                going.append(distinct(found.code[inside & ~terminal]))
                ended.append(distinct(found.code[inside & terminal]))
    return union(going), union(ended)


def _action_chunks(size: int) -> list[Array]:
    return [np.arange(low, min(size, low + CHUNK)) for low in range(0, size, CHUNK)]
