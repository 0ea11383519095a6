"""`taskspec solve` and `taskspec score`: what returns are possible, and where given ones stand between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from taskspec.base.columns import Columns
from taskspec.base.display import decimal, estimate, number
from taskspec.base.terminal import Console, VisibleText, console, line
from taskspec.cli import options
from taskspec.cli.console import write_json, write_records
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.exact import Expectations, PomdpBounds, Results, Return, Score, Scores
    from taskspec.language.task.task import Task

RETURNS = ("optimal", "expert", "random", "worst")
MOST_CORNERS = 15  # corners of a front that are printed, about
ReturnsFile = Annotated[
    Path,
    Argument(
        metavar="RETURNS",
        help="Returns of episodes: JSON (as `run --json` writes), or CSV (a monitor file, or a column).",
    ),
]


def solve(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    episodes: Annotated[int, Option("--episodes", "-n", min=2, help="Used where simulation is needed.")] = 1000,
    seed: Annotated[int, options.seed_option("Used where simulation is needed.")] = 0,
    difficulty: Annotated[
        bool,
        Option(
            "--difficulty", help="Measures of difficulty from theory besides: `docs/explain/difficulty.md` lists them."
        ),
    ] = False,
    limit_measure: Annotated[
        list[str] | None,
        Option("--limit-measure", metavar="LIMIT", help="Also the best return within a limit on a measure: `cost<=1`."),
    ] = None,
    front: Annotated[
        str | None, Option("--front", metavar="MEASURE", help="Also the best return for each value of a measure.")
    ] = None,
    output: Annotated[Path | None, options.file_option("--output", "-o", help="Save the scores to this file.")] = None,
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Compute optimal, expert, random and worst return.

    Exactly where the task has an exact model, else from episodes, with a confidence interval. Where observations hide
    the state, also the best returns given observations alone: with memory, and without. Where the task has measures,
    their expected sums under the same policies.
    """
    from taskspec import exact
    from taskspec.language.targets import beside, tasks_of

    records = []
    found = tasks_of(task, variant, parameters or [], modifiers or [])
    for each in found:
        with progress(each.instance_id):
            scores = exact.scores(each, episodes, seed)
            results = exact.Results(each)
            bounds = exact.pomdp_bounds(results)
            answers = list(_answers(results, scores, difficulty, limit_measure or [], front))
        if output is not None:
            scores.save(output if len(found) == 1 else beside(output, each))
        if json:
            record = scores.record() | {"yardsticks": _bounds_record(bounds)}
            records.append(record | {name: data for name, data, _ in answers})
            continue
        _print_scores(each, scores, bounds)
        for _, _, shown in answers:
            for part in shown:
                console().print(part)
    if json:
        write_records(records)


def _answers(
    results: Results, scores: Scores, difficulty: bool, limits: Sequence[str], measure: str | None
) -> Iterator[tuple[str, Any, list[Any]]]:
    """Yield answers that are asked for beside the returns: their names, as plain data, and as they are printed."""
    from taskspec import exact

    if difficulty:
        measures = exact.difficulty(results)
        table = Columns("  difficulty", "", "", right=(1,), fold=(2,), styles=("", "", "quiet"))
        for name, value, unit, _ in measures.rows():
            reason = measures.why_not.get(name, unit)
            if reason == scores.why_not_exact:  # which has been given
                reason = ""
            table.add_row(f"  {name}", "unknown" if value is None else number(value), reason)
        yield "difficulty", measures.record(), [table]
    if limits:
        found = exact.constrained_optimum(results.task, limits)
        table = Columns("", "", "", right=(1,), fold=(2,), styles=("quiet", "title", "quiet"))
        reached = ", ".join(f"{name} {number(value, 6)}" for name, value in found.measures.items())
        table.add_row(f"  best with {' and '.join(limits)}", number(found.value, 8), f"linear program, {reached}")
        yield "within_limits", {"limits": list(limits), **asdict(found)}, [table]
    if measure is not None:
        corners = exact.pareto_front(results.task, measure)
        yield "front", list(map(asdict, corners)), [*_front(corners, measure)]


def score(
    task: options.TaskArgument,
    returns: ReturnsFile,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    scores: Annotated[Path | None, options.file_option("--scores", help="Scores saved by `solve -o`.")] = None,
    json: options.Json = False,
) -> None:
    """Score returns: 0 is random actions, 1 is the expert.

    A score below -1 counts as -1, as in the paper that the derail suite comes from.
    """
    from taskspec import exact
    from taskspec.exact.scores.scores import read_returns
    from taskspec.language.targets import task_of

    found = task_of(task, variant, parameters or [], modifiers or [])
    known = None
    if scores is not None:
        known = exact.Scores.load(scores, found)
    result = exact.score(found, returns=read_returns(returns), known=known)
    if json:
        write_json({
            "score": result.normalised, "confidence_95": list(result.interval()), "episodes": result.value.episodes,
            "mean_return": result.value.value, "scores": result.scores.record(),
        })  # fmt: skip
    else:
        _print_score(found, result)


def _bounds_record(bounds: PomdpBounds | None) -> dict[str, Any] | None:
    if bounds is None:
        return None
    found: dict[str, Any] = {"why_not": bounds.why_not}
    for name in ("remembering", "memoryless"):
        value = getattr(bounds, name)
        found[name] = value and list(value.ends)
    return found


def _print_scores(task: Task, scores: Scores, bounds: PomdpBounds | None) -> None:
    from taskspec.exact.rollout.rollout import return_range
    from taskspec.language.task.record import settings

    out = console()
    out.print(line((task.id, "name"), (f"  {settings(task)}", "value")))
    table = Columns("", "", "", "", right=(1,), fold=(2, 3), styles=("quiet", "title", "", "quiet"))
    for name in RETURNS:
        value: Return | None = getattr(scores, name)
        remark = ""
        if name == "optimal" and bounds is not None:
            remark = "knowing the state, which observations hide"
        elif name == "expert" and scores.gap is not None:
            if abs(scores.gap) < 1e-9:
                remark = "optimal"
            else:
                remark = f"{decimal(scores.gap, 6)} below the optimum"
        elif name != "expert" and value is None and scores.states is not None:  # otherwise the last line says why
            remark = scores.why_not_exact or ""
        shown = _return(value)
        if name == "optimal" and value is None:
            limit = return_range(task)[1]
            if math.isfinite(limit):
                shown = f"≤ {number(limit)}", "by the bounds of the reward"
        table.add_row(f"  {name}", *shown, remark)
        if name == "optimal" and bounds is not None:
            remark = "given all observations and actions so far"
            table.add_row("  remembering", *_bound(bounds.remembering, remark, bounds.why_not))
            table.add_row("  memoryless", *_bound(bounds.memoryless, "", bounds.why_not))
    out.print(table)
    _print_measures(scores, out)
    ground = f"no exact model: {scores.why_not_exact}"
    if scores.states is not None:
        ground = f"from an exact model of {scores.states:,} states and {scores.actions:,} actions"
    out.print(f"  {ground}", style="quiet")
    _print_discount(task, out)


def _print_measures(scores: Scores, out: Console) -> None:
    """Print the expected sum of each measure under the policies whose returns are printed."""
    table = Columns("  measure", *RETURNS, right=(1, 2, 3, 4), fold=(0,), styles=("quiet",))
    for name, under in scores.measures.items():
        table.add_row(f"  {name}", *(_measured(under[policy]) for policy in RETURNS))
    if scores.measures:
        out.print(table)


def _measured(value: Return | None) -> str:
    if value is None:
        return ""
    if not value.episodes:
        return number(value.value, 6)
    mean, half = estimate(value.value, value.half)
    return f"{mean} ± {half}"


def _front(corners: Sequence[Expectations], measure: str) -> Iterator[Any]:
    table = Columns(f"  {measure}", "best return", right=(0, 1))
    every = -(-len(corners) // MOST_CORNERS)
    shown = [*corners[:-1:every], corners[-1]]
    for corner in shown:
        table.add_row(f"  {number(corner.measures[measure], 6)}", number(corner.value, 8))
    yield table
    remark = "between two rows the best return is on the line from one to the other"
    if every > 1:
        remark = f"{len(shown)} of {len(corners)} corners; `--json` has all of them"
    yield VisibleText(f"  {remark}", style="quiet")


def _return(value: Return | None) -> tuple[str, str]:
    if value is None:
        return "unknown", ""
    if not value.episodes:
        sure: str = value.status
        if value.bound > 1e-10 * abs(value.value):
            sure = f"± {value.bound:.2g}, {sure}"
        return number(value.value, 10), sure
    mean, half = estimate(value.value, value.half)
    if not math.isfinite(value.value):
        return mean, f"({value.episodes:,} episodes)"
    if not value.half:
        return mean, f"in all of {value.episodes:,} episodes"
    return mean, f"± {half} (95 % CI, {value.episodes:,} episodes)"


def _bound(value: Any, remark: str, why_not: str | None) -> tuple[str, str, str]:
    from taskspec.exact import Return

    if value is None:
        return "unknown", "", why_not or ""
    if value.error <= 1e-9 * abs(value.value):
        return *_return(Return(value.value, bound=value.error)), remark
    low, high = value.ends
    return f"{number(low)} to {number(high)}", "proved bounds", remark


def _print_score(task: Task, result: Score) -> None:
    out = console()
    low, high = result.interval()
    interval = f"   95 % confidence: {decimal(low)} to {decimal(high)}"
    out.print(line((task.id, "name"), "  score ", (decimal(result.normalised), "title"), (interval, "quiet")))
    known = []
    for name in ("random", "expert", "optimal"):
        end = getattr(result.scores, name)
        if end is not None:
            known.append(f"{name} {decimal(end.value)}")
    value = result.value
    mean = f"mean return {decimal(value.value)} over {value.episodes:,} episodes"
    out.print(f"  {mean}; {', '.join(known)}", style="quiet")
    _print_discount(task, out)


def _print_discount(task: Task, out: Console) -> None:
    if task.discount != 1:
        out.print(f"  discounted by {task.discount:g} a step", style="quiet")
