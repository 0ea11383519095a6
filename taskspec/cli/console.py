"""Output of commands: text, tables and JSON; and errors as messages with an exit status.

Control characters of specs and file names are shown as escapes, never sent to the terminal.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rich.console
import rich.text
import typer
from rich.segment import Segment

from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, render
from taskspec.base.display import visible, visible_json
from taskspec.base.files import near, write_text

STYLES = {
    "title": "bold",
    "head": "bold bright_blue",
    "name": "cyan",
    "value": "green",
    "quiet": "dim",
    "good": "green",
    "bad": "bold red",
    "warn": "bold yellow",
}
PAGE = 100  # the largest width of prose
PIPED = 4096  # the width of tables in pipes: every row stays on one line
DEBUG = "TASKSPEC_TRACEBACK"  # set in the environment, this variable shows where an internal error comes from
PASSED_ON = ("Exit", "Abort", "BrokenPipeError")  # by name: their modules differ between versions of typer


class VisibleText(rich.text.Text):
    """Styled text, visible before its width is measured."""

    def __init__(self, text: str = "", *args: Any, **options: Any) -> None:
        super().__init__(visible(text), *args, **options)

    def append(self, text: Any, style: Any = None) -> VisibleText:
        super().append(visible(text) if isinstance(text, str) else text, style)
        return self


class Console(rich.console.Console):
    """A Rich console that shows control characters as escapes."""

    def render_str(self, text: str, **options: Any) -> rich.text.Text:
        return super().render_str(visible(text), **options)

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


class PipedConsole(Console):
    """A console that strips trailing blanks, for files and other programs."""

    def print(self, *objects: Any, **options: Any) -> None:
        with self.capture() as captured:
            super().print(*objects, **options)
        text = captured.get()
        self.file.write("\n".join(line.rstrip(" ") for line in text.split("\n")))


def console(err: bool = False, wide: bool = False) -> Console:
    """Return the console of an output stream.

    Args:
        err: for standard error.
        wide: for tables, which may fill a terminal and keep to one line a row in a pipe; prose is set to `PAGE`.
    """
    from rich.theme import Theme

    stream = _stream(err)
    kind = Console if stream.isatty() else PipedConsole
    width = None
    if terminal_width(err) is None:
        width = PIPED if wide else PAGE
    found = kind(file=stream, theme=Theme(STYLES), highlight=False, emoji=False, markup=False, width=width)
    if not wide:
        found.width = min(found.width, PAGE)
    return found


def _stream(err: bool) -> Any:
    if err:
        return sys.stderr
    return sys.stdout


def colored(err: bool = False) -> bool:
    """Return whether a stream gets colours."""
    if os.environ.get("NO_COLOR"):
        return False
    return bool(_stream(err).isatty() or os.environ.get("FORCE_COLOR"))


def terminal_width(err: bool = False) -> int | None:
    """Return the columns of a terminal, or COLUMNS; None without either."""
    if _stream(err).isatty() or os.environ.get("COLUMNS", "").isdigit():
        return shutil.get_terminal_size().columns
    return None


def say(text: str, err: bool = False, nl: bool = True) -> None:
    """Print plain text."""
    typer.echo(visible(text), err=err, nl=nl)


def line(*parts: tuple[str, str] | str) -> VisibleText:
    """Return a line of text in several styles, from parts `("words", "style")` or plain words."""
    text = VisibleText(no_wrap=False)
    for part in parts:
        if isinstance(part, str):
            text.append(part)
        else:
            text.append(*part)
    return text


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
    """Print the records of several tasks as a JSON list, or that of one task alone."""
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
            name = f"{error.filename}: " if error.filename is not None else ""
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
    text = "\n\n".join(render([each], color=color, width=width) for each in diagnostics)
    if text:
        typer.echo(text, err=err, color=color)
