"""`taskspec solve`: the returns that are possible in a task."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import progress, write_records

Episodes = Annotated[int, Option("--episodes", "-n", min=2, help="Used where simulation is needed.")]
DifficultyAsked = Annotated[
    bool,
    Option("--difficulty", help="Measures of difficulty from theory besides: `docs/explain/difficulty.md` lists them."),
]
LimitMeasure = Annotated[
    list[str] | None,
    Option("--limit-measure", metavar="LIMIT", help="Also the best return within a limit on a measure: `cost<=1`."),
]
Front = Annotated[
    str | None, Option("--front", metavar="MEASURE", help="Also the best return for each value of a measure.")
]


def solve(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    episodes: Episodes = 1000,
    seed: Annotated[int, options.seed_option("Used where simulation is needed.")] = 0,
    difficulty: DifficultyAsked = False,
    limit_measure: LimitMeasure = None,
    front: Front = None,
    output: Annotated[Path | None, options.file_option("--output", "-o", help="Save the scores to this file.")] = None,
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Compute optimal, expert, random and worst return.

    Exactly where the task has an exact model, else from episodes, with a confidence interval. Where observations hide
    the state, also the best returns given observations alone: with memory, and without. Where the task has measures,
    their expected sums under the same policies.
    """
    from taskspec.cli.solution_text import print_solution
    from taskspec.cli.solution_text import solve as solved
    from taskspec.tools.targets import tasks_of, with_files

    records = []
    tasks = tasks_of(task, variant, parameters or [], modifiers or [])
    for each, place in with_files(tasks, output or Path("scores.json")):
        with progress(each.instance_id):
            solution = solved(each, episodes, seed, difficulty, limit_measure or [], front)
        if output is not None:
            solution.scores.save(place)
        if json:
            records.append(solution.record())
        else:
            print_solution(solution)
    if json:
        write_records(records)
