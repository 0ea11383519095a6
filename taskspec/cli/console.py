"""Output of commands: one theme, one width, one kind of table, and JSON.

Control characters of specs and file names are shown as escapes, never sent to the terminal.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import rich.console
import rich.text
import typer
from rich.segment import Segment

from taskspec.base.display import visible, visible_json

if TYPE_CHECKING:
    from rich.table import Table


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
PAGE = 100
"""The largest width of prose."""
PIPED = 4096
"""The width of tables in pipes: every row stays on one line."""


def console(err: bool = False, wide: bool = False) -> Console:
    """Return the console of an output stream.

    Args:
        err: for standard error.
        wide: for tables, which may fill a terminal and keep to one line a row in a pipe; prose is set to `PAGE`.
    """
    from rich.theme import Theme

    stream = sys.stderr if err else sys.stdout
    theme = Theme(STYLES)
    kind = Console if stream.isatty() else PipedConsole
    found = kind(file=stream, theme=theme, highlight=False, emoji=False, markup=False, width=_piped(stream, wide))
    if not wide and found.width > PAGE:
        found.width = PAGE
    return found


def _piped(stream: Any, wide: bool) -> int | None:
    """Return the width for a stream that is no terminal; None leaves it to the terminal, or to COLUMNS."""
    if stream.isatty() or os.environ.get("COLUMNS", "").isdigit():
        return None
    return PIPED if wide else PAGE


def colored(err: bool = False) -> bool:
    """Return whether a stream gets colours."""
    stream = sys.stderr if err else sys.stdout
    if os.environ.get("NO_COLOR"):
        return False
    return stream.isatty() or bool(os.environ.get("FORCE_COLOR"))


def terminal_width(err: bool = False) -> int | None:
    """Return the columns of a terminal, or COLUMNS; None without either."""
    stream = sys.stderr if err else sys.stdout
    if not stream.isatty() and not os.environ.get("COLUMNS", "").isdigit():
        return None
    return shutil.get_terminal_size().columns


def write_json(data: Any) -> None:
    """Print data as JSON; infinities, which JSON cannot hold, become text."""
    say(to_json(data))


def write_records(records: Sequence[Any]) -> None:
    """Print the records of several tasks as a JSON list, or that of one task alone."""
    write_json(records[0] if len(records) == 1 else list(records))


def to_json(data: Any) -> str:
    return visible_json(_finite(data))


def _finite(data: Any) -> Any:
    match data:
        case dict():
            return {str(key): _finite(value) for key, value in data.items()}
        case list() | tuple():
            return [_finite(item) for item in data]
        case float() if data != data or abs(data) == float("inf"):
            return str(data)
        case _:
            return data


def say(text: str, err: bool = False, nl: bool = True) -> None:
    """Print plain text."""
    typer.echo(visible(text), err=err, nl=nl)


def line(*parts: tuple[str, str] | str) -> VisibleText:
    """Return a line of text in several styles, from parts `("words", "style")` or plain words."""
    text = VisibleText(no_wrap=False)
    for part in parts:
        text.append(*((part,) if isinstance(part, str) else part))
    return text


def columns(*headers: str, right: Iterable[int] = (), fold: Iterable[int] = ()) -> Table:
    """Return a table without rules; columns in `right` are aligned to the right, those in `fold` may wrap."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=any(headers), header_style="quiet")
    for i, header in enumerate(headers):
        table.add_column(header, justify="right" if i in right else "left", no_wrap=i not in fold)
    return table
