"""The solution of a task: returns, difficulty and trade-offs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from taskspec.exact.scores.difficulty import Difficulty, PomdpBounds, difficulty, pomdp_bounds
from taskspec.exact.scores.returns import Results
from taskspec.exact.scores.scores import Scores, scores
from taskspec.exact.solve.constrained import Expectations, constrained_optimum, pareto_front
from taskspec.language.task.task import Task


@dataclass(frozen=True, slots=True)
class Solution:
    """Exact answers about a task; None for those that were not asked for.

    Args:
        task: the task.
        scores: its returns.
        bounds: its best returns given observations alone; None where these show the state.
        difficulty: its measures of difficulty.
        limits: limits on measures, such as `cost<=1`.
        constrained: the best expectations within these limits.
        measure: the measure that is traded against the return.
        front: corners of the best returns for each value of that measure.
    """

    task: Task
    scores: Scores
    bounds: PomdpBounds | None
    difficulty: Difficulty | None = None
    limits: Sequence[str] = ()
    constrained: Expectations | None = None
    measure: str | None = None
    front: Sequence[Expectations] | None = None

    def record(self) -> dict[str, Any]:
        """Write the answers as JSON data."""
        data = self.scores.record() | {"yardsticks": _bounds_record(self.bounds)}
        if self.difficulty is not None:
            data["difficulty"] = self.difficulty.record()
        if self.constrained is not None:
            data["within_limits"] = {"limits": list(self.limits), **asdict(self.constrained)}
        if self.front is not None:
            data["front"] = list(map(asdict, self.front))
        return data


def _bounds_record(bounds: PomdpBounds | None) -> dict[str, Any] | None:
    if bounds is None:
        return None
    record: dict[str, Any] = {"why_not": bounds.why_not}
    for name in ("remembering", "memoryless"):
        value = getattr(bounds, name)
        record[name] = None
        if value is not None:
            record[name] = list(value.ends)
    return record


def solve(
    task: Task, episodes: int, seed: int, with_difficulty: bool, limits: Sequence[str], measure: str | None
) -> Solution:
    """Compute the returns of a task, and what else is asked for.

    Args:
        task: the task.
        episodes: of each estimate, where there is no exact model.
        seed: of these episodes.
        with_difficulty: whether to compute measures of difficulty.
        limits: limits on measures; the best return within all of them is computed unless there are none.
        measure: the best return is computed for each value of this measure; None for no measure.

    Raises:
        SpecError: a limit or a measure is not one of this task, or needs an exact model that it does not have.
    """
    returns = scores(task, episodes, seed)
    results = Results(task)
    bounds = pomdp_bounds(results)
    measures = None
    if with_difficulty:
        measures = difficulty(results)
    constrained = None
    if limits:
        constrained = constrained_optimum(task, limits)
    front = None
    if measure is not None:
        front = pareto_front(task, measure)
    return Solution(task, returns, bounds, measures, limits, constrained, measure, front)
