"""`taskspec report`: exams on the terminal and in files, alone, side by side, or compared with findings of a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.cli.console import misuse, say_written, write_json
from taskspec.cli.options import Json, folder_option, formats_option, split_names

FORMATS = ("html", "png", "pdf", "svg", "parquet")
Folders = Annotated[list[Path], Argument(metavar="FOLDER...", help="Results of exams: folders with an exam.json.")]
Suite = Annotated[
    str | None,
    Option(
        "--findings",
        metavar="SUITE",
        help="Evaluate the findings of a suite; the exams in one folder are a set of results.",
    ),
]


def report(
    folders: Folders,
    format: Annotated[
        list[str] | None, formats_option(FORMATS, "What to write; may be repeated, or given with commas.")
    ] = None,
    output: Annotated[
        Path | None,
        folder_option("Where to write: the exam's own folder, or build/report for several, unless given."),
    ] = None,
    findings: Suite = None,
    json: Json = False,
) -> None:
    """Show and plot the results of an exam, or of several exams side by side.

    For one exam: what fails, the nearest known mistakes, scores and flags, and as files a page ([green]html[/]), a
    plot ([green]png[/], [green]pdf[/], [green]svg[/]), or the scores as a table ([green]parquet[/]). For several: a
    matrix of learners and tasks with flags, and as files also strips of scores for each learner and each task.

    With [green]--findings derail[/]: which findings of the paper the exams confirm and which they refute. Exams in the
    same folder ([cyan]results/paper/bc[/], [cyan]results/paper/ppo[/]) are one set. A folder includes all exams below it.
    """
    from taskspec.learn.exam.card_text import print_exams
    from taskspec.learn.exam.report import write_several
    from taskspec.learn.exam.results import exams_below, read

    places = [place for folder in folders for place in exams_below(folder)]
    if findings is not None:
        _report_findings(findings, places, output or Path("build/report"), json)
        return
    exams = {}
    for place in places:
        exam = read(place)
        if exam["learner"] in exams:
            raise misuse("two of these exams are of the same learner", "give one exam of each")
        exams[exam["learner"]] = exam
    folder = Path("build/report")
    if len(places) == 1 and places[0].is_dir():
        folder = places[0]
    written = write_several(exams, output or folder, split_names(format))
    if json:
        write_json({"exams": list(exams.values()), "files": list(map(str, written))})
        return
    print_exams(exams)
    say_written(written)


def _report_findings(suite: str, places: list[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.base.terminal import console
    from taskspec.learn.exam import findings_page
    from taskspec.learn.exam.findings import evaluate, sets_of
    from taskspec.learn.exam.results import read

    exams = {place: read(place) for place in dict.fromkeys(place.resolve() for place in places)}
    found = evaluate(suite, sets_of(exams))
    written = findings_page.write(found, list(exams.values()), output)
    if json:
        write_json(found.data)
        return
    console(wide=True).print(findings_page.text(found))
    say_written(written)
