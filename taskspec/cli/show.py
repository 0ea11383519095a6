"""`taskspec show`: a task as a page, as data, or as the code generated from it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.console import say
from taskspec.cli.options import Json, Modifiers, Parameters, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.task.task import Task


def show(
    task: TaskArgument,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    source: Annotated[bool, typer.Option("--source", help="The code generated for its environment.")] = False,
    json: Json = False,
) -> None:
    """Show a task as a page, or the code generated from it."""
    from taskspec.cli.console import console, write_records
    from taskspec.cli.page import print_page
    from taskspec.targets import tasks_of

    found = tasks_of(task, variant, parameters or [], modifiers or [])
    if json:
        write_records([_source_record(each) if source else _record(each) for each in found])
        return
    for each in found:
        if source:
            _print_source(each)
        else:
            print_page(each, console())


def _source_record(task: Task) -> dict[str, Any]:
    from taskspec.backends.scalar import compile_scalar

    return {"id": task.id, "language": "python", "source": compile_scalar(task).source}


def _print_source(task: Task) -> None:
    from taskspec.cli.console import colored, console

    code = _source_record(task)["source"]
    if colored():
        from rich.syntax import Syntax

        console(wide=True).print(Syntax(code, "python", theme="ansi_dark", background_color="default", word_wrap=True))
    else:
        say(code, nl=not code.endswith("\n"))


def _record(task: Task) -> dict[str, Any]:
    from taskspec.task.record import constants, record

    return {**record(task), "constants": constants(task), "spec": task.written}
