"""`taskspec separate` and `taskspec freeze`: a small task that tells two learners apart, and instances as tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from taskspec.base.display import fixed, interval
from taskspec.base.files import near, write_text
from taskspec.base.limits import tell
from taskspec.base.terminal import console, line
from taskspec.cli import options
from taskspec.cli.console import misuse, say, write_json, write_output
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.learn.experiments.separate import Separation

FAMILY = "families/tables"
Learner = Annotated[
    str,
    Argument(
        metavar="A", autocompletion=options.complete_learners, help="A learner, as [cyan]FILE.py:train[/] or by name."
    ),
]
Opponent = Annotated[
    str | None,
    Argument(
        metavar="[B]", autocompletion=options.complete_learners,
        help="Another one; right Q-learning unless given, on tasks that right learners master.",
    ),
]  # fmt: skip
Family = Annotated[
    str,
    Option(
        "--in", metavar="EXPERIMENT", autocompletion=options.complete_experiments,
        help="Tasks to search: an experiment, by its path or name, or a suite.",
    ),
]  # fmt: skip
Output = Annotated[Path, options.file_option("--output", "-o", help="The spec; separates.yaml by default.")]


def separate(
    first: Learner,
    second: Opponent = None,
    family: Family = FAMILY,
    minutes: Annotated[float, Option("--minutes", help="Time that the search may take.")] = 3.0,
    steps: Annotated[int, Option("--steps", min=1, help="Environment steps of each training run.")] = 3000,
    seed: Annotated[int, options.seed_option("Seed of the search.")] = 0,
    output: Output = Path("separates.yaml"),
    jobs: options.Jobs = None,
    json: options.Json = False,
) -> None:
    """Find the smallest task on which a learner does worse than another.

    Many instances of a family are tried, the best of them is tested on fresh seeds, shrunk while the difference holds, and
    tested on fresh seeds again. Ctrl-C ends the search, and keeps the best task so far.
    """
    from taskspec.learn.exam.examinee import learner_of
    from taskspec.learn.experiments.races import family_of
    from taskspec.learn.experiments.separate import Search

    if not minutes > 0:
        raise misuse(f"--minutes is a number above 0, not {minutes:g}")
    tasks = family_of(family)
    if second is None:
        opponent = None
    else:
        opponent = learner_of(second)
    search = Search(
        tasks, learner_of(first), opponent, seed=seed, steps=steps, minutes=minutes, workers=jobs, progress=tell
    )
    with progress("searching"):
        separation = search.run()
    _report(separation, family, output, json)


def _report(separation: Separation, family: str, output: Path, json: bool) -> None:
    """Print the result of a search, and write its spec."""
    from taskspec.exact.tables.frozen_task import FrozenTask
    from taskspec.exact.tables.spec_text import spec_text
    from taskspec.learn.experiments.separate import finding

    if json:
        write_json(_record(separation))
        return
    worse = separation.worse
    better = separation.better
    if not worse:
        say(f"No difference found in {separation.tried} tasks of {family}.")
        return
    out = console()
    out.print(line((worse, "bad"), " is worse than ", (better, "good"), f": {separation.path[-1]}"))
    width = max(len(worse), len(better))
    for name, (mean, low, high) in zip((worse, better), separation.intervals, strict=True):
        out.print(line(f"  {name:{width}}  {fixed(mean, 2):>5}  {interval(low, high)}"))
    seeds = f"{len(separation.scores[0])} fresh seeds, p = {separation.p_value:.2g}"
    out.print(line((f"  {seeds}; {separation.tried} tasks tried", "quiet")))
    if len(separation.path) > 1:
        out.print(line((f"  shrunk from {separation.path[0]}", "quiet")))
    if not separation.is_complete:
        out.print(line(("  the search was stopped before it ended", "quiet")))
    if isinstance(separation.task, FrozenTask):
        text = spec_text(finding(separation, family))
        write_text(output, text)
        say("\n" + text[text.index("state:") :])
        say(f"wrote {near(output)}")


def _record(separation: Separation) -> dict[str, Any]:
    """Return the result of a search as JSON data; its task as a spec, or by its id."""
    from taskspec.exact.tables.frozen_task import FrozenTask
    from taskspec.exact.tables.spec_text import spec_text

    names = ("worse", "better", "scores", "p_value", "tried", "path", "is_complete")
    record: dict[str, Any] = {name: getattr(separation, name) for name in names}
    record["means"] = []
    if separation.worse:
        record["means"] = [{"mean": mean, "low": low, "high": high} for mean, low, high in separation.intervals]
    record["task"] = None
    if isinstance(separation.task, FrozenTask):
        record["task"] = spec_text(separation.task)
    elif separation.task is not None:
        record["task"] = separation.task.id
    return record


def freeze(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    seed: Annotated[int | None, Option("--seed", min=0, metavar="SEED", help="Seed of the instance.")] = None,
    output: Annotated[
        Path | None, options.file_option("--output", "-o", help="The spec; standard output by default.")
    ] = None,
) -> None:
    """Write a finite task as a spec of tables, without draws of constants.

    States that no episode visits are left out; exact returns become claims.
    """
    from taskspec.exact.tables.freeze import freeze as frozen
    from taskspec.exact.tables.spec_text import spec_text
    from taskspec.language.targets import task_of

    given = list(parameters or [])
    if seed is not None:
        given.append(f"instance_seed={seed}")
    write_output(spec_text(frozen(task_of(task, variant, given, modifiers or []))), output)
