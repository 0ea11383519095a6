"""Exams in a terminal: verdicts, a heat map of scores, diagnoses; and several exams side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table

from taskspec.cli.console import Console, VisibleText, columns, console, line
from taskspec.exam import score_rows
from taskspec.exam.score_rows import SeedCell, TaskRow
from taskspec.figures import chart

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.experiments import LearnersExamined
    from taskspec.task.schema.experiments import Experiment

# The report of an exam in a terminal: verdicts, a heat map of scores, diagnoses with what to try, flags, and the cost.

STYLES = {"masters": "good", "unsure": "warn", "fails": "bad"}


def show(exam: Mapping[str, Any], out: Console | None = None) -> None:
    """Print the report of an exam, as `exam.json` holds it."""
    out = out or console()
    for part in _parts(exam):
        out.print(part)


def _parts(exam: Mapping[str, Any]) -> Iterable[RenderableType]:
    yield line((exam["learner"], "title"), (f"  {score_rows.headline(exam)}", "quiet"))
    yield VisibleText(score_rows.finding(exam))
    yield VisibleText()
    yield _table(exam)
    for each in exam["diagnoses"]:
        yield VisibleText()
        yield from _diagnosis(each)
    if exam["flags"]:
        yield VisibleText()
    for flag in exam["flags"]:
        yield line((flag["kind"], "bad"), " ", (flag["task"], "name"), f": {flag['message']}")
    for text in score_rows.left_out(exam):
        yield VisibleText(f"it cannot learn {text}", style="quiet")
    yield VisibleText()
    yield VisibleText(score_rows.costs(exam), style="quiet")


def _table(exam: Mapping[str, Any]) -> Table:
    """Return a row for each capability with its verdict, and under it its tasks with their mean scores on their colours."""
    table = columns("", "score", "95 %", "twins", "drawn", "constant", right=range(1, 6))
    rows = score_rows.rows(exam)
    verdicts: Mapping[str, Mapping[str, Any]] = exam["verdicts"]
    order = list(dict.fromkeys([*verdicts, *(row.capability for row in rows)]))
    for capability in order:
        grade = verdicts[capability]["verdict"] if capability in verdicts else None
        mark = VisibleText(f"{score_rows.SIGNS[grade]} {grade}", style=STYLES[grade]) if grade else VisibleText("")
        table.add_row(VisibleText(capability, style="head"), mark)
        for row in (each for each in rows if each.capability == capability):
            _add_task(table, row)
    return table


def _add_task(table: Table, row: TaskRow) -> None:
    several = len(row.printed.scores) > 1
    ends = score_rows.interval(*row.printed.interval) if several else ""
    constant = SeedCell(() if row.constant is None else (row.constant,))
    cells = [shaded(cell) for cell in (row.printed, row.twins, row.drawn, constant)]
    table.add_row(VisibleText(f"  {row.name}", style="name"), cells[0], VisibleText(ends, style="quiet"), *cells[1:])


def shaded(cell: SeedCell) -> VisibleText:
    """Return a mean score on its colour."""
    if cell.mean is None:
        return VisibleText(cell.words or "·", style="quiet")
    background = score_rows.colour(cell.mean)
    return VisibleText(f" {cell.words} ", style=f"{chart.ink(background)} on {chart.hexadecimal(background)}")


def _diagnosis(each: Mapping[str, Any]) -> Iterable[RenderableType]:
    yield line(("diagnosis ", "warn"), (each["message"], "title"))
    for evidence in each["evidence"]:
        yield Padding(VisibleText(evidence, style="quiet"), (0, 0, 0, 2))
    for head in ("cause", "try", "source"):
        table = Table.grid(padding=(0, 1, 0, 0))
        table.add_column(width=6, style="quiet")
        table.add_column()
        table.add_row(head, VisibleText(each[head]))
        yield Padding(table, (0, 0, 0, 2))


# What several exams found: a table of learners and tasks, what is flagged, and pictures.


def print_exams(experiment: Experiment, found: LearnersExamined, folder: Path) -> None:
    """Show the exams of an experiment, and write the report of each, and pictures of them all."""
    from taskspec.base.files import near, safe_name
    from taskspec.cli.console import console, line, say
    from taskspec.exam.report import write, write_several
    from taskspec.exam.score_rows import named
    from taskspec.experiments.picture import draw

    out = console(wide=True)
    out.print(table_of(found.exams))
    for name, exam in found.exams.items():
        for flag in exam["flags"]:
            out.print(line((flag["kind"], "bad"), " ", (name, "name"), f" on {named(flag['task'])}: {flag['message']}"))
    written = [path for name, exam in found.exams.items() for path in write(exam, found.folders[name])]
    written += write_several(found.exams, folder, ["svg"])
    if any(instance.varied for instance in found.instances):
        path = folder / f"{safe_name(experiment.name)}.svg"
        draw(experiment, found.rows(), path, tuple(found.exams))
        written.append(path)
    for path in written:
        say(f"wrote {near(path)}")


def table_of(exams: Mapping[str, Mapping[str, Any]]) -> Table:
    """Mean scores: a row for each task, a column for each learner, each number on its colour."""
    from taskspec.cli.console import VisibleText, columns
    from taskspec.exam.score_rows import SeedCell, rows

    found = {name: {row.id: row for row in rows(exam)} for name, exam in exams.items()}
    tasks = {task: row.name for each in found.values() for task, row in each.items()}
    table = columns("", *exams, right=range(1, len(exams) + 1))
    for task, name in tasks.items():
        cells = [by[task].printed if task in by else SeedCell(()) for by in found.values()]
        table.add_row(VisibleText(name, style="name"), *map(shaded, cells))
    return table
