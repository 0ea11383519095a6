"""Partial observability: the best returns under observations that hide the state, and how much about it they hide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.transitions import joint_outcomes, outcome_count, picked
from taskspec.exact.scores.measures import mean_length, undiscounted
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.enclosure import Enclosure
from taskspec.exact.solve.infinite_horizon import chain_values, followed
from taskspec.exact.solve.plans import uniform_plan
from taskspec.exact.solve.pomdp import BeliefSearch, ReactiveSearch, hides, observation_classes
from taskspec.exact.solve.rational import Rational
from taskspec.exact.solve.solve import occupancy, visits_by_time
from taskspec.language.expressions.types import Expression, total_size
from taskspec.language.modifiers.core import informative, sees_moving_draws
from taskspec.language.task.questions import reads_time

SEARCHES = {"remembering": BeliefSearch, "memoryless": ReactiveSearch}
"""The search for the best policy of beliefs, and for the best memoryless policy."""


@dataclass(frozen=True, slots=True)
class PomdpBounds:
    """The best returns under observations that hide the state; None where they are unknown, and `why_not` gives the reason.

    Attributes:
        remembering: of policies that remember observations and actions.
        memoryless: of policies of the current observation alone.
    """

    remembering: Enclosure | None
    memoryless: Enclosure | None
    why_not: str | None = None


def pomdp_bounds(results: Results) -> PomdpBounds | None:
    """Bound the best returns of policies that see only the observations of a task.

    Args:
        results: of the task.

    Returns:
        bounds with memory and without; None where observations hide nothing, or without an exact model.
    """
    if results.task.observation.is_state or results.abstraction is not None or results.model is None:
        return None
    try:
        model = results.observing.known_model
        if not hides(model, observation_classes(model)):
            return None
        return PomdpBounds(best_observing(results, "remembering"), best_observing(results, "memoryless"))
    except SpecError as error:
        return PomdpBounds(None, None, error.diagnostics[0].message)


def best_observing(results: Results, which: str, as_written: bool = False) -> Enclosure:
    """Return the best return of policies that remember, or of memoryless ones (a key of `SEARCHES`)."""
    if results.abstraction is not None:
        refuse("observations of abstractions are unsupported")
    results = results.observing
    model = results.known_model
    if model.horizon is None:
        refuse("episodes have no horizon")
    if model.legal is not None:
        refuse("observations do not say which actions are legal")
    seen = observation_classes(model)
    solver = results.solvers.of(None, as_written)
    numbers = solver.numbers
    if not isinstance(numbers, Rational):
        refuse("the task is too large for rational arithmetic, or its probabilities are no rationals")
    key = (which, as_written)
    if key not in results.searched:
        found = SEARCHES[which](numbers, seen).value()
        results.searched[key] = Enclosure(found.low, min(found.high, solver.best().high))
    return results.searched[key]


RATE = 5_000_000
"""Numbers in observations that are listed in a second, nominally."""


def hidden_bits(model: Model) -> float:
    """Return the conditional entropy H(S | O) of the state given its observation, in bits, over the visits of random actions."""
    nodes = informative(model.task).nodes
    if sees_moving_draws(model.task):
        refuse("the observation shares a draw with the dynamics")
    is_timed = reads_time(nodes)
    if is_timed and model.horizon is None:
        refuse("the observation depends on the time, and there is no horizon")
    if is_timed:
        visits = list(visits_by_time(model, uniform_plan(model), model.horizon or 0))
    else:
        visits = [_visits(model)]
    outcomes = outcome_count(nodes)
    if outcomes == np.inf:
        refuse("the noise on what is seen of a state has infinitely many outcomes")
    size = sum(np.count_nonzero(each) for each in visits) * outcomes * total_size(nodes)
    if size > limits().seconds * RATE:
        refuse(f"observations have {count_of(int(size))} numbers in all", how_to_raise("seconds", size / RATE))
    parts: list[tuple[Array, Array, Array]] = []
    for t, each in enumerate(visits):
        parts += _observed(model, nodes, t, each)
    state, rows, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    _, observation = np.unique(rows, axis=0, return_inverse=True)
    pairs, pair = np.unique(np.stack([observation.reshape(-1), state]), axis=1, return_inverse=True)
    joint = np.bincount(pair.reshape(-1), weight / weight.sum())
    marginal = np.bincount(pairs[0], joint)
    return max(0.0, float(-(joint * np.log2(joint / marginal[pairs[0]])).sum()))


def _observed(model: Model, nodes: Sequence[Expression], t: int, visits: Array) -> Iterator[tuple[Array, Array, Array]]:
    states = np.flatnonzero(visits)
    given = picked(model.reads(t), states)
    for values, which, weight in joint_outcomes(nodes, given, len(states)):
        rows = [np.zeros((1, len(which))), *(value.reshape(-1, len(which)) for value in values)]
        yield states[which], np.concatenate(rows).astype(np.float64).T, visits[states[which]] * weight


def _visits(model: Model) -> Array:
    plan = uniform_plan(model)
    if model.horizon is not None:
        return occupancy(undiscounted(model), plan)
    mean_length(model, plan)  # refuses where episodes may never end
    return chain_values(followed(model.step(0).P, plan(0)).T.tocsr(), model.start, model.acting)
