"""A line at the foot of the terminal that says what takes so long, and goes when it is done."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from taskspec.progress import told_to
from taskspec.visible import visible

PATIENCE, EVERY = 1.0, 0.1
"""Seconds before the line is shown, and between its changes."""


@contextmanager
def progress(name: str) -> Iterator[None]:
    """Within the block, a line on standard error tells what the analysis of a task is at. Only terminals see it."""
    if not sys.stderr.isatty():
        yield
        return
    line = _Line(name)
    try:
        with told_to(line.show):
            yield
    finally:
        line.clear()


class _Line:
    def __init__(self, name: str) -> None:
        self.name, self.start = name, time.monotonic()
        self.due, self.is_shown = self.start + PATIENCE, False

    def show(self, what: str) -> None:
        now = time.monotonic()
        if now < self.due:
            return
        words = visible(f"{self.name}: {what} ({now - self.start:.0f} s)")
        sys.stderr.write("\r\x1b[K" + words[: shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()
        self.due, self.is_shown = now + EVERY, True

    def clear(self) -> None:
        if self.is_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
