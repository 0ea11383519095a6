"""`taskspec build`: checks specs, and writes everything that comes from them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.base.limits import telling
from taskspec.cli.console import fail, print_diagnostics, progress, say
from taskspec.cli.options import LimitsGiven, Targets, folder_option
from taskspec.show.terminal.styled_text import console, line

if TYPE_CHECKING:
    from taskspec.exact.check.report import Report
    from taskspec.language.task.task import Task


def build(
    targets: Targets = None,
    output: Annotated[Path, folder_option("Where to write.")] = Path("build"),
    limits: LimitsGiven = None,
) -> None:
    """Check specs and write everything that comes from them.

    An index of the tasks, their scores, the generated code, the schema for editors, and the documentation as a site
    (html), for a paper (latex) and for a repository (markdown). Nothing is written if a spec has an error.
    """
    from taskspec.cli import check_text
    from taskspec.show.pages.write import TaskResults, write_build
    from taskspec.tools.authoring.checks import check_file, counts, examine, problems_of
    from taskspec.tools.targets import files_of

    start = time.perf_counter()
    results = TaskResults()

    def prove(task: Task) -> Report:
        report = examine(task)
        results.add(report)
        return report

    with progress("check"):
        files = telling(files_of(targets or []), lambda file: str(file.path))
        reports = [check_file(file, prove) for file in files]
    problems = problems_of(reports)
    print_diagnostics(problems, err=False)
    if problems:
        say("")
    check_text.print_table(reports)
    check_text.print_verdict(reports, time.perf_counter() - start)
    if counts(problems)[0]:
        say("nothing was written", err=True)
        raise typer.Exit(1)
    with progress("write"):
        tasks = []
        for checked in check_text.tasks_of(reports):
            if checked.task is not None:
                tasks.append(checked.task)
        written = list(write_build(tasks, results, output))
    for path, content in written:
        console(wide=True).print(line("wrote ", (str(path), "name"), (f"  {content}", "quiet")))
    if results.problems:
        fail(results.problems)
