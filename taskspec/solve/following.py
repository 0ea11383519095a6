"""Values of policies from action values, which are gone through one action at a time: there may be no memory for all of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskspec.base.arrays import Array
from taskspec.solve.rounding import FLOOR, UNIT


@dataclass(frozen=True, slots=True)
class Bound:
    """Numbers `value` and what they may be off by, `error`; arrays of one shape."""

    value: Array
    error: Array


@dataclass(frozen=True)
class Policy:
    """Probabilities of actions (A, S), and bounds of their errors (None: as good as exact).

    `open` marks actions (A, S) of states in which it could not be told which of these are best.
    """

    table: Array
    error: Array | None = None
    open: Array | None = None

    @cached_property
    def actions(self) -> Array | None:
        """The action (S,) in each state, where it is certain; None where some states have several."""
        if self.error is not None or self.open is not None:
            return None
        taken = self.table == 1
        is_one = bool(((self.table == 0) | taken).all() and (taken.sum(axis=0) == 1).all())
        return taken.argmax(axis=0) if is_one else None

    @cached_property
    def mixed(self) -> Array:
        """States (S,) in which values are weighed, as more than one action may be taken."""
        return np.asarray(((self.table != 0).sum(axis=0) > 1) | (self.table.max(axis=0) != 1))

    def of(self, some: slice) -> Policy:
        """What it is in some states."""
        error = None if self.error is None else self.error[:, some]
        return Policy(self.table[:, some], error, None if self.open is None else self.open[:, some])


def followed(policy: Policy, each: Iterable[Bound]) -> Bound:
    """The value of acting by a policy, from the values (S,) of each action."""
    p, size = policy.table, policy.table.shape[1]
    value, error, sizes, off = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    is_rounded, is_exact = bool(policy.mixed.any()), policy.error is None
    worth = np.zeros(size, np.bool_)  # where something is weighed that is not 0
    low, high = np.full(size, np.inf), np.full(size, -np.inf)
    for action, q in enumerate(each):
        value += _weighed(p[action], q.value)
        error += _weighed(p[action], q.error)
        if is_rounded:
            sizes += _weighed(p[action], np.abs(q.value))
        if is_rounded or not is_exact:
            worth |= ((q.value != 0) | (q.error != 0)) & ((p[action] != 0) | (not is_exact))
        if policy.error is not None:
            off += _weighed(policy.error[action], np.abs(q.value) + q.error)
        if policy.open is not None:
            low = np.where(policy.open[action], np.minimum(low, q.value - q.error), low)
            high = np.where(policy.open[action], np.maximum(high, q.value + q.error), high)
    error *= 1 + (len(p) + 4) * 4 * UNIT
    if is_rounded:
        error += np.where(policy.mixed, (len(p) + 4) * UNIT, 0.0) * sizes
    if not is_exact:
        error += off * (1 + 1e-12)
    error[worth & (policy.mixed | (not is_exact))] += FLOOR
    return Bound(value, error) if policy.open is None else _whichever(policy.open, low, high, Bound(value, error))


def _weighed(share: Array, value: Array) -> Array:
    """Values (S,) times the share (S,) of an action; where it is not taken, infinities count for nothing."""
    with np.errstate(invalid="ignore"):
        part = share * value
    return np.where(share == 0, 0.0, part) if np.isnan(part).any() else part


def _whichever(some: Array, low: Array, high: Array, otherwise: Bound) -> Bound:
    """What holds whichever of some actions (A, S) is taken in the states that have any: their values lie from `low` to `high`."""
    unsure = some.any(axis=0)
    low, high = np.where(unsure, low, 0.0), np.where(unsure, high, 0.0)
    middle = (low + high) / 2
    reach = (high - low) / 2 + 8 * UNIT * (np.abs(low) + np.abs(high))
    return Bound(np.where(unsure, middle, otherwise.value), np.where(unsure, reach, otherwise.error))
