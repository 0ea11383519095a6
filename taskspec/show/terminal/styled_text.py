"""Styled text and tables on the terminal, through Rich.

Control characters of specs and file names are shown as escapes, never sent to the terminal. No cell of a table is ever cut off.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import rich.console
import rich.text
from rich.measure import Measurement
from rich.segment import Segment
from rich.text import Text

from taskspec.base.display import visible

if TYPE_CHECKING:
    from rich.table import Table


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
        self.file.write(re.sub(" +$", "", captured.get(), flags=re.MULTILINE))


def console(err: bool = False, wide: bool = False) -> Console:
    """Return the console of an output stream.

    Args:
        err: for standard error.
        wide: for tables, which may fill a terminal and keep to one line a row in a pipe; prose is set to `PAGE`.
    """
    from rich.theme import Theme

    stream = _stream(err)
    kind = PipedConsole if not stream.isatty() else Console
    width = None
    if terminal_width(err) is None:
        width = PIPED if wide else PAGE
    made = kind(file=stream, theme=Theme(STYLES), highlight=False, emoji=False, markup=False, width=width)
    if not wide:
        made.width = min(made.width, PAGE)
    return made


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


ENDS = "/?&"  # characters after which a prefix that all names share may end
UNBOUNDED = 10_000
MOST_PARTS = 3  # the most parts that a table is cut into; one that needs more is turned


class Columns:
    """A table without rules, which fits itself to the width of the terminal.

    Where it is too wide, it drops the prefix that all names share, then the spare columns, and then continues the other
    columns below, each part with the names, or turns rows into paragraphs. Numbers and names are never cut off.
    """

    def __init__(
        self,
        *headers: str,
        right: Iterable[int] = (),
        fold: Iterable[int] = (),
        styles: Sequence[str] = (),
        gap: int = 2,
        names: int | None = None,
        spare: Sequence[int] = (),
        widths: dict[int, int] | None = None,
    ) -> None:
        """Make a table without rows.

        Args:
            headers: one for each column; a table without any has no row for them.
            right: the columns that are aligned to the right.
            fold: the columns of prose, which may wrap.
            styles: the styles of the first columns.
            gap: blanks between columns.
            names: the column that identifies rows; those before it stay beside it.
            spare: the columns that can be dropped, the first one first.
            widths: the least widths of columns.
        """
        self.headers = headers
        self.right = set(right)
        self.fold = set(fold)
        self.styles = dict(enumerate(styles))
        self.gap = gap
        self.names = names
        self.spare = spare
        self.widths = widths or {}
        self.rows: list[list[Any]] = []

    def add_row(self, *cells: Any) -> None:
        """Add a row; cells that are missing at its end are empty."""
        self.rows.append([*cells, *[""] * (len(self.headers) - len(cells))])

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        shown = list(range(len(self.headers)))
        width = options.max_width
        if self.names is None:
            yield self._table(shown, {})
            return
        if self._needed(console, shown) > width:
            self._drop_prefix()
        for column in self.spare:
            if self._needed(console, shown) > width:
                shown.remove(column)
        widths = self._widths(console)
        parts = list(self._parts(console, shown, width))
        if len(parts) > MOST_PARTS or any(self._needed(console, part) > width for part in parts):
            yield from self._turned(shown, width)
            return
        for i, part in enumerate(parts):
            if i:
                yield ""
            yield self._table(part, widths)

    def __rich_measure__(self, console: Any, options: Any) -> Measurement:
        return Measurement.get(console, options, self._table(range(len(self.headers)), {}))

    def _widths(self, console: Any) -> dict[int, int]:
        """Width of each column: of its widest cell, or of its longest word if it may wrap."""
        options = console.options.update(max_width=UNBOUNDED)
        widths = {}
        for i, header in enumerate(self.headers):
            widths[i] = self.widths.get(i, 0)
            for cell in (header, *(row[i] for row in self.rows)):
                size = Measurement.get(console, options, cell)
                if i in self.fold:
                    widths[i] = max(widths[i], size.minimum)
                else:
                    widths[i] = max(widths[i], size.maximum)
        return widths

    def _needed(self, console: Any, shown: Sequence[int]) -> int:
        widths = self._widths(console)
        return sum(widths[i] + self.gap for i in shown) - self.gap

    def _table(self, shown: Iterable[int], widths: Mapping[int, int]) -> Table:
        from rich.table import Table

        columns = list(shown)
        has_header = any(self.headers[i] for i in columns)
        table = Table(
            box=None, pad_edge=False, padding=(0, self.gap, 0, 0), show_header=has_header, header_style="quiet"
        )
        for i in columns:
            table.add_column(
                self.headers[i], no_wrap=i not in self.fold, overflow="fold", min_width=widths.get(i, self.widths.get(i)),
                style=self.styles.get(i, ""), justify="right" if i in self.right else "left",
            )  # fmt: skip
        for row in self.rows:
            table.add_row(*(row[i] for i in columns))
        return table

    def _drop_prefix(self) -> None:
        """Remove what all names begin with, and put it above them; names that are indented are a group of their own."""
        assert self.names is not None
        groups: dict[bool, list[list[Any]]] = {}
        for row in self.rows:
            text = str(row[self.names])
            if set(ENDS) & set(text):
                groups.setdefault(text.startswith(" "), []).append(row)
        for is_indented, rows in sorted(groups.items(), reverse=True):
            indent = "  " * is_indented
            shared = shared_prefix([str(row[self.names]).strip() for row in rows])
            if len(rows) < 2 or not shared:
                continue
            for row in rows:
                style = row[self.names].style if isinstance(row[self.names], Text) else ""
                row[self.names] = Text(str(row[self.names]).replace(shared, "…", 1), style=style)
            above: list[Any] = [""] * len(self.headers)
            above[self.names] = Text(f"{indent}{shared}…", style="quiet")
            self.rows.insert(0, above)

    def _parts(self, console: Any, shown: Sequence[int], width: int) -> Iterator[list[int]]:
        assert self.names is not None
        beside = [i for i in shown if i <= self.names]
        part = list(beside)
        for i in shown[len(beside) :]:
            if len(part) > len(beside) and self._needed(console, [*part, i]) > width:
                yield part
                part = list(beside)
            part.append(i)
        yield part

    def _turned(self, shown: Sequence[int], width: int) -> Iterator[Text]:
        assert self.names is not None
        for row in self.rows:
            yield Text(" ").join(Text.assemble(row[i]) for i in range(self.names + 1) if str(row[i]))
            line = Text("   ")
            for i in shown:
                if i <= self.names or not str(row[i]):
                    continue
                header = self.headers[i].replace("\n", " ")
                cell = Text.assemble(" ", (header, "quiet"), " " * bool(header), row[i])
                if len(line) + len(cell) > width and len(line) > 3:
                    yield line
                    line = Text("   ")
                line.append_text(cell).append(" ")
            if len(line) > 3:
                yield line


def shared_prefix(names: Sequence[str]) -> str:
    """Return what all names begin with, up to the end of a part of an id or of a path."""
    shared = min(names, default="")
    while shared and not (shared[-1] in ENDS and all(name.startswith(shared) for name in names)):
        shared = shared[:-1]
    return shared
