"""Styled text and tables on the terminal, through Rich.

Control characters of specs and file names are shown as escapes, never sent to the terminal.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable
from typing import Any

import rich.console
import rich.text
from rich.segment import Segment

from taskspec.base.display import visible

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
    if stream.isatty():
        kind = Console
    else:
        kind = PipedConsole
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


def line(*parts: tuple[str, str] | str) -> VisibleText:
    """Return a line of text in several styles, from parts `("words", "style")` or plain words."""
    text = VisibleText(no_wrap=False)
    for part in parts:
        if isinstance(part, str):
            text.append(part)
        else:
            text.append(*part)
    return text
