"""`taskspec report`: what exams found, shown again, drawn, or side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.cli.failures import misuse
from taskspec.cli.options import Json

if TYPE_CHECKING:
    from taskspec.exam import Exam

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
        from taskspec.cli.findings import print_findings

        print_findings(findings, folders, output or Path("build/report"), json)
        return
    from taskspec.cli.console import console, say, write_json
    from taskspec.cli.examined import show
    from taskspec.cli.exams import table_of
    from taskspec.cli.findings import exams_in
    from taskspec.cli.targets import near
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
