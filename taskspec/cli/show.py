"""`taskspec show`: a task as a page, or its code."""

from __future__ import annotations

from typing import Annotated, Any

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import say, write_records
from taskspec.show.terminal.styled_text import colored, console


def show(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    source: Annotated[bool, Option("--source", help="The code generated for its environment.")] = False,
    json: options.Json = False,
) -> None:
    """Show a task as a page, or the code generated from it."""
    from taskspec.programs.scalar import compile_scalar
    from taskspec.show.pages.render.terminal import print_page
    from taskspec.show.record import constants, record
    from taskspec.tools.targets import tasks_of

    tasks = tasks_of(task, variant, parameters or [], modifiers or [])
    records: list[dict[str, Any]] = []
    for each in tasks:
        if source:
            code = compile_scalar(each).source
            records.append({"id": each.id, "language": "python", "source": code})
            if not json:
                _print_source(code)
        elif json:
            records.append({**record(each), "constants": constants(each), "spec": each.written})
        else:
            print_page(each, console())
    if json:
        write_records(records)


def _print_source(code: str) -> None:
    if not colored():
        say(code, nl=not code.endswith("\n"))
        return
    from rich.syntax import Syntax

    console(wide=True).print(Syntax(code, "python", theme="ansi_dark", background_color="default", word_wrap=True))
