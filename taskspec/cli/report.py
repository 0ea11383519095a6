"""`taskspec report`: exams on the terminal and in files, alone, side by side, or compared with findings of a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from taskspec.cli.console import misuse, say_written, write_json
from taskspec.cli.options import Json, formats_option, split_names

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
        Option(
            "--output",
            "--out",
            "-o",
            metavar="PATH",
            help="A folder, or a file such as card.svg, whose ending is the format; the exam's own folder, or build/report "
            "for several, unless given.",
        ),
    ] = None,
    paper: Annotated[
        bool,
        Option(
            "--paper", help="Write pictures for one column (8.4 cm) and two columns (17 cm) of a paper, PDF and SVG."
        ),
    ] = False,
    narrow: Annotated[
        bool, Option("--narrow", help="Draw the card as narrow as a telephone; --output names the picture.")
    ] = False,
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
    from taskspec.learn.exam.results import exams_below, read

    places: list[Path] = []
    for below in folders:
        places += exams_below(below)
    if findings is not None:
        _report_findings(findings, places, output or Path("build/report"), json)
        return
    exams = {}
    for place in places:
        exam = read(place)
        if exam["learner"] in exams:
            raise misuse("two of these exams are of the same learner", "give one exam of each")
        exams[exam["learner"]] = exam
    folder = output or Path("build/report")
    if output is None and len(places) == 1 and places[0].is_dir():
        folder = places[0]
    written = _write(exams, folder, output is not None, split_names(format), paper, narrow)
    if json:
        write_json({"exams": list(exams.values()), "files": list(map(str, written))})
        return
    print_exams(exams)
    say_written(written)


def _write(
    exams: dict[str, Any], place: Path, is_named: bool, formats: list[str], paper: bool, narrow: bool
) -> list[Path]:
    """Write reports to a folder or a file; where one was named and no format, the page."""
    from taskspec.learn.exam.report import write_file, write_paper, write_several

    is_file = is_named and place.suffix[1:] in FORMATS and not place.is_dir()
    if is_file and (formats or paper):
        raise misuse(f"'{place}' is one file, of the format that its ending says", "give a folder")
    if narrow and not (is_file and len(exams) == 1):
        raise misuse("--narrow is for the card of one exam in a file", "-o card.svg")
    if paper and len(exams) > 1:
        raise misuse("--paper is for one exam", "give one")
    if is_file:
        return [write_file(exams, place, narrow)]
    written = []
    if paper:
        (exam,) = exams.values()
        written += write_paper(exam, place)
    elif is_named and not formats:
        formats = ["html"]
    return [*written, *write_several(exams, place, formats)]


def _report_findings(suite: str, places: list[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.learn.exam import findings_page
    from taskspec.learn.exam.findings import evaluate, sets_of
    from taskspec.learn.exam.results import read
    from taskspec.show.terminal.styled_text import console

    exams = {place: read(place) for place in map(Path.resolve, places)}
    findings = evaluate(suite, sets_of(exams))
    written = findings_page.write(findings, list(exams.values()), output)
    if json:
        write_json(findings.data)
        return
    console(wide=True).print(findings_page.text(findings))
    say_written(written)
