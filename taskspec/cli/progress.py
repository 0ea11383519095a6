"""Progress of commands that take long, on standard error.

On a terminal, a line that changes and is gone when the work is done; elsewhere, a line that stays every ten seconds.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from taskspec.base.display import visible
from taskspec.base.limits import progress_listener
from taskspec.cli.console import say

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
