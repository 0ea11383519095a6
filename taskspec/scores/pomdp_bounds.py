"""What can be earned by those who see observations only: yardsticks for tasks whose observations hide the state."""

from __future__ import annotations

from dataclasses import dataclass

from taskspec.base.diagnostics import SpecError
from taskspec.model.model import refuse
from taskspec.scores.returns import Results
from taskspec.solve.beliefs import BeliefSearch
from taskspec.solve.enclosure import Enclosure
from taskspec.solve.memoryless import ReactiveSearch, hides, observation_classes
from taskspec.solve.rational import Rational

SEARCHES = {"remembering": BeliefSearch, "memoryless": ReactiveSearch}
"""How the best return is found of those who remember what they saw and did, and of those who react to what they see."""


@dataclass(frozen=True, slots=True)
class Yardsticks:
    """The best returns under observations that hide the state; None where they cannot be worked out, and `why_not` says why."""

    remembering: Enclosure | None
    memoryless: Enclosure | None
    why_not: str | None = None


def yardsticks(results: Results) -> Yardsticks | None:
    """The yardsticks of a task; None where its observations hide nothing, or where there is no model to tell."""
    if results.task.observation.is_state or results.abstraction is not None or results.model is None:
        return None
    model = results.model
    try:
        if not hides(model, observation_classes(model)):
            return None
        return Yardsticks(best_observing(results, "remembering"), best_observing(results, "memoryless"))
    except SpecError as error:
        return Yardsticks(None, None, error.diagnostics[0].message)


def best_observing(results: Results, which: str, as_written: bool = False) -> Enclosure:
    """The best return of those who remember, or of those who react; it is searched for once.

    Raises:
        SpecError: (E712) without an exact model of the task itself, small enough for rationals; with noise on what is seen.
    """
    model = results.model
    if model is None:
        refuse(results.why_not or "there is no exact model")
    if results.abstraction is not None:
        refuse("what is seen is not told of an abstraction")
    if model.horizon is None:
        refuse("episodes have no horizon")
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
