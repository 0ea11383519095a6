"""`taskspec report`: what exams found, shown again, drawn, side by side, or held against findings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.files import near
from taskspec.cli.failures import misuse
from taskspec.cli.options import Json

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.exam import Exam
    from taskspec.exam.findings import FindingsResult

# `taskspec report --findings`: what becomes of a source's findings on the results of several learners.

STYLES = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}


def print_findings(suite: str, folders: Sequence[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.base.files import write_text
    from taskspec.cli.console import console, say, to_json, write_json
    from taskspec.exam.findings import evaluate, html, markdown

    exams = results_of(folders)
    found = evaluate(suite, merged(exams))
    how = setups([exam for *_, exam in exams])
    write_text(output / "findings.md", markdown(found, how))
    write_text(output / "findings.html", html(found, how))
    write_text(output / "findings.json", to_json(found.data) + "\n")
    if json:
        write_json(found.data)
        return
    console(wide=True).print(table_of(found))
    for name in ("findings.md", "findings.html", "findings.json"):
        say(f"wrote {near(output / name)}")


Result = tuple[str, str, "Exam"]
"""The set that an exam belongs to, which is the folder of its folder, what its learner is called there, and the exam."""


def results_of(folders: Sequence[Path]) -> list[Result]:
    """Return the exams in some folders, and below them."""
    from taskspec.exam import read

    places = list(dict.fromkeys(place.resolve() for folder in folders for place in exams_in(folder)))
    return [(place.parent.name, place.name, read(place)) for place in places]


def exams_in(folder: Path) -> list[Path]:
    """Return the folders with an exam, where there are some below this one; else this one."""
    from taskspec.exam.results import NAMES

    if not folder.is_dir():
        return [folder.parent]
    below = {path.parent for name in NAMES for path in folder.rglob(name)}
    return sorted(below) or [folder]


def merged(results: Sequence[Result]) -> dict[str, dict[str, dict[str, Any]]]:
    """For each set and learner all scores, where several exams were about different tasks."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for name, learner, exam in results:
        known = found.setdefault(name, {}).setdefault(learner, {"tasks": {}, "scores": []})
        twice = next(iter(known["tasks"].keys() & exam["tasks"].keys()), None)
        if twice is not None:
            raise misuse(f"two exams of {name}/{learner} are about {twice}")
        known["tasks"] |= exam["tasks"]
        known["scores"] += exam["scores"]
    return found


def setups(exams: Sequence[Exam]) -> list[str]:
    """Return how results were obtained, in lines: one for each that differs."""
    from taskspec.exam.score_rows import duration

    commands = dict.fromkeys(exam["command"] for exam in exams if exam["command"])
    versions = dict.fromkeys(", ".join(f"{k} {v}" for k, v in exam["versions"].items()) for exam in exams)
    machines = dict.fromkeys(", ".join(f"{k} {v}" for k, v in exam["machine"].items()) for exam in exams)
    seeds = sorted({len(exam["seeds"]) for exam in exams})
    steps = sorted({exam["steps"] for exam in exams})
    spent = duration(sum(exam["cost"].get("seconds", 0.0) for exam in exams))
    runs = (
        f"{len(exams)} exams, of {', '.join(map(str, seeds))} seeds and {', '.join(f'{n:,}' for n in steps)} steps each"
    )
    return [
        f"{runs}; {spent} of training",
        *(f"by `{each}`" for each in commands),
        *(f"with {each}" for each in versions),
        *(f"on {each}" for each in machines),
    ]


def table_of(found: FindingsResult) -> Table:
    """Return a row for each finding: what it says, and what became of it with each set of results."""
    from taskspec.cli.console import VisibleText, columns

    table = columns("", "the paper says", *found.sets, fold=(1,))
    for each in found.results:
        outcomes = [VisibleText(each.outcome(name), style=STYLES[each.outcome(name)]) for name in found.sets]
        table.add_row(VisibleText(each.name, style="name"), VisibleText(each.entry.says), *outcomes)
    for outcome in STYLES:
        counts = [str(found.counts(name)[outcome]) for name in found.sets]  # type: ignore[index]  # the same words
        table.add_row("", VisibleText(outcome, style=STYLES[outcome]), *counts)
    return table


# `taskspec report`: what exams found, shown again, drawn, or side by side.

FORMATS = ("html", "png", "pdf", "svg", "parquet")
Folders = Annotated[
    list[Path],
    typer.Argument(metavar="FOLDER...", help="Results of exams: folders with an exam.json.", show_default=False),
]
Format = Annotated[
    list[str] | None,
    typer.Option("--format", "-f", metavar="|".join(FORMATS), help="What to write; may be repeated, or given with commas.",
                 autocompletion=lambda: FORMATS, show_default=False),
]  # fmt: skip
Output = Annotated[
    Path | None,
    typer.Option("--output", "--out", "-o", metavar="FOLDER", file_okay=False, show_default=False,
                 help="Where to write: the exam's own folder, or build/report for several, unless given."),
]  # fmt: skip
Suite = Annotated[
    str | None,
    typer.Option("--findings", metavar="SUITE", show_default=False,
                 help="Evaluate the findings of a suite; the exams in one folder are a set of results."),
]  # fmt: skip


def report(
    folders: Folders, format: Format = None, output: Output = None, findings: Suite = None, json: Json = False
) -> None:
    """Show and plot the results of an exam, or of several exams side by side.

    For one exam: verdicts, scores, diagnoses and flags, and as files a page ([green]html[/]), a plot ([green]png[/],
    [green]pdf[/], [green]svg[/]), or the scores as a table ([green]parquet[/]). For several: a heat map of learners and
    tasks, and as files also a box plot for each learner and each task.

    With [green]--findings derail[/]: which findings of the paper the exams confirm and which they refute. Exams in the
    same folder ([cyan]results/paper/bc[/], [cyan]results/paper/ppo[/]) are one set. A folder includes all exams below it.
    """
    if findings is not None:
        print_findings(findings, folders, output or Path("build/report"), json)
        return
    from taskspec.base.files import near
    from taskspec.cli.console import console, say, write_json
    from taskspec.cli.exam_tables import show, table_of
    from taskspec.exam import read
    from taskspec.exam.report import write, write_several

    wanted = _formats(format)
    exams = [read(place) for folder in folders for place in exams_in(folder)]
    if len(exams) == 1:
        written = write(exams[0], output or _folder(folders[0]), wanted)
    else:
        written = write_several(_by_learner(exams), output or Path("build/report"), wanted)
    if json:
        write_json({"exams": exams, "files": list(map(str, written))})
        return
    if len(exams) == 1:
        show(exams[0])
    else:
        console(wide=True).print(table_of(_by_learner(exams)))
    for path in written:
        say(f"wrote {near(path)}")


def _formats(given: Sequence[str] | None) -> list[str]:
    return [name.strip() for text in given or () for name in text.split(",")]


def _folder(path: Path) -> Path:
    return path if path.is_dir() else path.parent


def _by_learner(exams: Sequence[Exam]) -> dict[str, Exam]:
    found = {exam["learner"]: exam for exam in exams}
    if len(found) < len(exams):
        raise misuse("two of these exams are of the same learner", "give one exam of each")
    return found
