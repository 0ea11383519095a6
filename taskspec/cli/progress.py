"""What is told while something takes long.

At the foot of a terminal, this is a line or a bar that is gone when it is done; elsewhere, lines that stay.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from taskspec.base.display import visible
from taskspec.base.limits import progress_listener
from taskspec.cli.console import say

if TYPE_CHECKING:
    from taskspec.jobs.running import JobProgress

PATIENCE = 1.0
EVERY = 0.1
"""Seconds before the line is shown, and between its changes."""
BETWEEN_LINES = 10.0
"""Seconds between the lines of a run where there is no terminal."""
SLOW = 10.0
"""Seconds after which a line names a part that takes long, where there is no terminal."""
LOOK = 0.5
"""Seconds between looks at the clock."""
WIDTH = 20
"""Of a bar in the line, in letters."""


def is_terminal() -> bool:
    """Return whether somebody sees it."""
    return sys.stderr.isatty()


@contextmanager
def progress(name: str) -> Iterator[None]:
    """Within the block, standard error tells what is done now.

    On a terminal this is a line that changes, with a bar and the time left where shares are told; elsewhere a line for each part
    that takes long.
    """
    line = _Line(name) if is_terminal() else _Watch(name)
    try:
        with progress_listener(line.show):
            yield
    finally:
        line.clear()


@contextmanager
def bar(name: str) -> Iterator[Callable[[JobProgress], None]]:
    """A function that shows on standard error how far a run is, within the block: a bar, a rate, and the time left."""
    if not is_terminal():
        yield _Lines(name).show
        return
    from rich.progress import BarColumn, Progress, TextColumn

    from taskspec.cli.console import console

    name_column = TextColumn("{task.description}", markup=False)
    columns = (name_column, BarColumn(), "{task.completed}/{task.total}", "{task.fields[words]}")
    with Progress(*columns, console=console(err=True), transient=True) as shown:
        row = shown.add_task(visible(name), total=None, words="")
        yield lambda s: shown.update(row, total=s.total, completed=s.over, words=_words(s))


@contextmanager
def counter(name: str, total: int, delay: float = 0.0, quiet: bool = False) -> Iterator[Callable[[], None]]:
    """Yield a function that advances a bar of `total` parts, shown on a terminal after `delay` seconds."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from taskspec.cli.console import console

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    shown = Progress(*columns, console=console(err=True), transient=True, disable=quiet or not is_terminal())
    row = shown.add_task(name, total=total)
    start = time.monotonic()

    def advance() -> None:
        if not shown.live.is_started and time.monotonic() - start >= delay:
            shown.start()
        shown.advance(row)

    try:
        yield advance
    finally:
        shown.stop()


def _words(reached: JobProgress) -> str:
    failed = f"{reached.failed} failed" if reached.failed else ""
    rate = "" if reached.left is None else f"{reached.rate:.3g}/s, {timedelta(seconds=round(reached.left))} left"
    return ", ".join(filter(None, (failed, rate)))


class _Lines:
    """How far a run is, in lines for those who read it later."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.due = time.monotonic() + BETWEEN_LINES

    def show(self, reached: JobProgress) -> None:
        now = time.monotonic()
        if now < self.due:
            return
        counts = f"{reached.over}/{reached.total}"
        words = ", ".join(filter(None, (counts, _words(reached))))
        say(f"{self.name}: {words}", err=True)
        self.due = now + BETWEEN_LINES


class _Line:
    def __init__(self, name: str) -> None:
        self.name = name
        self.start = time.monotonic()
        self.due = self.start + PATIENCE
        self.is_shown = False
        self.share: float | None = None
        self.began = self.start  # with what the share is of

    def show(self, what: str, share: float | None = None) -> None:
        now = time.monotonic()
        if share is not None:  # what is told from now on is of this part
            self.began = now if self.share is None or share < self.share else self.began
            self.name = what
            self.share = share
            what = ""
        if now < self.due:
            return
        words = visible(f"{self._bar(now)}{': '.join(filter(None, (self.name, what)))} ({now - self.start:.0f} s)")
        sys.stderr.write("\r\x1b[K" + words[: shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()
        self.due = now + EVERY
        self.is_shown = True

    def _bar(self, now: float) -> str:
        """Return how much is over, and for how long the rest may take."""
        if self.share is None:
            return ""
        done = round(WIDTH * self.share)
        left = f"{(now - self.began) * (1 - self.share) / self.share:.0f} s left, " if self.share else ""
        return f"{'━' * done}{'╌' * (WIDTH - done)} {left}"

    def clear(self) -> None:
        if self.is_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


class _Watch:
    """Tells, in a line each, which parts take long. A thread looks at the clock, for a long part may tell nothing for minutes."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.part = ""
        self.step = ""
        self.since = time.monotonic()
        self.is_told = False
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._look, daemon=True)
        self.thread.start()

    def show(self, what: str, share: float | None = None) -> None:
        if share is None:
            self.step = what
            return
        self.part = what
        self.step = ""
        self.since = time.monotonic()
        self.is_told = False

    def _look(self) -> None:
        while not self.over.wait(LOOK):
            if not self.is_told and time.monotonic() - self.since >= SLOW:
                self.is_told = True
                words = ": ".join(filter(None, (self.name, self.part, self.step)))
                sys.stderr.write(visible(f"{words} takes more than {SLOW:g} s") + "\n")
                sys.stderr.flush()

    def clear(self) -> None:
        self.over.set()
        self.thread.join()
