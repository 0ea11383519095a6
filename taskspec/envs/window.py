"""Frames of an environment, the window that shows them, and the keys for its actions."""

from __future__ import annotations

import importlib
import itertools
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.display import number, visible
from taskspec.base.extras import need
from taskspec.envs.options import invalid
from taskspec.language.expressions.types import Kind
from taskspec.language.task.parts import Component
from taskspec.language.task.spaces import unpack
from taskspec.language.task.task import Task

FRAME = "taskspec.show.figures"
"""The package whose `render_frame` draws frames; it lies above environments, and is imported when a frame is drawn."""
LETTERS = 42
LINES = 2
"""Of a line of a note, and as many lines as there is room for, in every frame."""
KEPT = 200
"""Steps of an episode that are kept, to be drawn over time: `figures.states.STEPS`."""
Frame = np.ndarray[Any, np.dtype[np.uint8]]


def require() -> None:
    """Import what pictures need, so that a missing package is missed at once.

    Raises:
        SpecError: E705, with what to install.
    """
    need("matplotlib", "figures")


def has_display() -> bool:
    """Return whether matplotlib found a display for windows.

    Raises:
        SpecError: E705 without matplotlib.
    """
    return bool(need("matplotlib", "figures").get_backend().lower() != "agg")


def labels(c: Component, value: Any) -> Any:
    """Return a component's value for people: labels for choices, bools for conditions."""
    if c.domain is not None and c.type.is_scalar:
        return c.domain.labels[int(value)]
    if c.type.kind is Kind.BOOL and c.type.is_scalar:
        return bool(value)
    return value


def text(task: Task, state: dict[str, Any], time: int) -> str:
    """Return one line a component, and the time."""
    width = max(map(len, state))
    lines = [heading(task, time)]
    for name, value in state.items():
        shown = visible(str(value), keep="")
        if isinstance(value, np.ndarray):
            shown = array_text(value)
        elif isinstance(value, float):
            shown = f"{value:.6g}"
        lines.append(f"  {name:<{width}} = {shown}")
    return "\n".join(lines)


def array_text(value: Array) -> str:
    """Return an array in four digits, the middle of a long one left out."""
    return np.array2string(value, precision=4, suppress_small=True, threshold=32)


def heading(task: Task, time: int) -> str:
    title = f"{task.name}, step {time}"
    if task.horizon is None:
        return title
    return f"{title} of {task.horizon}"


class Frames:
    """Draws the states of episodes one after the other, and keeps those that it drew of the present one: `KEPT` steps back."""

    def __init__(self) -> None:
        self._seen: dict[int, dict[str, Any]] = {}
        self._episode = 0

    def draw(self, task: Task, state: dict[str, Any], time: int, note: str | None = None, *, episode: int = 0) -> Frame:
        """Return the present state; another number, or an earlier time than before, begins another episode."""
        if episode != self._episode:
            self._seen = {}
            self._episode = episode
        kept = {t: s for t, s in self._seen.items() if time - KEPT <= t < time}
        self._seen = kept | {time: state}
        return frame(task, state, time, note, self._seen)


def frame(
    task: Task, state: dict[str, Any], time: int, note: str | None = None,
    seen: Mapping[int, dict[str, Any]] | None = None,
) -> Frame:  # fmt: skip
    """Return a state as pixels: (height, width, 3), uint8; a note stands above it, cut to what has room.

    `seen` are the states of the episode by time, the present one included.
    """
    title = heading(task, time)
    if note is not None:
        import textwrap

        note = re.sub(r"(?<![\w-])-(?=[\d.]|inf)|(?<=\de)-(?=\d)", "−", note)
        note = re.sub(r"(?<=\w) (?==)|(?<=[\w=]) (?=[−\d]|inf)|(?<==) ", "\u00a0", note)
        lines = textwrap.wrap(note, LETTERS, max_lines=LINES, placeholder="…")
        title = "\n".join([title, *lines, *[""] * (LINES - len(lines))])
    return importlib.import_module(FRAME).render_frame(task, state, title, seen=seen or {time: state})


class Window:
    """A matplotlib window that shows one picture after the other; on a backend without windows nothing is seen.

    Args:
        title: of the window.
        fps: pictures per second; `show` takes as long as one of them lasts.
    """

    def __init__(self, title: str, fps: float) -> None:
        self._title = title
        self._pause = 1.0 / fps
        self._figure: Any = None
        self._image: Any = None

    def show(self, pixels: Frame) -> None:
        """Replace the picture. A window that its user has closed stays closed."""
        if self._figure is None:
            self._open(pixels)
        if not _pyplot().fignum_exists(self._figure.number):
            return
        self._image.set_data(pixels)
        canvas = self._figure.canvas
        canvas.draw()
        if type(canvas).required_interactive_framework is not None:
            canvas.start_event_loop(self._pause)  # lets the window react meanwhile

    def close(self) -> None:
        if self._figure is not None:
            _pyplot().close(self._figure)

    def _open(self, pixels: Frame) -> None:
        height, width, _ = pixels.shape
        self._figure = _pyplot().figure(num=None, figsize=(width / 100, height / 100), dpi=100)
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.axis("off")
        self._image = axes.imshow(pixels)
        manager = self._figure.canvas.manager
        manager.set_window_title(self._title)
        with suppress(importlib.import_module("matplotlib.backend_bases").NonGuiException):
            manager.show()


def _pyplot() -> Any:
    return importlib.import_module("matplotlib.pyplot")


# -- keys for actions ------------------------------------------------------------------------------------
#
# Needs finitely many actions, and no more of them than there are digits and letters.

KEYS = "0123456789abcdefghijklmnopqrstuvwxyz"
ARROWS = {"right": 1073741903, "left": 1073741904, "down": 1073741905, "up": 1073741906}
"""Arrow keys, by the numbers that SDL gives them."""
_DIRECTIONS = ARROWS | dict(zip(("east", "west", "south", "north"), ARROWS.values(), strict=True))

LEVELS = (5, 3, 2)
"""Into how many values a real number of an action is cut to be played; the first that leaves enough keys."""


def actions(task: Task) -> list[Any]:
    """Return all actions, in order, the last component changing fastest; of continuous ones a few between their bounds.

    Raises:
        SpecError: E713, where they have no bounds, or are more than there are keys.
    """
    layout = task.action_layout
    if layout.form == "box":
        return _spread(task)
    if math.prod(layout.counts) > len(KEYS):
        raise _unplayable(task)
    ranges = [range(start, start + n) for start, n in zip(layout.starts, layout.counts, strict=True)]
    if layout.form == "discrete":
        return list(ranges[0])
    return [np.array(each, np.int64) for each in itertools.product(*map(range, layout.counts))]


def _spread(task: Task) -> list[Any]:
    """Return actions at equal distances from bound to bound: as many values of each number as there are keys for."""
    layout = task.action_layout
    low = np.ravel(layout.low)
    high = np.ravel(layout.high)
    fitting = [n for n in LEVELS if n ** len(low) <= len(KEYS)]
    if not fitting or not np.isfinite([low, high]).all():
        raise _unplayable(task)
    values = np.linspace(low, high, fitting[0], axis=-1, dtype=np.float32)
    return [np.reshape(each, layout.shape) for each in itertools.product(*values)]


def _unplayable(task: Task) -> SpecError:
    return invalid(f"{task.id} cannot be played with the keyboard: it has more actions than {len(KEYS)} keys")


def keys_to_action(task: Task) -> dict[tuple[int, ...], Any]:
    """Keys, by the numbers of their characters, to actions: arrows for directions, else digits and letters in order."""
    known = actions(task)
    arrows = [_DIRECTIONS.get(name.lower()) for name in names(task)]
    taken = [code for code in arrows if code is not None]
    if len(taken) != len(set(taken)):
        arrows = [None] * len(known)
    return {(code or ord(key),): action for code, key, action in zip(arrows, KEYS, known, strict=False)}


def names(task: Task) -> list[str]:
    """Return the actions in words, in the order of `actions`."""
    described = []
    for action in actions(task):
        words = []
        for c, value in zip(task.action, unpack(task.action_layout, action), strict=True):
            label = labels(c, np.ravel(value)[0] if c.type.is_scalar else value)
            words.append(number(label, 3) if isinstance(label, float) else str(label))
        described.append(", ".join(words))
    return described
