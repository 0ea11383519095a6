"""Output of commands: lines and JSON; and errors as messages with an exit status."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, hints_once, render
from taskspec.base.display import visible, visible_json
from taskspec.base.files import near, write_text
from taskspec.base.terminal import colored, terminal_width

DEBUG = "TASKSPEC_TRACEBACK"  # set in the environment, this variable shows where an internal error comes from
PASSED_ON = ("Exit", "Abort", "BrokenPipeError")  # by name: their modules differ between versions of typer


def say(text: str, err: bool = False, nl: bool = True) -> None:
    """Print plain text."""
    typer.echo(visible(text), err=err, nl=nl)


def say_written(paths: Iterable[Path]) -> None:
    """Print the files that were written."""
    for path in paths:
        say(f"wrote {near(path)}")


def write_output(text: str, place: Path | None) -> None:
    """Write a text to a file, and say so; without a place, to standard output."""
    if place is None:
        sys.stdout.write(text)
        return
    write_text(place, text)
    say(f"wrote {near(place)}", err=True)


def write_json(data: Any) -> None:
    """Print data as JSON."""
    say(visible_json(data))


def write_records(records: Sequence[Any]) -> None:
    """Print the records of several tasks as a JSON list, the record of one task alone."""
    write_json(records[0] if len(records) == 1 else list(records))


class UsageError(SpecError):
    """Wrong usage of a command: exit status 2."""


def misuse(message: str, hint: str | None = None, code: str = "E713") -> UsageError:
    """Return an error about options that mean nothing, alone or together."""
    return UsageError([Diagnostic(code, None, message, hint)])


@contextmanager
def reported() -> Iterator[None]:
    """Turn exceptions into messages: status 1 for errors, 2 for wrong usage, 130 for interrupts, 70 for internal errors."""
    try:
        yield
    except SpecError as error:
        fail(error.diagnostics, 2 if isinstance(error, UsageError) else 1)
    except BrokenPipeError:
        raise
    except (TaskspecError, OSError) as error:
        message = f"error: {error}"
        if isinstance(error, OSError):
            if error.filename is not None:
                name = f"{error.filename}: "
            else:
                name = ""
            message = f"error[E711 file-unreadable]: {name}{error.strerror or error}"
        say(message, err=True)
        raise typer.Exit(1) from None
    except KeyboardInterrupt as error:
        if str(error):
            say(str(error), err=True)
        raise typer.Exit(130) from None
    except Exception as error:
        name = type(error).__name__
        if name in PASSED_ON or hasattr(error, "exit_code") or os.environ.get(DEBUG):
            raise
        say(f"internal error: {name}: {error}\n  This is a bug in taskspec; {DEBUG}=1 shows where.", err=True)
        raise typer.Exit(70) from None


def fail(diagnostics: Iterable[Diagnostic], status: int = 1) -> None:
    """Report problems and end."""
    print_diagnostics(diagnostics)
    raise typer.Exit(status)


def print_diagnostics(diagnostics: Iterable[Diagnostic], err: bool = True) -> None:
    """Print problems; on a terminal in colour, and wrapped to its width."""
    color = colored(err)
    width = terminal_width(err)
    text = "\n\n".join(render([each], color=color, width=width) for each in hints_once(diagnostics))
    if text:
        typer.echo(text, err=err, color=color)
