"""`taskspec separate` and `taskspec freeze`: a small task that tells two learners apart, and instances as tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from taskspec.base.display import fixed, interval
from taskspec.base.files import near, safe_name, write_text
from taskspec.base.limits import tell
from taskspec.cli import options
from taskspec.cli.console import VisibleText, console, line, misuse, say, write_json, write_output
from taskspec.cli.progress import progress
from taskspec.cli.tables import Columns

if TYPE_CHECKING:
    from taskspec.experiments import ExperimentFile
    from taskspec.learn.experiments.cover import Covering
    from taskspec.learn.experiments.separate import Separation

FAMILY = "families/tables"
Learner = Annotated[
    str | None,
    Argument(
        metavar="[A]", autocompletion=options.complete_learners, help="A learner, as [cyan]FILE.py:train[/] or by name."
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
Zoo = Annotated[
    Path | None,
    Option(
        "--cover", metavar="ZOO.yaml",
        help="In place of A and B: a file of right learners and their mistakes, each of which a small set of tasks separates.",
    ),
]  # fmt: skip
Output = Annotated[
    Path | None,
    Option(
        "--output", "-o", metavar="FILE|FOLDER",
        help="The spec, separates.yaml by default; with --cover a folder of specs, build/covers/ZOO by default.",
    ),
]  # fmt: skip


def separate(
    first: Learner = None,
    second: Opponent = None,
    zoo: Zoo = None,
    family: Family = FAMILY,
    minutes: Annotated[float, Option("--minutes", help="Time that the search may take.")] = 3.0,
    steps: Annotated[int, Option("--steps", min=1, help="Environment steps of each training run.")] = 3000,
    seed: Annotated[int, options.seed_option("Seed of the search.")] = 0,
    output: Output = None,
    jobs: options.Jobs = None,
    json: options.Json = False,
) -> None:
    """Find the smallest task on which a learner does worse than another.

    Many instances of a family are tried, the best of them is tested on fresh seeds, shrunk while the difference holds, and
    tested on fresh seeds again. Ctrl-C ends the search, and keeps what was found.

    With --cover, find the smallest set of tasks that separates every mistake of a zoo from its right version. The same command
    goes on with a search that was stopped.
    """
    from taskspec.learn.experiments.races import contestant, family_of

    if not minutes > 0:
        raise misuse(f"--minutes is a number above 0, not {minutes:g}")
    if (first is None) == (zoo is None):
        raise misuse("give a learner, or a zoo of learners with --cover", "taskspec separate wrong.py:train")
    tasks = family_of(family)
    if zoo is not None:
        _cover(zoo, tasks, family, seed, steps, minutes, output, jobs, json)
        return
    from taskspec.learn.experiments.separate import Search

    assert first is not None
    opponent = None if second is None else contestant(second)
    search = Search(
        tasks, contestant(first), opponent, seed=seed, steps=steps, minutes=minutes, workers=jobs, progress=tell
    )
    with progress("searching"):
        found = search.run()
    _report(found, family, output or Path("separates.yaml"), json)


def _cover(
    zoo: Path, tasks: ExperimentFile, family: str, seed: int, steps: int, minutes: float, output: Path | None,
    jobs: int | None, json: bool,
) -> None:  # fmt: skip
    """Search for the tasks that separate the mistakes of a zoo, print them, and write their specs."""
    from taskspec.base.jobs.store import Store
    from taskspec.learn.experiments.cover import CoverSearch, read_zoo

    mistakes = read_zoo(zoo)
    folder = output or Path("build/covers") / safe_name(zoo.stem)
    with Store(folder / "races.sqlite") as store, progress("searching"):
        found = CoverSearch(tasks, mistakes, store, seed, steps, minutes, jobs).run()
    if json:
        write_json(found.data())
    else:
        _print_cover(found, family, folder)


def _print_cover(found: Covering, family: str, folder: Path) -> None:
    """Print the scores of all learners on the tasks of the set, and write their specs."""
    if not found.tasks:
        say(f"No mistake is separated by {found.tried} tasks of {family}.")
        return
    titles = [f"task {i + 1}" for i in range(len(found.tasks))]
    table = Columns("learner", *titles, right=range(1, len(titles) + 1), names=0)
    right = {each.right.name for each in found.mistakes}
    for name in found.learners:
        cells: list[VisibleText] = []
        for task in found.tasks:
            mean = task.mean(name)
            mark = "✗" if name in task.separated else " "
            cells.append(
                VisibleText("" if mean is None else f"{fixed(mean, 2)} {mark}", "bad" if mark == "✗" else "quiet")
            )
        table.add_row(VisibleText(name, "good" if name in right else ""), *cells)
    out = console()
    out.print(table)
    for title, task in zip(titles, found.tasks, strict=True):
        text = task.spec(title.title().replace(" ", ""))
        place = task.instance.id
        if text is not None:
            path = folder / f"{title.replace(' ', '_')}.yaml"
            write_text(path, text)
            place = str(near(path))
        out.print(line(f"{title}: {task.size}, ", (place, "quiet")))
    say(f"✗ worse than the right version on fresh seeds; {found.tried} tasks of {family} tried")
    if found.missing:
        say(f"not separated: {', '.join(found.missing)}")
    if not found.is_complete:
        say("the search was stopped for lack of time; the same command goes on with it")


def _report(found: Separation, family: str, output: Path, json: bool) -> None:
    """Print what was found, and write its spec."""
    from taskspec.learn.experiments.separate import finding
    from taskspec.tools.exchange.spec_text import spec_text
    from taskspec.tools.exchange.tables import FrozenTask

    if json:
        task = found.task
        means = [{"mean": mean, "low": low, "high": high} for mean, low, high in found.intervals if found.worse]
        write_json({
            "worse": found.worse, "better": found.better, "scores": found.scores, "means": means, "p_value": found.p_value,
            "tried": found.tried, "path": found.path, "is_complete": found.is_complete,
            "task": None if task is None else spec_text(task) if isinstance(task, FrozenTask) else task.id,
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
        text = spec_text(finding(found, family))
        write_text(output, text)
        say("\n" + text[text.index("state:") :])
        say(f"wrote {near(output)}")


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
    from taskspec.language.targets import task_of
    from taskspec.tools.exchange.freeze import freeze as frozen
    from taskspec.tools.exchange.spec_text import spec_text

    given = list(parameters or [])
    if seed is not None:
        given.append(f"instance_seed={seed}")
    write_output(spec_text(frozen(task_of(task, variant, given, modifiers or []))), output)
