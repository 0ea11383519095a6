"""`taskspec report`: exams on the terminal and in files, alone, side by side, or compared with findings of a paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.display import plural
from taskspec.base.files import near, safe_name, write_text
from taskspec.cli.console import Console, VisibleText, columns, console, line, misuse, say, to_json, write_json
from taskspec.cli.options import Json, folder_option, formats_option, split_names

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.exam import Exam
    from taskspec.exam.findings import FindingsResult
    from taskspec.exam.score_rows import SeedCell
    from taskspec.experiments import LearnersExamined
    from taskspec.task.schema.experiments import Experiment

FORMATS = ("html", "png", "pdf", "svg", "parquet")
GRADES = {"masters": "good", "passes": "warn", "unsure": "warn", "fails": "bad"}
OUTCOMES = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}
Folders = Annotated[
    list[Path],
    typer.Argument(metavar="FOLDER...", help="Results of exams: folders with an exam.json.", show_default=False),
]
Suite = Annotated[
    str | None,
    typer.Option(
        "--findings", metavar="SUITE", show_default=False,
        help="Evaluate the findings of a suite; the exams in one folder are a set of results.",
    ),
]  # fmt: skip


def report(
    folders: Folders,
    format: Annotated[
        list[str] | None, formats_option(FORMATS, "What to write; may be repeated, or given with commas.")
    ] = None,
    output: Annotated[
        Path | None,
        folder_option("Where to write: the exam's own folder, or build/report for several, unless given.", False),
    ] = None,
    findings: Suite = None,
    json: Json = False,
) -> None:
    """Show and plot the results of an exam, or of several exams side by side.

    For one exam: verdicts, scores, diagnoses and flags, and as files a page ([green]html[/]), a plot ([green]png[/],
    [green]pdf[/], [green]svg[/]), or the scores as a table ([green]parquet[/]). For several: a heat map of learners and
    tasks, and as files also a box plot for each learner and each task.

    With [green]--findings derail[/]: which findings of the paper the exams confirm and which they refute. Exams in the
    same folder ([cyan]results/paper/bc[/], [cyan]results/paper/ppo[/]) are one set. A folder includes all exams below it.
    """
    from taskspec.exam import read
    from taskspec.exam.report import write, write_several

    if findings is not None:
        _report_findings(findings, folders, output or Path("build/report"), json)
        return
    exams = [read(place) for folder in folders for place in _exams_in(folder)]
    if len(exams) == 1:
        own = folders[0] if folders[0].is_dir() else folders[0].parent
        written = write(exams[0], output or own, split_names(format))
    else:
        learners = {exam["learner"]: exam for exam in exams}
        if len(learners) < len(exams):
            raise misuse("two of these exams are of the same learner", "give one exam of each")
        written = write_several(learners, output or Path("build/report"), split_names(format))
    if json:
        write_json({"exams": exams, "files": list(map(str, written))})
        return
    if len(exams) == 1:
        print_exam(exams[0])
    else:
        console(wide=True).print(_heat_map(learners))
    for path in written:
        say(f"wrote {near(path)}")


def _exams_in(folder: Path) -> list[Path]:
    """Return the folders with an exam, where there are some below this one; else this one."""
    from taskspec.exam.results import NAMES

    if not folder.is_dir():
        return [folder.parent]
    below = {path.parent for name in NAMES for path in folder.rglob(name)}
    return sorted(below) or [folder]


# -- one exam -----------------------------------------------------------------------------------------------------


def print_exam(exam: Mapping[str, Any], out: Console | None = None) -> None:
    """Print verdicts, a heat map of scores, diagnoses and flags of an exam, as `exam.json` holds it."""
    from taskspec.exam import score_rows as rows
    from taskspec.exam.learned import learned_notes

    out = out or console()
    out.print(line((exam["learner"], "title"), (f"  {rows.headline(exam)}", "quiet")))
    out.print(VisibleText(rows.finding(exam)))
    out.print()
    out.print(_exam_table(exam))
    for each in exam["diagnoses"]:
        out.print()
        out.print(line(("diagnosis ", "warn"), (each["message"], "title")))
        for evidence in each["evidence"]:
            out.print(_beside("", VisibleText(evidence, style="quiet"), 0))
        for head in ("cause", "try", "source"):
            out.print(_beside(head, VisibleText(each[head]), 6))
    if exam["flags"]:
        out.print()
    for flag in exam["flags"]:
        out.print(line((flag["kind"], "bad"), " ", (flag["task"], "name"), f": {flag['message']}"))
    if exam.get("laws"):
        out.print()
        out.print(_laws(exam["laws"]))
    for text in learned_notes(exam["scores"]):
        out.print(VisibleText(text, style="quiet"))
    for text in rows.left_out(exam):
        out.print(VisibleText(f"it cannot learn {text}", style="quiet"))
    out.print()
    out.print(VisibleText(rows.costs(exam), style="quiet"))


def _laws(scores: Sequence[Mapping[str, Any]]) -> Table:
    """Return a row for each law: the tasks that it was tried on, and those where it is broken."""
    from taskspec.rules.score_rules import short_name

    table = columns("law", "tasks", "broken", right=(1,), styles=("name", "quiet"), fold=(2,))
    for law in dict.fromkeys(score["law"] for score in scores):
        own = [score for score in scores if score["law"] == law]
        tried = [score for score in own if score["error"] is None]
        texts = []
        for score in tried:
            if score["broken"]:
                name = short_name(score["task"])
                texts.append(f"{name} {score['printed']:.2f} → {score['changed']:.2f} (p = {score['p_value']:.2g})")
        if len(tried) < len(own):
            errors = [score["error"].splitlines()[0] for score in own if score["error"] is not None]
            texts.append(f"not tried on {plural(len(errors), 'task')}: {errors[0]}")
        if texts:
            text = VisibleText("; ".join(texts), style="warn")
        else:
            text = VisibleText("no", style="quiet")
        table.add_row(law, str(len(tried)), text)
    return table


def _beside(head: str, text: VisibleText, width: int) -> Table:
    """Return a text, indented, beside its heading."""
    table = columns("", "", fold=(1,), styles=("quiet",), gap=1)
    table.columns[0].width = width + 2
    table.add_row(f"  {head}", text)
    return table


def _exam_table(exam: Mapping[str, Any]) -> Table:
    """Return a row for each capability with its verdict, and under it its tasks with their mean scores on their colours."""
    from taskspec.exam.score_rows import SIGNS, SeedCell, interval, rows

    table = columns("", "score", "95 %", "twins", "drawn", "constant", right=range(1, 6), styles=("name", "", "quiet"))
    found = rows(exam)
    verdicts: Mapping[str, Mapping[str, Any]] = exam["verdicts"]
    for capability in dict.fromkeys([*verdicts, *(row.capability for row in found)]):
        grade = verdicts.get(capability, {}).get("verdict")
        mark = VisibleText(f"{SIGNS[grade]} {grade}", style=GRADES[grade]) if grade else ""
        table.add_row(VisibleText(capability, style="head"), mark)
        for row in found:
            if row.capability != capability:
                continue
            count = len(row.printed.scores)
            ends = ""
            if count > 1:  # equal scores have no interval
                ends = interval(*row.printed.interval) or f"{row.printed.passed}/{count} pass"
            constant = SeedCell(() if row.constant is None else (row.constant,))
            others = [_shaded(cell) for cell in (row.twins, row.drawn, constant)]
            table.add_row(f"  {row.name}", _shaded(row.printed), ends, *others)
    return table


def _shaded(cell: SeedCell) -> VisibleText:
    """Return a mean score on its colour."""
    from taskspec.exam.score_rows import colour
    from taskspec.figures import chart

    if cell.mean is None:
        return VisibleText(cell.words or "·", style="quiet")
    background = colour(cell.mean)
    return VisibleText(f" {cell.words} ", style=f"{chart.ink(background)} on {chart.hexadecimal(background)}")


# -- several exams ------------------------------------------------------------------------------------------------


def print_exams(experiment: Experiment, found: LearnersExamined, folder: Path) -> None:
    """Show the exams of an experiment, and write the report of each, and pictures of them all."""
    from taskspec.exam.report import write, write_several
    from taskspec.exam.score_rows import named
    from taskspec.experiments.picture import draw

    out = console(wide=True)
    out.print(_heat_map(found.exams))
    written: list[Path] = []
    for name, exam in found.exams.items():
        for flag in exam["flags"]:
            out.print(line((flag["kind"], "bad"), " ", (name, "name"), f" on {named(flag['task'])}: {flag['message']}"))
        written += write(exam, found.folders[name])
    written += write_several(found.exams, folder, ["svg"])
    if any(instance.varied for instance in found.instances):
        path = folder / f"{safe_name(experiment.name)}.svg"
        draw(experiment, found.rows(), path, tuple(found.exams))
        written.append(path)
    for path in written:
        say(f"wrote {near(path)}")


def _heat_map(exams: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return mean scores: a row for each task, a column for each learner, each number on its colour."""
    from taskspec.exam.score_rows import SeedCell, rows

    found = [{row.id: row for row in rows(exam)} for exam in exams.values()]
    tasks = {task: row.name for each in found for task, row in each.items()}
    table = columns("", *exams, right=range(1, len(exams) + 1), styles=("name",))
    for task, name in tasks.items():
        cells = [_shaded(by[task].printed if task in by else SeedCell(())) for by in found]
        table.add_row(name, *cells)
    return table


# -- findings -----------------------------------------------------------------------------------------------------


def _report_findings(suite: str, folders: Sequence[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.exam import read
    from taskspec.exam.findings import evaluate, html, markdown

    places = dict.fromkeys(place.resolve() for folder in folders for place in _exams_in(folder))
    exams = {place: read(place) for place in places}
    found = evaluate(suite, _merged(exams))
    how = _setups(list(exams.values()))
    texts = {"md": markdown(found, how), "html": html(found, how), "json": to_json(found.data) + "\n"}
    for suffix, text in texts.items():
        write_text(output / f"findings.{suffix}", text)
    if json:
        write_json(found.data)
        return
    console(wide=True).print(_findings_table(found))
    for suffix in texts:
        say(f"wrote {near(output / f'findings.{suffix}')}")


def _merged(exams: Mapping[Path, Exam]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return all scores by set, which is the folder of an exam's folder, and learner, whose exams may be about other tasks."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for place, exam in exams.items():
        known = found.setdefault(place.parent.name, {}).setdefault(place.name, {"tasks": {}, "scores": []})
        for task in exam["tasks"]:
            if task in known["tasks"]:
                raise misuse(f"two exams of {place.parent.name}/{place.name} are about {task}")
        known["tasks"] |= exam["tasks"]
        known["scores"] += exam["scores"]
    return found


def _setups(exams: Sequence[Exam]) -> list[str]:
    """Return how results were obtained, in lines: one for each that differs."""
    from taskspec.exam.score_rows import duration

    seeds = ", ".join(str(n) for n in sorted({len(exam["seeds"]) for exam in exams}))
    steps = ", ".join(f"{n:,}" for n in sorted({exam["steps"] for exam in exams}))
    spent = duration(sum(exam["cost"].get("seconds", 0.0) for exam in exams))
    lines = [f"{len(exams)} exams, of {seeds} seeds and {steps} steps each; {spent} of training"]
    lines += [f"by `{exam['command']}`" for exam in exams if exam["command"]]
    lines += [f"with {_listed(exam['versions'])}" for exam in exams]
    lines += [f"on {_listed(exam['machine'])}" for exam in exams]
    return list(dict.fromkeys(lines))


def _listed(facts: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in facts.items())


def _findings_table(found: FindingsResult) -> Table:
    """Return a row for each finding: what it says, and what became of it with each set of results."""
    table = columns("", "the paper says", *found.sets, fold=(1,), styles=("name",))
    for each in found.results:
        outcomes = map(each.outcome, found.sets)
        table.add_row(each.name, each.entry.says, *(VisibleText(word, style=OUTCOMES[word]) for word in outcomes))
    counts = [found.counts(name) for name in found.sets]
    for outcome, style in OUTCOMES.items():
        numbers = [str(count[outcome]) for count in counts]  # type: ignore[index]  # the same words
        table.add_row("", VisibleText(outcome, style=style), *numbers)
    return table
