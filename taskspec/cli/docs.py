"""`taskspec docs`: tasks in print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.base.files import near
from taskspec.cli import options
from taskspec.cli.console import print_diagnostics, progress, say, write_json

if TYPE_CHECKING:
    from taskspec.language.task.task import Task

FORMATS = ("html", "latex", "markdown", "svg", "pdf")
Results = Annotated[bool, Option("--results/--no-results", help="Scores, and the verdicts on claims.")]
Brief = Annotated[
    bool | None,
    Option(
        "--brief/--full",
        help="Half a page for each task: its definition, figure and scores. By default, LaTeX and PDF of more than three tasks.",
    ),
]
MOST_IN_FULL = 3
"""From more tasks than these on, what is written for paper is brief."""
ON_PAPER = {"latex", "pdf", "svg"}
Title = Annotated[str, Option("--title", help="Title of the document; the suite's name by default.")]


def docs(
    targets: options.Targets = None,
    format: Annotated[
        list[str] | None, options.formats_option(FORMATS, "What to write; may be repeated. HTML by default.")
    ] = None,
    output: Annotated[Path, options.folder_option("Where to write.")] = Path("build/docs"),
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    results: Results = True,
    brief: Brief = None,
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
    from taskspec.show import pages
    from taskspec.show.bibliography import unknown_sources
    from taskspec.show.figures import HINT, undrawn
    from taskspec.show.pages.write import facts_of
    from taskspec.tools.targets import all_tasks, settings

    wanted = options.checked_choices("--format", format or ["html"], (*FORMATS, "md"))
    wanted = ["markdown" if name == "md" else name for name in wanted]
    columns = settings(parameters) if parameters else ()
    tasks: list[Task] = []
    warnings: list[Diagnostic] = []
    with progress("docs"):
        built, problems = all_tasks(targets or [], modifiers or [])
        for task in built:
            try:
                missing = undrawn(task)
            except SpecError as error:
                problems += error.diagnostics
            else:
                tasks.append(task)
                warnings += set_aside(task, [*missing, *unknown_sources(task)])[0]
        if not tasks:
            raise SpecError(problems)
        facts = {}
        if results:
            facts = facts_of(tasks, problems)
        if brief is None:
            brief = set(wanted) <= ON_PAPER and len({task.id for task in tasks}) > MOST_IN_FULL
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
