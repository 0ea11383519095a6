"""`taskspec build`: checks specs, and writes everything that comes from them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base import __version__
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.display import visible_json
from taskspec.base.files import safe_name, write_text
from taskspec.base.limits import tell, telling
from taskspec.base.terminal import console, line
from taskspec.cli.check import examine, print_reports, verdict
from taskspec.cli.console import fail, say
from taskspec.cli.options import LimitsGiven, Targets, folder_option
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.exact.check.report import Report
    from taskspec.language.task.task import Task
    from taskspec.show.pages.facts import Facts

DOCS = {
    "html": "the documentation as a site: open index.html",
    "latex": "the documentation for a paper: include appendix.tex",
    "markdown": "the documentation for a repository",
}


def build(
    targets: Targets = None,
    output: Annotated[Path, folder_option("Where to write.")] = Path("build"),
    limits: LimitsGiven = None,
) -> None:
    """Check specs and write everything that comes from them.

    An index of the tasks, their scores, the generated code, the schema for editors, and the documentation as a site
    (html), for a paper (latex) and for a repository (markdown). Nothing is written if a spec has an error.
    """
    from taskspec.exact.check.file_checks import check_file, counts
    from taskspec.language.targets import files_of

    start = time.perf_counter()
    results = _Results()
    with progress("check"):
        files = telling(files_of(targets or []), lambda file: str(file.path))
        reports = [check_file(file, results.examine) for file in files]
    problems = [d for report in reports for d in report.diagnostics]
    print_reports(reports, problems)
    out = console(wide=True)
    out.print(verdict(reports, problems, time.perf_counter() - start))
    if counts(problems)[0]:
        say("nothing was written", err=True)
        raise typer.Exit(1)
    with progress("write"):
        tasks = [each.task for report in reports for each in report.tasks if each.task is not None]
        written = list(_write(tasks, results, output))
    for path, what in written:
        out.print(line("wrote ", (str(path), "name"), (f"  {what}", "quiet")))
    if results.problems:
        fail(results.problems)


class _Results:
    """Facts for pages, and scores, by id of the task, gathered in the check: one exact model is held at a time."""

    def __init__(self) -> None:
        self.facts: dict[str, Facts] = {}
        self.scores: dict[str, Any] = {}
        self.problems: list[Diagnostic] = []  # why tasks have no scores

    def examine(self, task: Task) -> Report:
        from taskspec.exact import scores
        from taskspec.show.pages.facts import gather

        report = examine(task)
        tell(f"scores of {task.id}")
        if not report.errors:
            try:
                self.facts[task.id] = gather(report)
                self.scores[task.id] = scores(report.results).record()
            except SpecError as error:
                self.problems += error.diagnostics
        return report


def _write(tasks: Sequence[Task], results: _Results, folder: Path) -> Iterator[tuple[Path, str]]:
    """Write everything that comes from tasks, and yield each path with a word on what it is."""
    from taskspec.language.task.record import record
    from taskspec.language.task.schema.export import json_schema
    from taskspec.programs.scalar import compile_scalar
    from taskspec.show.pages.write import gather_pages, write_pages

    yield _json(folder / "schema.json", json_schema()), "JSON Schema of specs, for editors"
    index = {"taskspec": __version__, "tasks": list(map(record, tasks))}
    yield _json(folder / "tasks.json", index), f"{len(tasks)} tasks with spaces, parameters and content hashes"
    for task in tasks:
        path = folder / "source" / safe_name(task.source.suite or "tasks") / f"{safe_name(task.name)}.py"
        write_text(path, compile_scalar(task).source)
    yield folder / "source", "the generated code of every environment"
    yield _json(folder / "scores.json", results.scores), "optimal, expert, random and worst returns"
    suite = gather_pages(tasks, facts=results.facts)
    for name, what in DOCS.items():
        write_pages(suite, [name], folder / name)
        yield folder / name, what


def _json(path: Path, data: Any) -> Path:
    write_text(path, visible_json(data) + "\n")
    return path
