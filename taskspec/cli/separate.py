"""`taskspec separate` and `taskspec freeze`: a small task that tells two learners apart, and instances as tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import fixed, interval
from taskspec.base.files import near, write_text
from taskspec.base.limits import tell
from taskspec.cli import options
from taskspec.cli.console import console, line, misuse, say, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.experiments.separate import Separation

FAMILY = "families/tables"
Learner = Annotated[
    str,
    typer.Argument(
        metavar="A", show_default=False, autocompletion=options.complete_learners,
        help="A learner, as [cyan]FILE.py:train[/] or by name.",
    ),
]  # fmt: skip
Opponent = Annotated[
    str | None,
    typer.Argument(
        metavar="[B]", show_default=False, autocompletion=options.complete_learners,
        help="Another one; right Q-learning unless given, on tasks that right learners master.",
    ),
]  # fmt: skip
Family = Annotated[
    str,
    typer.Option(
        "--in", metavar="EXPERIMENT", autocompletion=options.complete_experiments,
        help="Tasks to search: an experiment with a sample of instances, by its path or name.",
    ),
]  # fmt: skip


def separate(
    first: Learner,
    second: Opponent = None,
    family: Family = FAMILY,
    minutes: Annotated[float, typer.Option("--minutes", help="Time that the search may take.")] = 3.0,
    steps: Annotated[int, typer.Option("--steps", min=1, help="Environment steps of each training run.")] = 3000,
    seed: Annotated[int, options.seed_option("Seed of the search.")] = 0,
    output: Annotated[Path, options.file_option("--output", "-o", help="The spec; separates.yaml by default.")] = Path(
        "separates.yaml"
    ),
    jobs: options.Jobs = None,
    json: options.Json = False,
) -> None:
    """Find the smallest task on which a learner does worse than another.

    Many instances of a family are tried, the best of them is tested on fresh seeds, shrunk while the difference holds, and
    tested on fresh seeds again. Ctrl-C ends the search, and keeps what was found.
    """
    from taskspec import experiments
    from taskspec.experiments.separate import Search, contestant

    if not minutes > 0:
        raise misuse(f"--minutes is a number above 0, not {minutes:g}")
    opponent = None if second is None else contestant(second)
    search = Search(
        experiments.read(family), contestant(first), opponent, seed=seed, steps=steps, minutes=minutes, workers=jobs,
        progress=tell,
    )  # fmt: skip
    with progress("searching"):
        found = search.run()
    _report(found, family, output, json)


def _report(found: Separation, family: str, output: Path, json: bool) -> None:
    """Print what was found, and write its spec."""
    from taskspec.exchange.tables import FrozenTask
    from taskspec.experiments.separate import finding

    if json:
        task = found.task
        means = [{"mean": mean, "low": low, "high": high} for mean, low, high in found.intervals if found.worse]
        write_json({
            "worse": found.worse, "better": found.better, "scores": found.scores, "means": means, "p_value": found.p_value,
            "tried": found.tried, "path": found.path, "is_complete": found.is_complete,
            "task": None if task is None else task.spec() if isinstance(task, FrozenTask) else task.id,
        })  # fmt: skip
        return
    if not found.worse:
        say(f"No difference found in {found.tried} tasks of {family}.")
        return
    out = console()
    out.print(line((found.worse, "bad"), " is worse than ", (found.better, "good"), f": {found.path[-1]}"))
    width = max(len(found.worse), len(found.better))
    for name, (mean, low, high) in zip((found.worse, found.better), found.intervals, strict=True):
        out.print(line(f"  {name:{width}}  {fixed(mean, 2):>5}  {interval(low, high)}"))
    out.print(
        line((f"  {len(found.scores[0])} fresh seeds, p = {found.p_value:.2g}; {found.tried} tasks tried", "quiet"))
    )
    if len(found.path) > 1:
        out.print(line((f"  shrunk from {found.path[0]}", "quiet")))
    if not found.is_complete:
        out.print(line(("  the search was stopped before it ended", "quiet")))
    if isinstance(found.task, FrozenTask):
        text = finding(found, family).spec()
        write_text(output, text)
        say("\n" + text[text.index("state:") :])
        say(f"wrote {near(output)}")


def freeze(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, metavar="SEED", help="Seed of the instance.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None, options.file_option("--output", "-o", help="The spec; standard output by default.")
    ] = None,
) -> None:
    """Write a finite task as a spec of tables, without draws of constants.

    States that no episode visits are left out; exact returns become claims.
    """
    from taskspec.exchange.freeze import freeze as frozen
    from taskspec.targets import tasks_of

    given = list(parameters or [])
    if seed is not None:
        given.append(f"instance_seed={seed}")
    found = tasks_of(task, variant, given, modifiers or [])
    if len(found) != 1:
        raise spec_error("E713", f"{task} names {len(found)} tasks; freeze one at a time")
    text = frozen(found[0]).spec()
    if output is None:
        sys.stdout.write(text)
        return
    write_text(output, text)
    say(f"wrote {near(output)}", err=True)
