"""The solution of a task: returns, difficulty and trade-offs, as text on the terminal and as JSON data; returns from files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import decimal, estimate, number
from taskspec.exact.rollout.rollout import return_range
from taskspec.exact.scores.difficulty import Difficulty, PomdpBounds, difficulty, pomdp_bounds
from taskspec.exact.scores.returns import Results, Return, why_no_expert
from taskspec.exact.scores.scores import Scores, scores
from taskspec.exact.solve.constrained import Expectations, constrained_optimum, pareto_front
from taskspec.exact.solve.enclosure import Enclosure
from taskspec.language.task.task import Task
from taskspec.show.record import settings
from taskspec.show.terminal.styled_text import Columns, VisibleText, console, line

RETURNS = ("optimal", "expert", "random", "worst")
MOST_CORNERS = 15  # corners of a front that are printed, about


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


def print_solution(solution: Solution) -> None:
    """Print all answers, the returns first."""
    _print_scores(solution.task, solution.scores, solution.bounds)
    out = console()
    if solution.difficulty is not None:
        out.print(_difficulty_table(solution.difficulty, solution.scores.why_not_exact))
    if solution.constrained is not None:
        out.print(_constrained_table(solution.limits, solution.constrained))
    if solution.front is not None and solution.measure is not None:
        _print_front(solution.front, solution.measure)


def _print_scores(task: Task, scores: Scores, bounds: PomdpBounds | None) -> None:
    out = console()
    out.print(line((task.id, "name"), (f"  {settings(task)}", "value")))
    table = Columns("", "", "", "", right=(1,), fold=(2, 3), styles=("quiet", "title", "", "quiet"))
    for name in RETURNS:
        table.add_row(f"  {name}", *_return_cells(task, scores, name), _remark(task, scores, name, bounds is not None))
        if name == "optimal" and bounds is not None:
            given = "given all observations and actions so far"
            table.add_row("  remembering", *_bound_cells(bounds.remembering, given, bounds.why_not))
            table.add_row("  memoryless", *_bound_cells(bounds.memoryless, "", bounds.why_not))
    out.print(table)
    if scores.measures:
        out.print(_measures_table(scores))
    ground = f"no exact model: {scores.why_not_exact}"
    if scores.states is not None:
        ground = f"from an exact model of {scores.states:,} states and {scores.actions:,} actions"
    out.print(f"  {ground}", style="quiet")
    print_discount(task)


def _remark(task: Task, scores: Scores, name: str, is_hidden: bool) -> str:
    value = getattr(scores, name)
    if name == "optimal" and is_hidden:
        return "knowing the state, which observations hide"
    if name == "expert" and value is None:
        no_expert = why_no_expert(task)
        if no_expert is not None:
            return no_expert
    if name == "expert" and scores.gap is not None:
        if abs(scores.gap) < 1e-9:
            return "optimal"
        return f"{decimal(scores.gap, 6)} below the optimum"
    if value is None and scores.states is not None:  # without a model the last line gives the reason
        return scores.why_not_exact or ""
    return ""


def _return_cells(task: Task, scores: Scores, name: str) -> tuple[str, str]:
    value: Return | None = getattr(scores, name)
    if value is not None:
        return _return(value)
    if name == "optimal":
        limit = return_range(task)[1]
        if math.isfinite(limit):
            return f"≤ {number(limit)}", "by the bounds of the reward"
    return "unknown", ""


def _return(value: Return) -> tuple[str, str]:
    if not value.episodes:
        status: str = value.status
        if value.bound > 1e-10 * abs(value.value):
            status = f"± {value.bound:.2g}, {status}"
        return number(value.value, 10), status
    mean, half = estimate(value.value, value.half)
    if not math.isfinite(value.value):
        return mean, f"({value.episodes:,} episodes)"
    if not value.half:
        return mean, f"in all of {value.episodes:,} episodes"
    return mean, f"± {half} (95 % CI, {value.episodes:,} episodes)"


def _bound_cells(value: Enclosure | None, remark: str, why_not: str | None) -> tuple[str, str, str]:
    if value is None:
        return "unknown", "", why_not or ""
    if value.error <= 1e-9 * abs(value.value):
        return *_return(Return(value.value, bound=value.error)), remark
    low, high = value.ends
    return f"{number(low)} to {number(high)}", "proved bounds", remark


def _measures_table(scores: Scores) -> Columns:
    table = Columns("  measure", *RETURNS, right=(1, 2, 3, 4), fold=(0,), styles=("quiet",))
    for name, by_policy in scores.measures.items():
        table.add_row(f"  {name}", *(_measured(by_policy[policy]) for policy in RETURNS))
    return table


def _measured(value: Return | None) -> str:
    if value is None:
        return ""
    if not value.episodes:
        return number(value.value, 6)
    mean, half = estimate(value.value, value.half)
    return f"{mean} ± {half}"


def print_discount(task: Task) -> None:
    if task.discount != 1:
        console().print(f"  discounted by {task.discount:g} a step", style="quiet")


def _difficulty_table(measures: Difficulty, known_reason: str | None) -> Columns:
    table = Columns("  difficulty", "", "", right=(1,), fold=(2,), styles=("", "", "quiet"))
    for name, value, unit, _ in measures.rows():
        reason = measures.why_not.get(name, unit)
        if reason == known_reason:
            reason = ""
        shown = "unknown"
        if value is not None:
            shown = number(value)
        table.add_row(f"  {name}", shown, reason)
    return table


def _constrained_table(limits: Sequence[str], best: Expectations) -> Columns:
    table = Columns("", "", "", right=(1,), fold=(2,), styles=("quiet", "title", "quiet"))
    reached = ", ".join(f"{name} {number(value, 6)}" for name, value in best.measures.items())
    table.add_row(f"  best with {' and '.join(limits)}", number(best.value, 8), f"linear program, {reached}")
    return table


def _print_front(corners: Sequence[Expectations], measure: str) -> None:
    table = Columns(f"  {measure}", "best return", right=(0, 1))
    every = -(-len(corners) // MOST_CORNERS)
    shown = [*corners[:-1:every], corners[-1]]
    for corner in shown:
        table.add_row(f"  {number(corner.measures[measure], 6)}", number(corner.value, 8))
    remark = "between two rows the best return is on the line from one to the other"
    if every > 1:
        remark = f"{len(shown)} of {len(corners)} corners; `--json` has all of them"
    out = console()
    out.print(table)
    out.print(VisibleText(f"  {remark}", style="quiet"))


def read_returns(path: Path) -> list[float]:
    """Return returns of episodes from a file: a JSON list, or `returns` of a JSON object; or a column of CSV.

    Raises:
        SpecError: E710 when there is no file, E711 when it has no returns.
    """
    if not path.exists():
        raise spec_error("E710", f"there is no file '{path}'")
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        if path.suffix == ".json":
            values = _from_json(text)
        else:
            values = _from_csv(text)
    except (ValueError, TypeError, KeyError, IndexError):
        values = []
    if not values:
        raise spec_error("E711", f"'{path}' contains no returns", "a JSON list of numbers, or one number per line")
    for i, value in enumerate(values, 1):
        if math.isnan(value):
            raise spec_error("E711", f"return number {i} of '{path}' is nan")
    return values


def _from_json(text: str) -> list[float]:
    data = json.loads(text)
    if isinstance(data, dict):
        data = data["returns"]
    return list(map(float, data))


def _from_csv(text: str) -> list[float]:
    """Return the column `r` or `return`, else the first one; comments start with `#`."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(lines))
    column = 0
    for i, cell in reversed(list(enumerate(rows[0]))):
        if cell.strip().lower() in ("r", "return", "returns", "score"):
            column = i
    try:
        float(rows[0][column])
    except ValueError:
        del rows[0]
    return [float(row[column]) for row in rows]
