"""Everything that comes from specs, in one folder: index, code, scores, schema and documentation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from taskspec.base import __version__
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.display import visible_json
from taskspec.base.files import safe_name, write_text
from taskspec.base.limits import tell
from taskspec.exact import scores
from taskspec.exact.check.report import Report
from taskspec.language.task.record import record
from taskspec.language.task.schema.export import json_schema
from taskspec.language.task.task import Task
from taskspec.programs.scalar import compile_scalar
from taskspec.show.pages import facts
from taskspec.show.pages.write import gather_pages, write_pages

DOCS = {
    "html": "the documentation as a site: open index.html",
    "latex": "the documentation for a paper: include appendix.tex",
    "markdown": "the documentation for a repository",
}


class TaskResults:
    """Facts for pages, and scores, by id of the task, gathered from reports: one exact model is held at a time."""

    def __init__(self) -> None:
        self.facts: dict[str, facts.Facts] = {}
        self.scores: dict[str, Any] = {}
        self.problems: list[Diagnostic] = []  # why tasks have no scores

    def add(self, report: Report) -> None:
        """Compute the facts and scores of a task, unless its report has errors."""
        if report.errors:
            return
        task = report.task
        tell(f"scores of {task.id}")
        try:
            self.facts[task.id] = facts.gather(report)
            self.scores[task.id] = scores(report.results).record()
        except SpecError as error:
            self.problems += error.diagnostics


def write_build(tasks: Sequence[Task], results: TaskResults, folder: Path) -> Iterator[tuple[Path, str]]:
    """Write everything that comes from tasks.

    Yields:
        each path that is written, and its content in a few words.
    """
    yield _json(folder / "schema.json", json_schema()), "JSON Schema of specs, for editors"
    index = {"taskspec": __version__, "tasks": list(map(record, tasks))}
    yield _json(folder / "tasks.json", index), f"{len(tasks)} tasks with spaces, parameters and content hashes"
    for task in tasks:
        path = folder / "source" / safe_name(task.source.suite or "tasks") / f"{safe_name(task.name)}.py"
        write_text(path, compile_scalar(task).source)
    yield folder / "source", "the generated code of every environment"
    yield _json(folder / "scores.json", results.scores), "optimal, expert, random and worst returns"
    suite = gather_pages(tasks, facts=results.facts)
    for name, content in DOCS.items():
        write_pages(suite, [name], folder / name)
        yield folder / name, content


def _json(path: Path, data: Any) -> Path:
    write_text(path, visible_json(data) + "\n")
    return path
