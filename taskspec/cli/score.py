"""`taskspec score`: given returns, between random actions and the expert."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument

from taskspec.base.display import decimal
from taskspec.cli import options
from taskspec.cli.console import write_json
from taskspec.show.terminal.styled_text import console, line

if TYPE_CHECKING:
    from taskspec.exact import Score
    from taskspec.language.task.task import Task

ReturnsFile = Annotated[
    Path,
    Argument(
        metavar="RETURNS",
        help="Returns of episodes: JSON (as `run --json` writes), or CSV (a monitor file, or a column).",
    ),
]


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
    from taskspec.cli.solution_text import read_returns
    from taskspec.tools.targets import task_of

    built = task_of(task, variant, parameters or [], modifiers or [])
    known = None
    if scores is not None:
        known = exact.Scores.load(scores, built)
    result = exact.score(built, returns=read_returns(returns), known=known)
    if json:
        write_json({
            "score": result.normalised, "confidence_95": list(result.interval()), "episodes": result.value.episodes,
            "mean_return": result.value.value, "scores": result.scores.record(),
        })  # fmt: skip
    else:
        _print_score(built, result)


def _print_score(task: Task, result: Score) -> None:
    from taskspec.cli.solution_text import print_discount

    out = console()
    if isnan(result.normalised):
        score = "unknown"
        beside = "   neither the expert's return nor the optimal one is known"
        if result.scores.expert or result.scores.optimal:
            beside = "   random actions are as good as the best return that is known"
    else:
        score = decimal(result.normalised)
        low, high = result.interval()
        beside = f"   95 % confidence: {decimal(low)} to {decimal(high)}"
    out.print(line((task.id, "name"), "  score ", (score, "title"), (beside, "quiet")))
    known = []
    for name in ("random", "expert", "optimal"):
        value = getattr(result.scores, name)
        if value is not None:
            known.append(f"{name} {decimal(value.value)}")
    mean = f"mean return {decimal(result.value.value)} over {result.value.episodes:,} episodes"
    out.print(f"  {mean}; {', '.join(known)}", style="quiet")
    print_discount(task)
