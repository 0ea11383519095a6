"""`taskspec export`: tasks in the formats of other tools."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from taskspec.base.files import near, write_bytes
from taskspec.cli import options
from taskspec.cli.console import misuse, progress, say, write_json
from taskspec.show.terminal.styled_text import Columns, console

if TYPE_CHECKING:
    from taskspec.exact.model.model import Model
    from taskspec.language.task.task import Task
    from taskspec.tools.exchange.frozen_task import FrozenTask

FORMATS = ("umb", "gym-p", "npz")
Format = Annotated[str, options.formats_option(FORMATS, "umb for model checkers, gym-p and npz for Python.")]


def export(
    task: options.TaskArgument,
    format: Format = "umb",
    output: Annotated[
        Path | None, options.file_option("--output", "-o", help="The file; standard output by default, for text.")
    ] = None,
    verify: Annotated[bool, Option("--verify", help="Let Storm solve the file, and compare the returns.")] = False,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    limits: options.LimitsGiven = None,
    json: options.Json = False,
) -> None:
    """Write a finite task in a format of other tools, or its abstraction.

    Probabilities and rewards are the rationals that the spec writes, where the format has them. Notes say what the format
    cannot carry. [green]--verify[/] compares the optimal, random and worst return with Storm's, without rounding, and fails
    where they differ.
    """
    from taskspec.tools.exchange import formats
    from taskspec.tools.targets import task_of

    chosen = formats.FORMATS[options.checked_choice("--format", format, FORMATS)]
    if verify and chosen.name != "umb":
        raise misuse("--verify goes with --format umb", code="E726")
    built = task_of(task, variant, parameters or [], modifiers or [])
    if output is None and not (verify or chosen.is_text):
        raise misuse(f"--format {chosen.name} is binary", f"--output {built.name}{chosen.suffix}")
    with progress(built.instance_id):
        model, tables = formats.exported(built, chosen)
    if output is not None:
        write_bytes(output, formats.written(tables, chosen))
        say(f"wrote {near(output)}", err=True)
    elif not verify:
        sys.stdout.write(formats.written(tables, chosen).decode())
    if not json:
        for note in formats.notes(built, tables, chosen):
            say(f"  {note}", err=True)
    if verify:
        _verify(built, model, tables, json)


def _verify(task: Task, model: Model, tables: FrozenTask, json: bool) -> None:
    """Print our returns beside Storm's; the exit status is 1 where they differ."""
    from taskspec.tools.exchange.storm import compared

    with progress(f"{task.instance_id} by Storm"):
        rows = list(compared(model, tables))
    if json:
        write_json([row.record() for row in rows])
    else:
        table = Columns("return", "taskspec", "Storm", "", styles=("name",), fold=(2,))
        for row in rows:
            table.add_row(row.which, str(row.ours), row.shown, row.verdict)
        console(wide=True).print(table)
    if not all(row.agrees for row in rows):
        raise typer.Exit(1)
