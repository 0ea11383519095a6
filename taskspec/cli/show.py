"""`taskspec show`: a task as a page, as data, or as the code generated from it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.cli.console import say
from taskspec.cli.options import Json, Parameters, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.task.task import Task


def show(
    task: TaskArgument,
    variant: Variant = None,
    parameters: Parameters = None,
    source: Annotated[bool, typer.Option("--source", help="The code generated for its environment.")] = False,
    json: Json = False,
) -> None:
    """Show a task as a page, or the code generated from it."""
    from taskspec.cli.targets import task_of

    found = task_of(task, variant, parameters or [])
    if source:
        _print_source(found, json)
    elif json:
        _print_json(found)
    else:
        from taskspec.cli.console import console
        from taskspec.cli.page import print_page

        print_page(found, console())


def _print_source(task: Task, json: bool) -> None:
    from taskspec.backends.scalar.program import compile_scalar
    from taskspec.cli.console import colored, console, write_json

    code = compile_scalar(task).source
    if json:
        write_json({"id": task.id, "language": "python", "source": code})
    elif colored():
        from rich.syntax import Syntax

        console(wide=True).print(Syntax(code, "python", theme="ansi_dark", background_color="default", word_wrap=True))
    else:
        say(code, nl=not code.endswith("\n"))


def _print_json(task: Task) -> None:
    from taskspec.cli.console import write_json
    from taskspec.cli.records import constants, record

    write_json({**record(task), "constants": constants(task), "spec": task.written})
