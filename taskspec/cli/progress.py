"""Progress of commands that take long.

On a terminal, a line that changes and is gone when the work is done; elsewhere, only jobs are reported, in lines that stay.
"""

from __future__ import annotations

import shutil
import sys
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
"""Seconds before the line is shown."""
EVERY = 0.1
"""Seconds between changes of the line."""
BETWEEN_LINES = 10.0
"""Seconds between lines about jobs where there is no terminal."""
WIDTH = 20
"""The width of a bar in characters."""


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


@contextmanager
def job_progress(name: str) -> Iterator[Callable[[JobProgress], None]]:
    """Yield a function that shows on standard error how far jobs are."""
    display = ProgressLine(name)
    due = time.monotonic() + BETWEEN_LINES

    def show(reached: JobProgress) -> None:
        nonlocal due
        words = f"{reached.over}/{reached.total}"
        if reached.failed:
            words += f", {reached.failed} failed"
        display.show(f"{name} {words}", reached.over / max(reached.total, 1))
        if not is_terminal() and time.monotonic() >= due:
            if reached.left is not None:
                words += f", {reached.rate:.3g}/s, {timedelta(seconds=round(reached.left))} left"
            say(f"{name}: {words}", err=True)
            due = time.monotonic() + BETWEEN_LINES

    try:
        yield show
    finally:
        display.clear()


@contextmanager
def counter(name: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that counts one of `total` parts as done, shown on terminals."""
    display = ProgressLine(name)
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        display.show(f"{name} {done}/{total}", done / total)

    try:
        yield advance
    finally:
        display.clear()


class ProgressLine:
    """A line at the foot of a terminal: a bar, the time left, and what is done now."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.start = time.monotonic()
        self.due = self.start + PATIENCE
        self.is_shown = False
        self.share: float | None = None
        self.first = 0.0  # the share that was done when this count began
        self.began = self.start

    def show(self, what: str, share: float | None = None) -> None:
        if not is_terminal():
            return
        now = time.monotonic()
        if share is not None:  # what is reported from now on is of this part
            if self.share is None or share < self.share:
                self.began = now
                self.first = share
            self.name = what
            self.share = share
            what = ""
        if now < self.due:
            return
        text = ": ".join(filter(None, (self.name, what)))
        words = visible(f"{self._bar(now)}{text} ({now - self.start:.0f} s)")
        sys.stderr.write("\r\x1b[K" + words[: shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()
        self.due = now + EVERY
        self.is_shown = True

    def _bar(self, now: float) -> str:
        if self.share is None:
            return ""
        done = round(WIDTH * self.share)
        drawn = f"{'━' * done}{'╌' * (WIDTH - done)} "
        if self.share > self.first:
            left = (now - self.began) * (1 - self.share) / (self.share - self.first)
            drawn += f"{left:.0f} s left, "
        return drawn

    def clear(self) -> None:
        if self.is_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
