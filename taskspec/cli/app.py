"""The `taskspec` program: its commands, and the one place where errors become messages and exit statuses."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from typing import Annotated

import typer
from typer import Option

from taskspec.base import __version__
from taskspec.cli.audit import audit
from taskspec.cli.build import build
from taskspec.cli.card import card
from taskspec.cli.check import check
from taskspec.cli.data import demos, preferences
from taskspec.cli.diff import diff
from taskspec.cli.docs import docs
from taskspec.cli.exam import exam
from taskspec.cli.explain import explain
from taskspec.cli.export import export
from taskspec.cli.figure import figure
from taskspec.cli.fmt import fmt
from taskspec.cli.freeze import freeze
from taskspec.cli.help import Command, Commands
from taskspec.cli.import_ import import_
from taskspec.cli.list import list_
from taskspec.cli.lsp import lsp
from taskspec.cli.new import new
from taskspec.cli.options import flowed
from taskspec.cli.play import play
from taskspec.cli.report import report
from taskspec.cli.run import run
from taskspec.cli.schema import schema
from taskspec.cli.score import score
from taskspec.cli.separate import separate
from taskspec.cli.show import show
from taskspec.cli.solve import solve
from taskspec.cli.studio import studio
from taskspec.cli.sweep import sweep

COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "Read tasks": (list_, show, explain),
    "Write tasks": (new, check, fmt, diff, build, freeze, import_, schema, lsp, studio),
    "Run and score tasks": (
        run, play, solve, score, sweep, exam, report, separate, audit, demos, preferences,
    ),
    "Print tasks": (export, docs, card, figure),
}  # fmt: skip


def command_name(function: Callable[..., None]) -> str:
    """Return the name of a command; functions named like a word of Python have a line after it."""
    return function.__name__.rstrip("_")


app = typer.Typer(
    name="taskspec",
    cls=Commands,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


for _panel, _functions in COMMANDS.items():
    for _function in _functions:
        app.command(command_name(_function), cls=Command, rich_help_panel=_panel, help=flowed(_function.__doc__ or ""))(
            _function
        )


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"taskspec {__version__}")
        raise typer.Exit


@app.callback()
def taskspec(
    version: Annotated[bool, Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    """Tiny diagnostic reinforcement-learning tasks, each declared in one YAML file.

    A TASK is an id ([cyan]derail/Branching-v0[/], or [cyan]Branching[/] where that is clear) or the path of a spec.
    """


def main() -> None:
    """Run the program; a reader that goes away (`taskspec list | head`) is no error."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal that lacks a letter shows a question mark
            stream.reconfigure(errors="replace")
    gc.set_threshold(100_000, 50, 50)  # tasks and models are many small objects, and few of them become garbage
    try:
        app(prog_name="taskspec")
    finally:
        try:
            if not sys.stdout.closed:  # the language server closes it
                sys.stdout.flush()
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        gc.freeze()  # the program ends: looking for garbage among all tasks and models would take a sixth of `check`
