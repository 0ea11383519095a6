"""Output of commands: lines and JSON; errors as messages with an exit status; and the progress of commands that take long.

Progress goes to standard error: on a terminal, a line that changes and is gone when the work is done; elsewhere, a line that
stays every ten seconds.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, hints_once, render
from taskspec.base.display import visible, visible_json
from taskspec.base.files import near, write_text
from taskspec.base.limits import progress_listener
from taskspec.show.terminal.styled_text import colored, terminal_width

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
    say(visible_json(data))


def write_records(records: Sequence[Any]) -> None:
    """Print the records of several tasks as a JSON list, the record of one task alone."""
    if len(records) == 1:
        write_json(records[0])
    else:
        write_json(list(records))


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
            name = ""
            if error.filename is not None:
                name = f"{error.filename}: "
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


PATIENCE = 1.0  # seconds before the line is shown
EVERY = 0.1  # seconds between changes of the line
BETWEEN_LINES = 10.0  # seconds between lines where there is no terminal
WIDTH = 20  # the width of a bar in characters


def is_terminal() -> bool:
    """Return whether somebody sees it."""
    return sys.stderr.isatty()


@contextmanager
def progress(name: str) -> Iterator[None]:
    """Within the block, standard error shows what `base.limits.tell` reports, with a bar where it reports shares."""
    display = ProgressLine(name)
    try:
        with progress_listener(display.show):
            yield
    finally:
        display.clear()


class ProgressLine:
    """The current work and the time left; on a terminal, one line with a bar."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.start = time.monotonic()
        self.due = self.start + (PATIENCE if is_terminal() else BETWEEN_LINES)
        self.is_shown = False
        self.share: float | None = None
        self.first = 0.0  # the share that was done when this count began
        self.began = self.start

    def show(self, what: str, share: float | None = None) -> None:
        """Show what is done now; with a share, what is reported from now on is of this part."""
        now = time.monotonic()
        if share is not None:
            if self.share is None or share < self.share:
                self.began = now
                self.first = share
            self.name = what
            self.share = share
            what = ""
        if now < self.due:
            return
        text = ": ".join(filter(None, (self.name, what)))
        words = visible(f"{self._left(now)}{text} ({now - self.start:.0f} s)")
        if not is_terminal():
            say(words, err=True)
            self.due = now + BETWEEN_LINES
            return
        sys.stderr.write("\r\x1b[K" + f"{self._bar()}{words}"[: shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()
        self.due = now + EVERY
        self.is_shown = True

    def _bar(self) -> str:
        if self.share is None:
            return ""
        done = round(WIDTH * self.share)
        return f"{'━' * done}{'╌' * (WIDTH - done)} "

    def _left(self, now: float) -> str:
        if self.share is None or self.share <= self.first:
            return ""
        left = (now - self.began) * (1 - self.share) / (self.share - self.first)
        return f"{left:.0f} s left, "

    def clear(self) -> None:
        """Remove the line from the terminal."""
        if self.is_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
