"""Tasks -> files in a folder, in the formats asked for; and everything that comes from specs (`taskspec build`)."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from taskspec.base import __version__
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import listed, visible_json
from taskspec.base.files import safe_name, write_text
from taskspec.base.limits import tell, telling
from taskspec.exact import scores
from taskspec.exact.check.report import Report
from taskspec.language.registry import load
from taskspec.language.task.schema.export import json_schema
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.scalar import compile_scalar
from taskspec.show.bibliography import beside
from taskspec.show.figures import scene, svg
from taskspec.show.pages import facts
from taskspec.show.pages.facts import Facts, gather
from taskspec.show.pages.page import Page, briefly, page
from taskspec.show.pages.render.html import site
from taskspec.show.pages.render.latex import document
from taskspec.show.pages.render.markdown import markdown
from taskspec.show.pages.render.suite import Suite, setting_anchor
from taskspec.show.record import record

_WRITERS: dict[str, Callable[[Suite], dict[str, str]]] = {
    "latex": document, "html": site, "markdown": markdown,
}  # fmt: skip
FORMATS = (*_WRITERS, "svg", "pdf")
"""The names of the formats that pages are written in."""

_SCRATCH = ("aux", "bbl", "blg", "log", "out")
"""Endings of what TeX leaves beside a document; where it fails, they stay."""
_TAKEN = ("index", "appendix", "document", "preamble")  # names of the files around the pages


def write(
    tasks: Iterable[TaskLike],
    formats: Iterable[str],
    folder: Path | str,
    *,
    title: str = "",
    facts: Mapping[str, Facts] | None = None,
    columns: Sequence[Mapping[str, Any]] = (),
    brief: bool = False,
) -> list[Path]:
    """Write the printed form of tasks; the same tasks give the same files.

    Args:
        tasks: tasks, ids or paths, in order; each is printed at its defaults, with other values that it is given at beside them.
        formats: of `latex`, `html`, `markdown`, `svg` (the figures alone) and `pdf` (LaTeX, compiled).
        folder: made if need be.
        title: of the whole; by default the tasks' suite.
        facts: results by id of the task (see `gather`); left out without.
        columns: parameter values to show beside the symbols.
        brief: what defines a task, its figure and its scores alone, half a page each.

    Returns:
        The files written, in order.

    Raises:
        SpecError: for another format, without an extra, or when there is no TeX for `pdf`.
    """
    wanted = _known(formats)
    suite = gather_pages(list(map(load, tasks)), title, facts or {}, columns, brief)
    return write_pages(suite, wanted, folder)


def write_pages(suite: Suite, formats: Iterable[str], folder: Path | str) -> list[Path]:
    """Write pages that were gathered, as `write` does."""
    wanted = _known(formats)
    files: dict[str, str] = {}
    for name, writer in _WRITERS.items():
        if name in wanted or (name == "latex" and "pdf" in wanted):
            files |= writer(suite)
    if {"markdown", "svg"} & set(wanted):
        for anchor, drawn in suite.scenes.items():
            files[f"figures/{anchor}.svg"] = svg(drawn) + "\n"
    written = []
    for name, text in files.items():
        write_text(Path(folder) / name, text)
        written.append(Path(folder) / name)
    if "pdf" in wanted:
        written.append(compile_pdf(Path(folder)))
    return written


def _known(formats: Iterable[str]) -> list[str]:
    wanted = list(dict.fromkeys(formats))
    for name in wanted:
        if name not in FORMATS:
            raise spec_error("E726", f"'{name}' is not a format of the documentation", f"use {', '.join(FORMATS)}")
    if "pdf" in wanted and shutil.which("pdflatex") is None:
        hint = "install TeX Live, or write `latex` and compile it elsewhere"
        raise spec_error("E727", "`pdf` needs pdflatex, which is not installed", hint)
    return wanted


def gather_pages(
    tasks: Sequence[Task],
    title: str = "",
    facts: Mapping[str, Facts] | None = None,
    columns: Sequence[Mapping[str, Any]] = (),
    brief: bool = False,
) -> Suite:
    """Return pages and figures of tasks, ready to be rendered."""
    _refuse_unknown(tasks, columns)
    made = []
    for task, others in telling(together(tasks), lambda each: f"page of {each[0].id}"):
        whole = page(task, (facts or {}).get(task.id), [*others, *columns])
        made.append(briefly(whole) if brief else whole)
    pages = _apart(made)
    drawn = {each.anchor: each.task for each in pages}
    for each in pages:
        for setting in each.settings:
            drawn[setting_anchor(each, setting)] = setting.task
    scenes = {}
    for name, task in telling([*drawn.items()], lambda each: f"figure of {each[1].id}"):
        figure = scene(task)
        if figure is not None:
            scenes[name] = figure
    cited = beside(task.source.document.origin.name for task in tasks)
    names = list(filter(None, dict.fromkeys(task.source.suite for task in tasks)))
    if not title and names:
        title = f"Tasks of {listed(names)}"
    return Suite(title or "Tasks", pages, scenes, cited, brief)


def _refuse_unknown(tasks: Sequence[Task], columns: Sequence[Mapping[str, Any]]) -> None:
    """Refuse values of a parameter that none of the tasks has."""
    known = set()
    for task in tasks:
        for p in task.parameters:
            known |= {p.name, p.alias}
    for column in columns:
        for name, value in column.items():
            if name not in known:
                load(tasks[0], **{name: value})  # its error says what is wrong


def together(tasks: Iterable[Task]) -> list[tuple[Task, list[Mapping[str, Any]]]]:
    """Return each task at its defaults, with the other values of its varied parameters."""
    by_name: dict[str, list[Task]] = {}
    for task in tasks:
        by_name.setdefault(task.id, []).append(task)
    together: list[tuple[Task, list[Mapping[str, Any]]]] = []
    for same in by_name.values():
        defaults = {p.name: p.default for p in same[0].parameters}
        others = [task.values for task in same if task.values != defaults]
        varied = []
        for name, value in defaults.items():
            if any(values[name] != value for values in others):
                varied.append(name)
        base = next((task for task in same if task.values == defaults), None) or load(same[0], **defaults)
        columns: list[Mapping[str, Any]] = []
        for values in others:
            columns.append({name: values[name] for name in varied})
        together.append((base, columns))
    return together


def _apart(pages: Iterable[Page]) -> tuple[Page, ...]:
    taken = set(_TAKEN)
    separate = []
    for each in pages:
        anchor = each.anchor
        number = 1
        while anchor in taken:
            number += 1
            anchor = f"{each.anchor}-{number}"
        taken.add(anchor)
        separate.append(replace(each, anchor=anchor))
    return tuple(separate)


def compile_pdf(folder: Path) -> Path:
    for command in telling(("pdflatex", "bibtex", "pdflatex", "pdflatex"), "document.pdf, {}".format):
        options = ["-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "document.tex"]
        if command == "bibtex":
            options = ["document"]
            if shutil.which("bibtex") is None or not (folder / "references.bib").read_text():
                continue
        done = subprocess.run(
            [command, *options], cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
        if done.returncode != 0 and command == "pdflatex":
            problem = re.search("^! *(.*)", done.stdout, re.MULTILINE)
            what = problem[1] if problem else "pdflatex failed"
            raise spec_error("E727", f"TeX could not compile {folder / 'document.tex'}: {what}", "see document.log")
    for path in folder.glob("document.*"):
        if path.suffix[1:] in _SCRATCH:
            path.unlink()
    return folder / "document.pdf"


def facts_of(tasks: Sequence[Task], problems: list[Diagnostic]) -> dict[str, Facts]:
    """Return scores and verdicts at the defaults by id of the task, and add to the problems why a task has none."""
    by_task = {}
    printed = [task for task, _ in together(tasks)]
    for task in telling(printed, lambda task: f"scores of {task.id}"):
        try:
            by_task[task.id] = gather(task)
        except SpecError as error:
            problems += error.diagnostics
    return by_task


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
