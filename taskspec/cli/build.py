"""`taskspec build`: checks specs, and writes everything that comes from them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.files import safe_name, write_text
from taskspec.cli.console import say
from taskspec.cli.failures import fail
from taskspec.cli.options import LimitsGiven, Targets

if TYPE_CHECKING:
    from taskspec.check.files import FileReport, Finding
    from taskspec.pages.facts import Facts
    from taskspec.task.task import Task

DOCS = {
    "html": "the documentation as a site: open index.html",
    "latex": "the documentation for a paper: include appendix.tex",
    "markdown": "the documentation for a repository",
}
WIDE = 90
"""From this width on, there is room for the horizon."""
Output = Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where to write.", file_okay=False)]


def build(targets: Targets = None, output: Output = Path("build"), limits: LimitsGiven = None) -> None:
    """Check specs and write everything that comes from them.

    An index of the tasks, their scores, the generated code, the schema for editors, and the documentation as a site
    (html), for a paper (latex) and for a repository (markdown). Nothing is written if a spec has an error.
    """
    from taskspec.base.limits import telling
    from taskspec.check.files import check_file, counts
    from taskspec.cli.check import verdict
    from taskspec.cli.console import console, line
    from taskspec.cli.progress import progress
    from taskspec.targets import files_of

    start = time.perf_counter()
    known = _Gathered()
    with progress("check"):
        files = telling(files_of(targets or []), lambda file: str(file.path))
        reports = [check_file(file, known.examine) for file in files]
    errors, warnings = counts(d for report in reports for d in report.diagnostics)
    _print_problems(reports)
    out = console(wide=True)
    out.print(_table(reports, out.width))
    out.print()
    out.print(verdict(reports, errors, warnings, time.perf_counter() - start))
    if errors:
        say("nothing was written", err=True)
        raise typer.Exit(1)
    with progress("write"):
        written = write(_tasks(reports), known, output)
    for path, what in written:
        out.print(line("wrote ", (str(path), "name"), (f"  {what}", "quiet")))
    if known.problems:
        fail(known.problems)


@dataclass
class _Gathered:
    """What pages and tables tell of each task by its id, gathered while it is checked: one exact model is held at a time."""

    facts: dict[str, Facts] = field(default_factory=dict)
    scores: dict[str, Any] = field(default_factory=dict)
    problems: list[Diagnostic] = field(default_factory=list)
    """Why tasks have no scores."""

    def examine(self, task: Task) -> Finding:
        from taskspec.base.extras import is_installed
        from taskspec.base.limits import tell
        from taskspec.check.files import finding
        from taskspec.cli.check import reported
        from taskspec.exact import scores
        from taskspec.pages.facts import gather

        report = reported(task)
        tell(f"scores of {task.id}")
        if is_installed("scipy") and not report.errors:
            try:
                self.facts[task.id] = gather(report)
                self.scores[task.id] = scores(report.unlimited).record()
            except SpecError as error:
                self.problems += error.diagnostics
        return finding(report, len(task.examples))


def _print_problems(reports: Sequence[FileReport]) -> None:
    from taskspec.cli import failures

    problems = [d for report in reports for d in report.diagnostics]
    failures.show(problems, err=False)
    if problems:
        say("")


def _tasks(reports: Sequence[FileReport]) -> list[Task]:
    return [each.task for report in reports for each in report.tasks if each.task is not None]


def _table(reports: Sequence[FileReport], width: int) -> Any:
    """Return every task with its size and how it was checked."""
    from taskspec.cli.check import mark
    from taskspec.cli.console import VisibleText, columns
    from taskspec.task.record import horizon, size

    headers = ["", "task", "size", *(["horizon"] if width >= WIDE else []), "validated by", "claims"]
    table = columns(*headers, right=(2, 3) if width >= WIDE else (2,))
    for each in (each for report in reports for each in report.tasks):
        cells = [
            mark(each.diagnostics),
            VisibleText(each.title, style="name"),
            "" if each.task is None else size(each.task),
        ]
        if width >= WIDE:
            cells.append("" if each.task is None else horizon(each.task))
        table.add_row(*cells, each.finding.how, each.finding.claims_words)
    return table


# -- writing ------------------------------------------------------------------------------------------------------


def write(tasks: Sequence[Task], known: _Gathered, folder: Path) -> list[tuple[Path, str]]:
    """Write everything that comes from tasks; gives the paths, each with a word on what it is."""
    from taskspec.cli.docs import has_scores

    written = [_schema(folder), _index(tasks, folder), _sources(tasks, folder)]
    if has_scores():
        written.append((_json(folder / "scores.json", known.scores), "optimal, expert, random and worst returns"))
    return [*written, *_docs(tasks, known.facts, folder)]


def _docs(tasks: Sequence[Task], facts: Mapping[str, Facts], folder: Path) -> list[tuple[Path, str]]:
    """Return the documentation, a folder for each format; left out, with a word, where the packages that write it are
    missing.
    """
    from taskspec.base.extras import install, is_installed
    from taskspec.pages.write import gather_pages, write_pages

    if not is_installed("markdown_it"):
        say(f"documentation needs markdown-it-py, and is left out: {install('docs')}", err=True)
        return []
    suite = gather_pages(tasks, facts=facts)
    for name in DOCS:
        write_pages(suite, [name], folder / name)
    return [(folder / name, what) for name, what in DOCS.items()]


def _schema(folder: Path) -> tuple[Path, str]:
    from taskspec.task.schema.export import json_schema

    return _json(folder / "schema.json", json_schema()), "JSON Schema of specs, for editors"


def _index(tasks: Sequence[Task], folder: Path) -> tuple[Path, str]:
    """Return every task with its spaces, parameters and content hash."""
    from taskspec.base import __version__
    from taskspec.task.record import record

    data = {"taskspec": __version__, "tasks": [record(task) for task in tasks]}
    return _json(folder / "tasks.json", data), f"{len(tasks)} tasks with spaces, parameters and content hashes"


def _sources(tasks: Sequence[Task], folder: Path) -> tuple[Path, str]:
    """Return the generated module of every task, in a folder for each suite."""
    from taskspec.backends.scalar import compile_scalar

    for task in tasks:
        path = folder / "source" / safe_name(task.suite or "tasks") / f"{safe_name(task.name)}.py"
        write_text(path, compile_scalar(task).source)
    return folder / "source", "the generated code of every environment"


def _json(path: Path, data: Any) -> Path:
    from taskspec.cli.console import to_json

    write_text(path, to_json(data) + "\n")
    return path
