"""Errors as messages: what went wrong, on standard error, and an exit status."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, render

DEBUG = "TASKSPEC_TRACEBACK"
"""Set in the environment, this variable shows where an internal error comes from."""
OUR_OWN = ("Exit", "Abort", "BrokenPipeError")  # by name: their modules differ between versions of typer


class UsageError(SpecError):
    """Wrong usage of a command: exit status 2."""


@contextmanager
def reported() -> Iterator[None]:
    """Turn exceptions into messages: status 1 for errors, 2 for wrong usage, 130 for interrupts, 70 for internal errors."""
    try:
        yield
    except SpecError as error:
        fail(error.diagnostics, 2 if isinstance(error, UsageError) else 1)
    except (TaskspecError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            raise
        _say(_words(error))
        raise typer.Exit(1) from None
    except KeyboardInterrupt as error:
        if str(error):
            _say(str(error))
        raise typer.Exit(130) from None
    except Exception as error:
        if type(error).__name__ in OUR_OWN or hasattr(error, "exit_code") or os.environ.get(DEBUG):
            raise
        _say(f"internal error: {type(error).__name__}: {error}\n  This is a bug in taskspec; {DEBUG}=1 shows where.")
        raise typer.Exit(70) from None


def fail(diagnostics: Iterable[Diagnostic], status: int = 1) -> None:
    """Report problems and end."""
    show(diagnostics)
    raise typer.Exit(status)


def show(diagnostics: Iterable[Diagnostic], err: bool = True) -> None:
    """Print problems; on a terminal in colour, and wrapped to its width."""
    from taskspec.cli.console import colored, terminal_width

    color = colored(err)
    width = terminal_width(err)
    text = "\n\n".join(render([each], color=color, width=width) for each in diagnostics)
    if text:
        typer.echo(text, err=err, color=color)


def misuse(message: str, hint: str | None = None) -> UsageError:
    """Return an error about options that mean nothing, alone or together."""
    return UsageError([Diagnostic("E713", None, message, hint)])


def _words(error: Exception) -> str:
    if isinstance(error, OSError):
        name = "" if error.filename is None else f"{error.filename}: "
        return f"error[E711 file-unreadable]: {name}{error.strerror or error}"
    return f"error: {error}"


def _say(text: str) -> None:
    from taskspec.cli.console import say

    say(text, err=True)
