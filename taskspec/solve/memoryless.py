"""The best that an agent can earn who reacts to each observation alone, in rationals.

Its policies give one action to each observation. They are searched best first: with some observations given an action, and
in all others the best action of each state, an episode earns at least as much as any policy that agrees; where no two
states that look alike want different actions, it earns just that.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import limits, tell
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Role, draws, reads
from taskspec.model.model import Model, refuse
from taskspec.solve.backward import backward, first_values
from taskspec.solve.enclosure import Enclosure
from taskspec.solve.rational import Rational, Scaled

RATE = 1_000_000
"""Operations on short numbers that are done in a second, nominally."""
OVERHEAD = 100
"""Operations that a step takes beside those on its outcomes."""
FREE = -1


@dataclass
class ReactiveSearch:
    """The search; `seen` (T, S) numbers what is seen, as `observation_classes` does."""

    numbers: Rational
    seen: Array

    def value(self) -> Enclosure:
        """Return what is earned by the best policy that reacts; between two bounds where time ran out."""
        order = count()
        tried = 0
        each = 2 * (self.numbers.work + OVERHEAD * self.numbers.horizon)
        most = max(1, limits().seconds * RATE // each)
        first = np.full(int(self.seen.max()) + 1, FREE)
        value, open_at, guess = self._relaxed(first)
        waiting = [(-value, next(order), first, open_at)]
        low = self._relaxed(guess)[0]
        while True:
            upper, _, policy, open_at = heapq.heappop(waiting)
            if open_at is None or low >= -upper:
                return Enclosure.exactly(max(low, -upper) if open_at is None else low)
            if tried >= most:
                return Enclosure(low, -upper)
            tell(f"{tried:,} reactive policies, between {float(low):.6g} and {float(-upper):.6g}")
            for action in range(self.numbers.model.n_actions):
                more = policy.copy()
                more[open_at] = action
                value, still_open, guess = self._relaxed(more)
                tried += 1
                if value > low:
                    heapq.heappush(waiting, (-value, next(order), more, still_open))
                    low = max(low, value if still_open is None else self._relaxed(guess)[0])
            if not waiting:
                return Enclosure.exactly(low)

    def _relaxed(self, policy: Array) -> tuple[Fraction, int | None, Array]:
        """Return what is earned if only some observations bind; one whose states want different actions; a policy near it."""
        numbers = self.numbers
        wanted = []

        def choose(t: int, q: Scaled) -> Scaled:
            bound = policy[at(self.seen, t)]
            parts = np.where(bound == FREE, q.parts.max(axis=0), q.parts[bound, np.arange(len(bound))])
            wanted.append(np.where(bound == FREE, q.parts == parts, np.arange(len(q.parts))[:, None] == bound))
            return Scaled(parts, q.over).reduced()

        values = first_values(backward(numbers.backup, choose, numbers.zero(), numbers.horizon))
        start = numbers.at_start(values).low
        assert isinstance(start, Fraction)
        return start, *self._conflict(policy, wanted[::-1])

    def _conflict(self, policy: Array, wanted: list[Array]) -> tuple[int | None, Array]:
        """Return the first observation without an action that all its states want, as far as episodes come to them."""
        numbers = self.numbers
        shape = (len(policy), self.numbers.model.n_actions)
        votes = np.zeros(shape)
        agreed = np.ones(shape, np.bool_)
        level = numbers.start.parts > 0
        met = []
        for t, best in enumerate(wanted):
            look = at(self.seen, t)
            here = np.flatnonzero(level)
            met.append(look[here])
            np.add.at(votes, look[here], best.T[here])
            np.logical_and.at(agreed, look[here], best.T[here])
            level = numbers.successors(t, level & best)
        guess = np.where(
            policy == FREE, np.where(agreed, votes + len(wanted) * len(level), votes).argmax(axis=1), policy
        )
        for look in np.concatenate(met).tolist():
            if policy[look] == FREE and not agreed[look].any():
                return look, guess
        return None, guess


def observation_classes(model: Model) -> Array:
    """Return a number (T, S) for what is seen of each state at each time, T being 1 where the time is not seen; equal ones
    look alike.

    Noise that does not depend on the state tells nothing, and is left out.

    Raises:
        SpecError: (E712) where noise on the state decides what is seen.
    """
    nodes = []
    for node in model.task.observation.nodes:
        if not draws([node]):
            nodes.append(node)
        elif reads([node]):
            refuse(
                "the observation of a state is partly random", "draw it in `dynamics`, as an observed part of the state"
            )
    timed = (Role.TIME, "t") in reads(nodes)
    times = range((model.horizon or 0) + 1 if timed else 1)
    seen = np.concatenate([_seen(model, nodes, t) for t in times])
    _, numbers = np.unique(seen, axis=0, return_inverse=True)
    return np.asarray(numbers).reshape(len(times), model.n_states)


def _seen(model: Model, nodes: list[Any], t: int) -> Array:
    """Return everything that is seen at a time, one row (S, elements) for each state."""
    n = model.n_states
    rows = [np.zeros((1, model.n_states))]
    for value in evaluate(nodes, model.reads(t)):
        rows.append(np.broadcast_to(value, (*value.shape[:-1], n)).reshape(-1, n).astype(np.float64))
    return np.concatenate(rows).T


def at(seen: Array, t: int) -> Array:
    """Return what is seen of each state (S,) at a time."""
    return np.asarray(seen[t if len(seen) > 1 else 0])


def hides(model: Model, seen: Array) -> bool:
    """Return whether two states in which episodes act at the same time look alike."""
    return any(len(np.unique(at(seen, t)[level])) < np.count_nonzero(level) for t, level in model.levels())
