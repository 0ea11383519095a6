"""`taskspec solve` and `taskspec score`: what returns are possible, and where given ones stand between them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.display import decimal, estimate, number
from taskspec.cli import options
from taskspec.cli.console import Console, console, line, write_json, write_records
from taskspec.cli.progress import progress
from taskspec.cli.tables import Columns

if TYPE_CHECKING:
    from taskspec.exact import Difficulty, PomdpBounds, Return, Score, Scores
    from taskspec.task.task import Task

ReturnsFile = Annotated[
    Path,
    typer.Argument(
        metavar="RETURNS", help="Returns of episodes: JSON (as `run --json` writes), or CSV (a monitor file, or a column).",
        show_default=False,
    ),
]  # fmt: skip


def solve(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    episodes: Annotated[int, typer.Option("--episodes", "-n", min=2, help="Used where simulation is needed.")] = 1000,
    seed: Annotated[int, options.seed_option("Used where simulation is needed.")] = 0,
    difficulty: Annotated[
        bool,
        typer.Option(
            "--difficulty", help="Measures of difficulty from theory besides: `docs/difficulty.md` lists them."
        ),
    ] = False,
    output: Annotated[Path | None, options.file_option("--output", "-o", help="Save the scores to this file.")] = None,
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Compute optimal, expert, random and worst return.

    Exactly where the task has an exact model, else from episodes, with a confidence interval. Where observations hide
    the state, also the best returns given observations alone: with memory, and without.
    """
    from taskspec import exact
    from taskspec.targets import beside, tasks_of

    records = []
    found = tasks_of(task, variant, parameters or [], modifiers or [])
    for each in found:
        with progress(each.instance_id):
            scores = exact.scores(each, episodes, seed)
            results = exact.Results(each)
            bounds = exact.pomdp_bounds(results)
            measures = exact.difficulty(results) if difficulty else None
        if output is not None:
            scores.save(output if len(found) == 1 else beside(output, each))
        if json:
            record = scores.record() | {"yardsticks": _bounds_record(bounds)}
            if measures is not None:
                record["difficulty"] = measures.record()
            records.append(record)
        else:
            _print_scores(each, scores, bounds)
            if measures is not None:
                _print_difficulty(measures, scores.why_not_exact)
    if json:
        write_records(records)


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
    from taskspec.scores.scores import read_returns
    from taskspec.targets import task_of

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


# -- output -------------------------------------------------------------------------------------------------------


def _bounds_record(bounds: PomdpBounds | None) -> dict[str, Any] | None:
    if bounds is None:
        return None
    values = {"remembering": bounds.remembering, "memoryless": bounds.memoryless}
    ends = {name: list(value.ends) if value is not None else None for name, value in values.items()}
    return {**ends, "why_not": bounds.why_not}


def _print_scores(task: Task, scores: Scores, bounds: PomdpBounds | None) -> None:
    from taskspec.task.record import settings

    out = console()
    out.print(line((task.id, "name"), (f"  {settings(task)}", "value")))
    table = Columns("", "", "", "", right=(1,), fold=(2, 3), styles=("quiet", "title", "", "quiet"))
    for name in ("optimal", "expert", "random", "worst"):
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
        table.add_row(f"  {name}", *_return(value), remark)
        if name == "optimal" and bounds is not None:
            remark = "given all observations and actions so far"
            table.add_row("  remembering", *_bound(bounds.remembering, remark, bounds.why_not))
            table.add_row("  memoryless", *_bound(bounds.memoryless, "", bounds.why_not))
    out.print(table)
    ground = f"no exact model: {scores.why_not_exact}"
    if scores.states is not None:
        ground = f"from an exact model of {scores.states:,} states and {scores.actions:,} actions"
    out.print(f"  {ground}", style="quiet")
    _print_discount(task, out)


def _return(value: Return | None) -> tuple[str, str]:
    """Return a return, and how sure it is."""

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
    return mean, f"± {half} (95 % CI, {value.episodes:,} episodes)"


def _bound(value: Any, remark: str, why_not: str | None) -> tuple[str, str, str]:
    """Return the best return given observations only, how sure it is, and a remark."""
    from taskspec.exact import Return

    if value is None:
        return "unknown", "", why_not or ""
    if value.error <= 1e-9 * abs(value.value):
        return *_return(Return(value.value, bound=value.error)), remark
    low, high = value.ends
    return f"{number(low)} to {number(high)}", "proved bounds", remark


def _print_discount(task: Task, out: Console) -> None:
    if task.discount != 1:
        out.print(f"  discounted by {task.discount:g} a step", style="quiet")


def _print_difficulty(measures: Difficulty, known: str | None) -> None:
    """Print the measures; the reason that has been given for having no model is not given again."""
    table = Columns("  difficulty", "", "", right=(1,), fold=(2,), styles=("", "", "quiet"))
    for name, value, unit, _ in measures.rows():
        reason = measures.why_not.get(name, unit)
        table.add_row(f"  {name}", number(value) if value is not None else "unknown", reason if reason != known else "")
    console().print(table)


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
