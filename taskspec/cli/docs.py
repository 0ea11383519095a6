"""`taskspec docs`, `taskspec card` and `taskspec figure`: tasks in print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.base.files import near
from taskspec.base.limits import telling
from taskspec.cli import options
from taskspec.cli.console import print_diagnostics, say, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.language.task.task import Task
    from taskspec.show.pages.facts import Facts

FORMATS = ("html", "latex", "markdown", "svg", "pdf")
OVERLAYS = ("values", "policy", "expert", "occupancy")
Results = Annotated[bool, Option("--results/--no-results", help="Scores, and the verdicts on claims.")]
Brief = Annotated[bool, Option("--brief", help="Half a page for each task: its definition, figure and scores.")]
Title = Annotated[str, Option("--title", help="Title of the document; the suite's name by default.")]
FigureFile = Annotated[
    Path | None,
    Option(
        "--output", "-o", metavar="FILE", dir_okay=False,
        help="Output file, ending in .svg, .tex, .png or .pdf; by default an SVG file with the task's name.",
    ),
]  # fmt: skip
Overlays = Annotated[
    list[str] | None,
    options.choices_option(
        "--overlay", allowed=OVERLAYS, help="Lay exact results over the states; may be repeated, or given with commas."
    ),
]


def docs(
    targets: options.Targets = None,
    format: Annotated[
        list[str] | None, options.formats_option(FORMATS, "What to write; may be repeated. HTML by default.")
    ] = None,
    output: Annotated[Path, options.folder_option("Where to write.")] = Path("build/docs"),
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    results: Results = True,
    brief: Brief = False,
    title: Title = "",
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Write the appendix of a paper: every task with its figure.

    For an experiment, its tasks with all its settings side by side. With [green]-p[/], also equations, scores, claims and
    figures at these values.

    As a static site (html), files to include in a paper and a standalone document (latex, pdf), or for a repository
    (markdown). Returns and verdicts on claims are computed for this.

    A spec with an error is reported and left out; exit status 1 then.
    """
    from taskspec.exact.check.report import set_aside
    from taskspec.language.targets import settings
    from taskspec.show import pages
    from taskspec.show.figures import HINT

    wanted = options.checked_choices("--format", format or ["html"], FORMATS)
    columns = settings(parameters) if parameters else ()
    tasks: list[Task] = []
    warnings: list[Diagnostic] = []
    with progress("docs"):
        built, problems = tasks_of(targets or [], modifiers or [])
        for task in built:
            try:
                undrawn = pages.undrawn(task)
            except SpecError as error:
                problems += error.diagnostics
            else:
                tasks.append(task)
                warnings += set_aside(task, undrawn)[0]
        if not tasks:
            raise SpecError(problems)
        facts = _facts_of(tasks, problems) if results else {}
        written = pages.write(tasks, wanted, output, title=title, facts=facts, columns=columns, brief=brief)
    print_diagnostics([*problems, *warnings])
    if not written:  # of figures alone, as every task has a page
        raise spec_error("E713", "there is no figure to write", HINT)
    if json:
        write_json(list(map(str, written)))
    else:
        count = len({task.id for task in tasks})
        say(f"wrote {plural(len(written), 'file')} on {plural(count, 'task')} to {near(output)}")
    if problems:
        raise typer.Exit(1)


def tasks_of(targets: Sequence[str], modifiers: Sequence[str] = ()) -> tuple[list[Task], list[Diagnostic]]:
    """Return all tasks of ids, files and folders, and of experiments that are named, and what is wrong with others."""
    from taskspec.experiments import expand, read
    from taskspec.language.modifiers import modify
    from taskspec.language.targets import files_of, kind_of, tasks_in

    named = [target for target in targets if kind_of(target) == "experiment"]
    others = [target for target in targets if target not in named]
    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    if others or not named:
        for found in tasks_in(files_of(others, modifiers=modifiers)):
            if isinstance(found, SpecError):
                problems += found.diagnostics
            else:
                tasks.append(found)
    for target in named:
        try:
            tasks += [modify(task, *modifiers) for task in expand(read(target)).tasks()]
        except SpecError as error:
            problems += error.diagnostics
    return tasks, problems


def _facts_of(tasks: Sequence[Task], problems: list[Diagnostic]) -> dict[str, Facts]:
    from taskspec.show.pages.facts import gather
    from taskspec.show.pages.write import together

    found = {}
    printed = [task for task, _ in together(tasks)]
    for task in telling(printed, lambda task: f"scores of {task.id}"):
        try:
            found[task.id] = gather(task)
        except SpecError as error:
            problems += error.diagnostics
    return found


def card(
    task: options.TaskArgument,
    format: Annotated[str, Option("--format", "-f", metavar="md|json", help="Markdown, or JSON-LD.")] = "md",
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    limits: options.LimitsGiven = None,
) -> None:
    """Print the card of a task, for papers, data sets and hubs.

    Name, version, capability, sources, parameters, spaces, horizon, returns, claims and licence: as Markdown with front
    matter, or as JSON-LD in the terms of schema.org.
    """
    from taskspec.language.targets import task_of
    from taskspec.show.pages import card as cards
    from taskspec.show.pages.facts import gather

    options.checked_choice("--format", format, ("md", "json"))
    found = task_of(task, variant, parameters or [], modifiers or [])
    with progress("scores"):
        facts = gather(found)
    content = cards.linked_data(found, facts)
    if format == "json":
        write_json(content)
    else:
        say(cards.markdown(content), nl=False)


def figure(
    task: options.TaskArgument,
    output: FigureFile = None,
    overlays: Overlays = None,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
) -> None:
    """Draw the figure of a task, as SVG, TikZ, PNG or PDF.

    The states can be overlaid with their optimal values, the optimal or the expert's actions, and how often they are visited.
    """
    from taskspec.language.targets import beside, tasks_of
    from taskspec.show import pages
    from taskspec.show.pages.page import anchor

    found = tasks_of(task, variant, parameters or [], modifiers or [])
    if output is None:
        output = Path(f"{anchor(found[0].name)}.svg")
    wanted = options.checked_choices("--overlay", overlays, OVERLAYS)
    for each in found:
        place = output if len(found) == 1 else beside(output, each)
        say(f"wrote {pages.figure(each, place, wanted)}")
