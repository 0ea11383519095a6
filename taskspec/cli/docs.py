"""`taskspec docs` and `taskspec figure`: tasks in print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError, raise_if_errors
from taskspec.base.numbers import plural
from taskspec.cli.console import say
from taskspec.cli.failures import misuse, show
from taskspec.cli.options import Json, LimitsGiven, Modifiers, Parameters, Targets, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.pages.facts import Facts
    from taskspec.task.task import Task

FORMATS = ("html", "latex", "markdown", "svg", "pdf")
Format = Annotated[
    list[str] | None,
    typer.Option(
        "--format", "-f", metavar="|".join(FORMATS), help="What to write; may be repeated. HTML by default.",
        autocompletion=lambda: FORMATS, show_default=False,
    ),
]  # fmt: skip
Output = Annotated[
    Path, typer.Option("--output", "--out", "-o", metavar="FOLDER", help="Where to write.", file_okay=False)
]
Results = Annotated[bool, typer.Option("--results/--no-results", help="Scores, and the verdicts on claims.")]
Brief = Annotated[bool, typer.Option("--brief", help="Half a page for each task: its definition, figure and scores.")]
Title = Annotated[
    str, typer.Option("--title", help="Title of the document; the suite's name by default.", show_default=False)
]
FigureFile = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Output file, ending in .svg, .tex, .png or .pdf.",
        dir_okay=False,
        show_default=False,
    ),
]
Overlays = Annotated[
    list[str] | None,
    typer.Option(
        "--overlay", metavar="values|policy|expert|occupancy",
        help="Lay exact results over the states; may be repeated, or given with commas.",
        autocompletion=lambda: ("values", "policy", "expert", "occupancy"), show_default=False,
    ),
]  # fmt: skip


def docs(
    targets: Targets = None,
    format: Format = None,
    output: Output = Path("build/docs"),
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    results: Results = True,
    brief: Brief = False,
    title: Title = "",
    json: Json = False,
    limits: LimitsGiven = None,
) -> None:
    """Write the appendix of a paper: every task with its figure.

    For an experiment, its tasks with all its settings side by side. With [green]-p[/], also equations, scores, claims and
    figures at these values.

    As a static site (html), files to include in a paper and a standalone document (latex, pdf), or for a repository
    (markdown). Returns and verdicts on claims are computed for this, where SciPy is installed.

    A spec with an error is reported and left out; exit status 1 then.
    """
    from taskspec import pages
    from taskspec.base.files import near
    from taskspec.cli.console import write_json
    from taskspec.cli.progress import progress
    from taskspec.targets import settings

    wanted = _named("--format", format or ["html"], FORMATS)
    columns = settings(parameters) if parameters else ()
    with progress("docs"):
        built, problems = tasks_of(targets or [], modifiers or [])
        tasks, warnings, unsound = _printable(built)
        problems += unsound
        if not tasks:
            raise SpecError(problems)
        facts = _facts_of(tasks, problems) if results and has_scores() else {}
        written = pages.write(tasks, wanted, output, title=title, facts=facts, columns=columns, brief=brief)
    show([*problems, *warnings])
    _is_something(written)
    if json:
        write_json([str(path) for path in written])
    else:
        count = len({task.id for task in tasks})
        say(f"wrote {plural(len(written), 'file')} on {plural(count, 'task')} to {near(output)}")
    if problems:
        raise typer.Exit(1)


def _is_something(written: Sequence[Path]) -> None:
    from taskspec.figures import HINT

    if not written:  # of figures alone, as every task has a page
        raise SpecError((Diagnostic("E713", None, "there is no figure to write", HINT),))


def figure(
    task: TaskArgument,
    output: FigureFile,
    overlays: Overlays = None,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
) -> None:
    """Draw the figure of a task, as SVG, TikZ, PNG or PDF.

    The states can be overlaid with their optimal values, the optimal or the expert's actions, and how often they are visited.
    """
    from taskspec import pages
    from taskspec.targets import beside, tasks_of

    found = tasks_of(task, variant, parameters or [], modifiers or [])
    wanted = _named("--overlay", overlays or [], pages.OVERLAYS)
    for each in found:
        say(f"wrote {pages.figure(each, output if len(found) == 1 else beside(output, each), wanted)}")


def tasks_of(targets: Sequence[str], modifiers: Sequence[str] = ()) -> tuple[list[Task], list[Diagnostic]]:
    """Return all tasks of ids, files and folders, and the instances of experiments that are named; and what is wrong with
    others.

    Raises:
        SpecError: for a target that does not exist.
    """
    from taskspec.targets import files_of, kind_of, tasks_in

    named = [target for target in targets if kind_of(target) == "experiment"]
    others = [target for target in targets if target not in named]
    files = files_of(others, modifiers=modifiers) if others or not named else []
    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    for found in tasks_in(files):
        if isinstance(found, SpecError):
            problems += found.diagnostics
        else:
            tasks.append(found)
    for target in named:
        try:
            tasks += _instances(target, modifiers)
        except SpecError as error:
            problems += error.diagnostics
    return tasks, problems


def _printable(tasks: Sequence[Task]) -> tuple[list[Task], list[Diagnostic], list[Diagnostic]]:
    """Return the tasks that can be printed, warnings about their figures, and what is wrong with the others."""
    from taskspec import pages
    from taskspec.check.warnings import set_aside

    found: list[Task] = []
    warnings: list[Diagnostic] = []
    problems: list[Diagnostic] = []
    for task in tasks:
        try:
            undrawn = pages.undrawn(task)
        except SpecError as error:
            problems += error.diagnostics
            continue
        found.append(task)
        warnings += set_aside(task, undrawn)[0]
    return found, warnings, problems


def _instances(target: str, modifiers: Sequence[str]) -> list[Task]:
    """Return the tasks of an experiment.

    Raises:
        SpecError: when it has a mistake.
    """
    from taskspec.experiments import expand, read
    from taskspec.registry import load

    found = expand(read(target))
    raise_if_errors([*found.diagnostics, *found.refused])
    return [
        load(each.source, each.variant, modifiers=(*each.modifiers, *modifiers), **each.parameters)
        for each in found.instances
    ]


def has_scores() -> bool:
    """Return whether scores can be worked out, for which SciPy is needed; where it is missing, standard error says so."""
    from taskspec.base.extras import install, is_installed

    if is_installed("scipy"):
        return True
    say(f"scores and verdicts need scipy, and are left out: {install('exact')}", err=True)
    return False


def _facts_of(tasks: Sequence[Task], problems: list[Diagnostic]) -> dict[str, Facts]:
    """Return scores and verdicts at the defaults, by id of the task; those of other settings are gathered with its page.

    Why a task has none is added to the problems.
    """
    from taskspec.base.limits import telling
    from taskspec.pages.facts import gather
    from taskspec.pages.write import together

    tasks = [task for task, _ in together(tasks)]
    found = {}
    for task in telling(tasks, lambda task: f"scores of {task.id}"):
        try:
            found[task.id] = gather(task)
        except SpecError as error:
            problems += error.diagnostics
    return found


def _named(option: str, texts: Sequence[str], allowed: Sequence[str]) -> list[str]:
    """Return the names in an option; several may stand in one, with commas between them."""
    wanted = [name.strip() for text in texts for name in text.split(",")]
    for name in wanted:
        if name not in allowed:
            raise misuse(f"{option} is one of {', '.join(allowed)}, not '{name}'")
    return wanted
