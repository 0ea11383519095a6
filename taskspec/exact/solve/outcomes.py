"""The outcomes of steps one by one, with their probabilities, in rationals or in floats; and Gymnasium's table of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.probabilities import FLOATS, ExactProbabilities, Inexact, Reader
from taskspec.exact.model.transitions import Steps
from taskspec.language.expressions.variates.entry import ProbabilityArithmetic
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task

Number = Fraction | float
GymTable = dict[int, dict[int, list[tuple[float, int, float, bool]]]]
"""`P[s][a]`: a list of (probability, next state, reward, terminated)."""
LARGEST_TABLE = 100_000
"""The number of states of a table that is exported."""
Place = tuple[int, int]
"""A time, 0 where it does not matter, and the index of a state."""


@dataclass(frozen=True)
class Outcome:
    """One outcome of a step."""

    probability: Number
    state: int
    reward: Number
    ends: bool


Outcomes = tuple[Outcome, ...]


class OutcomeLists:
    """The start, the discount and the outcomes of a model, in one arithmetic.

    Args:
        model: an exact model.
        exact: rationals, as the spec writes its numbers; else floats.
        as_paid: each reward that may be paid is an outcome of its own; else rewards are expected ones, by next state.

    Attributes:
        start: the probability of each state at the beginning.
        discount: of rewards.

    Raises:
        Inexact: for probabilities that are no rationals.
        SpecError: E712 for rewards with infinitely many outcomes.
    """

    def __init__(self, model: Model, exact: bool, as_paid: bool = False) -> None:
        self._model = model
        self._as_paid = as_paid
        self._steps = Steps(model.task, as_paid)
        if as_paid and self._steps.branching == math.inf:
            refuse(f"the reward of {model.task.id} draws from a distribution with infinitely many outcomes")
        self._read: Callable[[float], Number] = float
        self._numbers: ProbabilityArithmetic = FLOATS
        if exact:
            reader = Reader(as_written=True)
            self._read = reader
            self._numbers = ExactProbabilities(reader)
        self._known: dict[int, dict[tuple[int, int], Outcomes]] = {}
        self.discount: Number = self._read(model.discount)
        self.start: list[Number] = [0] * model.n_states
        codes, weights = self._steps.starts(self._numbers)
        for s, weight in zip(np.searchsorted(model.codes, codes).tolist(), weights.tolist(), strict=True):
            self.start[s] = weight
        self.at(0)

    def at(self, t: int) -> dict[tuple[int, int], Outcomes]:
        """Return the outcomes by state and action at a time, of states in which some episode acts."""
        if not self._model.is_timed:
            t = 0
        if t not in self._known:
            self._known[t] = self._listed(t)
        return self._known[t]

    def _listed(self, t: int) -> dict[tuple[int, int], Outcomes]:
        steps = self._steps.table(self._model.codes, t, self._numbers).by_step(self._model.n_states)
        listed: dict[tuple[int, int], Outcomes] = {}
        for (s, a), outcomes in steps.items():
            if self._model.acting[s]:
                paid = tuple(Outcome(p, to, self._read(reward), ends) for (to, reward, ends), p in outcomes.items())
                if self._as_paid:
                    listed[s, a] = paid
                else:
                    listed[s, a] = merged(paid)
        return listed


def merged(outcomes: Iterable[Outcome]) -> Outcomes:
    """Return outcomes that differ in state or end; those that do not become one, with their expected reward."""
    found: dict[tuple[int, bool], Outcome] = {}
    for outcome in outcomes:
        key = (outcome.state, outcome.ends)
        known = found.get(key)
        if known is not None:
            probability = known.probability + outcome.probability
            paid = known.probability * known.reward + outcome.probability * outcome.reward
            outcome = replace(outcome, probability=probability, reward=paid / probability)
        found[key] = outcome
    return tuple(found.values())


# -- tables of the states that episodes visit -------------------------------------------------------------------------


@dataclass(frozen=True)
class VisitedTable:
    """A model as a table of the places that some episode visits; numbers are rationals, or floats where a draw has none.

    Attributes:
        places: in order; outcomes lead to their indices.
        start: the probability of each place at the beginning.
        outcomes: of each place and each action; none where the action is not legal. Places in which no episode acts stay as
            they are and pay nothing.
        discount: of rewards.
        last: the number of the step that ends the episode wherever it is taken; None where there is none.
        is_timed: whether places have a time.
    """

    places: tuple[Place, ...]
    start: tuple[Number, ...]
    outcomes: tuple[tuple[Outcomes, ...], ...]
    discount: Number
    last: int | None
    is_timed: bool


def visited_table(model: Model, most: int) -> VisitedTable:
    """Return the table of a model; where the time matters, it is part of a place.

    Args:
        model: an exact model.
        most: the largest number of places.

    Raises:
        SpecError: E712 for a model that is too large.
    """
    last = _last_step(model)
    is_timed = model.is_timed and last is None
    try:
        lists = OutcomeLists(model, exact=True)
    except Inexact:
        lists = OutcomeLists(model, exact=False)
    rows = _explored(model, lists, is_timed, most)
    places = tuple(sorted(rows))
    index = {place: i for i, place in enumerate(places)}
    outcomes = []
    for t, s in places:
        later = t + is_timed
        moved = [tuple(replace(o, state=index[later, o.state]) for o in listed) for listed in rows[t, s]]
        if not any(moved):
            moved = [(Outcome(1, index[t, s], 0, False),)] * model.n_actions
        outcomes.append(tuple(moved))
    start = tuple(lists.start[s] if t == 0 else 0 for t, s in places)
    return VisitedTable(places, start, tuple(outcomes), lists.discount, last, is_timed)


def _last_step(model: Model) -> int | None:
    if not model.is_timed:
        return None
    first = model.step(0)
    for t, step in enumerate(model.steps):
        if step.same(first):
            continue
        ends_first = first.P_end is not None and first.P_end.sum() > 0
        if not ends_first and step.P.sum() == 0 and np.array_equal(step.R, first.R):
            return t
        return None
    return None


def _explored(model: Model, lists: OutcomeLists, is_timed: bool, most: int) -> dict[Place, list[Outcomes]]:
    """Return the outcomes of each action in all places that episodes visit; none where no episode acts."""
    found: dict[Place, list[Outcomes]] = {}
    waiting = [(0, s) for s in np.flatnonzero(model.start > 0).tolist()]
    while waiting:
        t, s = waiting.pop()
        if (t, s) in found:
            continue
        by_action: list[Outcomes] = [()] * model.n_actions
        if not is_timed or t < (model.horizon or 0):
            by_action = [lists.at(t).get((s, a), ()) for a in range(model.n_actions)]
            if model.legal is not None:
                by_action = [listed if model.legal[a, s] else () for a, listed in enumerate(by_action)]
        for outcomes in by_action:
            waiting += [(t + is_timed, outcome.state) for outcome in outcomes]
        found[t, s] = by_action
        if len(found) > most:
            refuse(f"{model.task.id} has more than {most:,} states; tables have {most:,} at most")
    return found


def gym_table(task: Task) -> tuple[GymTable, Array]:
    """Return the table `P` that environments of Gymnasium's toy_text have, and the start distribution.

    Its states are those that episodes visit, in the order of the exact model; all actions are in it, as environments take
    them. The same numbers are in a file of the format `gym-p`.

    Raises:
        SpecError: E712 for a task that has no exact model, or is too large.
    """
    found = visited_table(extract(with_all_actions(task), reachable=True), LARGEST_TABLE)
    P: GymTable = {}
    for s, by_action in enumerate(found.outcomes):
        P[s] = {}
        for a, outcomes in enumerate(by_action):
            P[s][a] = [(float(o.probability), o.state, float(o.reward), o.ends) for o in outcomes]
    return P, np.array([float(probability) for probability in found.start])
