"""Frames of an environment, and the window that shows them: `render_mode="rgb_array"` and `"human"`.

Figures lie above environments in the layers, so they are resolved by name, as `Task.make` does it, and when needed.
"""

from __future__ import annotations

import contextlib
import importlib
import re
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np

from taskspec.envs import picture
from taskspec.extras import need
from taskspec.task.task import Task

LETTERS, LINES = 42, 2
"""Of a line of a note, and as many lines as there is room for, in every frame."""
KEPT = 200
"""Steps of an episode that are kept, to be drawn over time: `figures.values.STEPS`."""
Frame = np.ndarray[Any, np.dtype[np.uint8]]


def require() -> None:
    """Import what pictures need, so that a missing package is missed at once.

    Raises:
        SpecError: E705, with what to install.
    """
    need("matplotlib", "figures")


class Frames:
    """Draws the states of episodes one after the other, and keeps those that it drew of the present one: `KEPT` steps back."""

    def __init__(self) -> None:
        self._seen: dict[int, dict[str, Any]] = {}
        self._episode = 0

    def draw(self, task: Task, state: dict[str, Any], time: int, note: str | None = None, *, episode: int = 0) -> Frame:
        """The present state; another number, or an earlier time than before, begins another episode."""
        if episode != self._episode:
            self._seen, self._episode = {}, episode
        kept = {t: s for t, s in self._seen.items() if time - KEPT <= t < time}
        self._seen = kept | {time: state}
        return frame(task, state, time, note, self._seen)


def frame(
    task: Task,
    state: dict[str, Any],
    time: int,
    note: str | None = None,
    seen: Mapping[int, dict[str, Any]] | None = None,
) -> Frame:
    """A state as pixels: (height, width, 3), uint8; a note stands above it, cut to what has room.

    `seen` are the states of the episode by time, the present one included.
    """
    from taskspec.figures import render_frame  # what draws is not imported until something is drawn

    title = picture.heading(task, time)
    if note is not None:
        lines = textwrap.wrap(_set(note), LETTERS, max_lines=LINES, placeholder="…")
        title = "\n".join([title, *lines, *[""] * (LINES - len(lines))])
    return render_frame(task, state, title, seen=seen or {time: state})


def _set(note: str) -> str:
    """A note with minus signs, and with numbers that stay on the line of what they are the values of."""
    note = re.sub(r"(?<![\w-])-(?=[\d.]|inf)|(?<=\de)-(?=\d)", "−", note)
    return re.sub(r"(?<=\w) (?==)|(?<=[\w=]) (?=[−\d]|inf)|(?<==) ", "\u00a0", note)


class Window:
    """A matplotlib window that shows one picture after the other; on a backend without windows nothing is seen.

    Args:
        title: of the window.
        fps: pictures per second; `show` takes as long as one of them lasts.
    """

    def __init__(self, title: str, fps: float) -> None:
        self._title, self._pause = title, 1.0 / fps
        self._figure: Any = None
        self._image: Any = None

    def show(self, pixels: Frame) -> None:
        """Replace the picture. A window that its user has closed stays closed."""
        if self._figure is None:
            self._open(pixels)
        if not self._is_open:
            return
        self._image.set_data(pixels)
        canvas = self._figure.canvas
        canvas.draw()
        if type(canvas).required_interactive_framework is not None:
            canvas.start_event_loop(self._pause)  # lets the window react meanwhile

    def close(self) -> None:
        if self._figure is not None:
            _pyplot().close(self._figure)

    @property
    def _is_open(self) -> bool:
        return bool(_pyplot().fignum_exists(self._figure.number))

    def _open(self, pixels: Frame) -> None:
        height, width, _ = pixels.shape
        self._figure = _pyplot().figure(num=None, figsize=(width / 100, height / 100), dpi=100)
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.axis("off")
        self._image = axes.imshow(pixels)
        manager = self._figure.canvas.manager
        manager.set_window_title(self._title)
        with contextlib.suppress(importlib.import_module("matplotlib.backend_bases").NonGuiException):
            manager.show()


def _pyplot() -> Any:
    return importlib.import_module("matplotlib.pyplot")
