"""What several exams found: a table of learners and tasks, what is flagged, and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.experiments import LearnersExamined
    from taskspec.task.schema.experiments import Experiment


def print_exams(experiment: Experiment, found: LearnersExamined, folder: Path) -> None:
    """Show the exams of an experiment, and write the report of each, and pictures of them all."""
    from taskspec.cli.console import console, line, say
    from taskspec.cli.targets import near
    from taskspec.exam.report import write, write_several
    from taskspec.exam.report.told import named
    from taskspec.experiments.picture import draw
    from taskspec.extras import is_installed
    from taskspec.files import safe_name

    out = console(wide=True)
    out.print(table_of(found.exams))
    for name, exam in found.exams.items():
        for flag in exam["flags"]:
            out.print(line((flag["kind"], "bad"), " ", (name, "name"), f" on {named(flag['task'])}: {flag['message']}"))
    written = [path for name, exam in found.exams.items() for path in write(exam, found.folders[name])]
    if is_installed("matplotlib"):
        written += write_several(found.exams, folder, ["svg"])
        if any(instance.varied for instance in found.instances):
            path = folder / f"{safe_name(experiment.name)}.svg"
            draw(experiment, found.rows(), path, tuple(found.exams))
            written.append(path)
    for path in written:
        say(f"wrote {near(path)}")


def table_of(exams: Mapping[str, Mapping[str, Any]]) -> Table:
    """Mean scores: a row for each task, a column for each learner, each number on its colour."""
    from taskspec.cli.console import columns
    from taskspec.cli.examined import shaded
    from taskspec.cli.terminal import VisibleText
    from taskspec.exam.report.told import SeedCell, rows

    found = {name: {row.id: row for row in rows(exam)} for name, exam in exams.items()}
    tasks = {task: row.name for each in found.values() for task, row in each.items()}
    table = columns("", *exams, right=range(1, len(exams) + 1))
    for task, name in tasks.items():
        cells = [by[task].printed if task in by else SeedCell(()) for by in found.values()]
        table.add_row(VisibleText(name, style="name"), *map(shaded, cells))
    return table
