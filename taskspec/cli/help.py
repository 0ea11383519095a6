"""The help of commands, and their errors about usage, in the style of all other output."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from taskspec.base.diagnostics import Diagnostic
from taskspec.base.limits import limits
from taskspec.cli.console import fail, reported, say
from taskspec.show.terminal.styled_text import Columns

FIRST = """\
First commands:
  taskspec list               the tasks that come with the package
  taskspec new my_task.yaml   a spec to start from
  taskspec exam bc            what is wrong with a learner
"""
LEFT = 26  # the width of what stands left of an explanation; what is longer stands on a line of its own
GENERIC = re.compile(r" ?(<list\[\w+\]>|<str>|<path>|<file>|<directory>|<bool>|TEXT|PATH|FILE)$")
NUMBERS = re.compile(r"<(int|float)( range)?>|(INTEGER|FLOAT)( RANGE)?")


class Command(TyperCommand):
    """A command with plain help."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print usage, what the command does, and its arguments and options."""
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for param in self.get_params(ctx):
            title = "Arguments" if param.param_type_name == "argument" else "Options"
            panels[title].append(_record(param, ctx))
        _print_help(self, ctx, panels)


class Commands(TyperGroup):
    """The commands; an error that one of them raises ends in a message and a status, never in a traceback."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return the arguments of the command; without any, show the help and three commands to begin with."""
        if not args and not ctx.resilient_parsing:
            say(ctx.get_help())
            say(FIRST)
            raise typer.Exit
        with usage_reported():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with reported(), usage_reported():
            limits()  # a mistake in the environment variable is reported before anything rests on it
            return super().invoke(ctx)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print usage, and the commands in groups."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for name in self.list_commands(ctx):
            command: Any = self.get_command(ctx, name)
            panel = command.rich_help_panel
            title = panel if isinstance(panel, str) else "Commands"
            panels.setdefault(title, []).append((name, command.get_short_help_str(400)))
        panels["Options"] = [_record(param, ctx) for param in self.get_params(ctx)]
        _print_help(self, ctx, panels)


@contextmanager
def usage_reported() -> Iterator[None]:
    """Turn errors about usage, which the parser of arguments raises, into messages of the package's own style."""
    try:
        yield
    except Exception as raised:
        error: Any = raised
        if getattr(error, "exit_code", None) != 2 or not hasattr(error, "format_message"):
            raise
        message = error.format_message().rstrip(".")
        text, _, hint = message.partition(" Did you mean")
        path = error.ctx.command_path if error.ctx is not None else "taskspec"
        near = f"did you mean{hint}" if hint else f"`{path} --help` shows what there is"
        text = f"{text[0].lower()}{text[1:]}".rstrip(".")
        fail([Diagnostic("E713", None, text, near)], 2)


def _record(param: Any, ctx: Any) -> tuple[str, str]:
    written, words = param.get_help_record(ctx) or (param.name, "")
    written = NUMBERS.sub("N", GENERIC.sub("", written))
    return written, re.sub(r"\s*\[(required|x>=?[\d.]+|[\d.]+<=?x.*?)\]", "", words)


def _print_help(command: Any, ctx: Any, panels: dict[str, list[tuple[str, str]]]) -> None:
    from rich.markup import render

    from taskspec.show.terminal.styled_text import console

    out = console()
    out.print(f"Usage: {ctx.command_path} {' '.join(_usage(command, ctx))}", style="title")
    out.print()
    for paragraph in (command.help or "").split("\n\n"):
        out.print(render(paragraph.strip("\n")))
        out.print()
    for title, rows in panels.items():
        if rows:
            out.print(title, style="head")
            _print_rows(out, rows)
            out.print()


def _usage(command: Any, ctx: Any) -> Iterator[str]:
    """Yield the parts of a command, arguments as their help names them: dots, too, are there once."""
    for piece in command.collect_usage_pieces(ctx):
        plain = re.sub(r"[{}]", "", piece)
        if "..." in plain[:-3]:
            plain = plain.removesuffix("...")
        yield re.sub(r"^\[(\[.*\](\.\.\.)?)\]$", r"\1", plain)


def _print_rows(out: Any, rows: Iterable[tuple[str, str]]) -> None:
    """Print explanations beside what they explain, or below it where that is long."""
    from rich.markup import render
    from rich.padding import Padding

    for written, words in rows:
        if len(written) > LEFT - 4:
            out.print(f"  {written}", style="name")
            out.print(Padding(render(words), (0, 0, 0, LEFT)))
            continue
        table = Columns("", "", fold=(1,), styles=("name",), gap=0, widths={0: LEFT})
        table.add_row(f"  {written}", render(words))
        out.print(table)
