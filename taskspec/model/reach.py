"""The states that episodes visit, and components of the action that make no difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import tell
from taskspec.lang.ir import Role
from taskspec.model.cost import Budget, Cost
from taskspec.model.model import Model, refuse, scipy_sparse
from taskspec.model.space import Growing, distinct, union
from taskspec.model.transitions import Steps

# Which states episodes visit: a search from the start, level by level, up to the horizon.

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
    """Return the states of all episodes, whatever the actions and draws. Steps out of the state space are passed over.

    Raises:
        SpecError: (E712) beyond `limit` states (and what `each` costs), with a hint, and where it takes too long.
    """
    horizon = steps.task.horizon
    level = distinct(steps.starts()[0])
    acting = Growing()
    entered = Growing()
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
        going, ended = successors(steps, level, t, lambda outcomes: budget.spend(cost, outcomes))
        entered.add(union([going, ended]))
        _check_few(entered.size, limit, hint, each)
        level = going if steps.uses_time else acting.without(going)
        t += 1
    return Visits(acting.all(), entered.all())


def _check_few(entered: int, limit: int | None, hint: str | None, each: str) -> None:
    if limit is not None and entered > limit:
        told = f"more than {limit:,} states can be reached{each and ', '}{each}"
        refuse(told, f"choose smaller parameters, or: {hint}" if hint else None)


def successors(
    steps: Steps, states: Array, t: int, spend: Callable[[int], None] = lambda outcomes: None
) -> tuple[Array, Array]:
    """Return the states entered from given states: those in which the episode goes on, and those in which it ends.

    Args:
        spend: called with the number of outcomes of each batch before they are sorted.
    """
    going = [states[:0]]
    ended = [states[:0]]
    per_chunk = max(1, int(min(CHUNK, OUTCOMES // max(1.0, steps.branching))) // steps.actions.size)
    for low in range(0, len(states), per_chunk):
        some = states[low : low + per_chunk]
        tell(f"looking for states, step {t + 1:,}: {low:,} of {len(states):,} looked at")
        for actions in _action_chunks(steps.actions.size):
            here = np.tile(some, len(actions))
            there = np.repeat(actions, len(some))
            for found in steps.outcomes(here, there, t):
                spend(len(found.code))
                inside = np.ones(len(found.code), np.bool_) if found.outside is None else ~found.outside
                terminal = np.broadcast_to(found.terminal, found.code.shape)
                going.append(distinct(found.code[inside & ~terminal]))
                ended.append(distinct(found.code[inside & terminal]))
    return union(going), union(ended)


def _action_chunks(size: int) -> list[Array]:
    return [np.arange(low, min(size, low + CHUNK)) for low in range(0, size, CHUNK)]


# Whether a component of the action makes any difference in a model.

CLEAR = 1e-12
"""A difference that no rounding makes."""


def groups(model: Model, name: str) -> Array:
    """Return actions that differ in one component alone, side by side: codes (groups, values of the component)."""
    space = model.actions
    position = next(i for i, c in enumerate(space.components) if c.name == name)
    values = space.decode(np.arange(space.size))[Role.ACTION, name].reshape(-1, space.size)
    own = np.zeros(space.size, np.int64)
    component = space.components[position]
    for row, low, stride in zip(values, component.low, space.strides[position], strict=True):
        own += (row - int(low)) * stride
    order = np.lexsort((own, np.arange(space.size) - own))
    count = int(np.prod(component.counts))
    return np.arange(space.size)[order].reshape(-1, count)


def differs(model: Model, action: str, state: str | None = None) -> tuple[bool | None, str]:
    """Return whether the action component changes the distribution of the next value of a state component.

    Without `state`: of the whole next state, of the reward, or of the end, in a state where episodes act. None where chances
    differ by so little that it may be rounding; what may happen with one action and never with another tells them apart.
    """
    table = groups(model, action)
    keys = np.arange(model.n_states) if state is None else _classes(model, state)
    sparse = scipy_sparse()
    collapse = sparse.csr_array(
        (np.ones(model.n_states), (np.arange(model.n_states), keys)), shape=(model.n_states, int(keys.max()) + 1)
    )
    unsure: int | None = None
    for step in {id(x): x for x in model.steps}.values():
        parts = [step.P @ collapse] + ([] if step.P_end is None else [step.P_end @ collapse])
        if state is not None:
            parts = [sum(parts[1:], parts[0])]
        for column in range(1, table.shape[1]):
            rows = _rows(model, table[:, 0])
            others = _rows(model, table[:, column])
            gap = _gap(step.R[rows], step.R[others]) if state is None else np.zeros(len(rows))
            for part in parts:
                gap = gap + _apart(part, rows, others) + _apart(part.sign(), rows, others)
            if (gap > CLEAR).any():
                at = int(np.flatnonzero(gap > CLEAR)[0])
                return True, f"it does in {model.state_name(int(rows[at] % model.n_states))}"
            if unsure is None and (gap > (step.rounding.terms + 4) * 2.0**-50).any():
                unsure = int(rows[gap.argmax()] % model.n_states)
    if unsure is not None:
        return None, f"in {model.state_name(unsure)} chances differ by no more than 1e-12"
    return False, "it does in no state"


def _apart(part: Any, rows: Array, others: Array) -> Array:
    """By how much (N,) some rows of a matrix differ from others, in all columns together."""
    return np.asarray(abs(part[rows] - part[others]).sum(axis=1)).reshape(-1)


def _gap(paid: Array, others: Array) -> Array:
    """By how much (N,) rewards differ, relative to their size."""
    with np.errstate(invalid="ignore"):  # rewards that are not finite are reported elsewhere
        gap = np.abs(paid - others)
        size = np.maximum(np.abs(paid), np.abs(others))
    return np.asarray(np.divide(gap, size, out=np.zeros_like(gap), where=size > 0))


def _rows(model: Model, actions: Array) -> Array:
    """Return rows of the given actions in all states where episodes act."""
    states = np.flatnonzero(model.acting)
    return (actions[:, None] * model.n_states + states[None, :]).reshape(-1)


def _classes(model: Model, state: str) -> Array:
    """Return states numbered by the value of one component, (S,)."""
    value = model.states.decode(model.codes)[Role.STATE, state].reshape(-1, model.n_states)
    return np.asarray(np.unique(value, axis=1, return_inverse=True)[1]).reshape(-1)
