"""Tasks played by a person: which key does what, and Gymnasium's window for it.

Needs finitely many actions, and no more of them than there are digits and letters.
"""

from __future__ import annotations

import itertools
import math
import string
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.envs.options import invalid
from taskspec.envs.spaces import labels
from taskspec.extras import install_package, need
from taskspec.task.spaces import action_layout, unpack
from taskspec.task.task import Task

KEYS = string.digits + string.ascii_lowercase
_ARROWS = {"right": 1073741903, "left": 1073741904, "down": 1073741905, "up": 1073741906}
"""Arrow keys, by the numbers that SDL gives them."""
_DIRECTIONS = _ARROWS | dict(zip(("east", "west", "south", "north"), _ARROWS.values(), strict=True))

Step = Callable[[Any, Any, Any, float, bool, bool, dict[str, Any]], None]
"""Called after every step: observation before, observation after, action, reward, terminated, truncated, info."""


def actions(task: Task) -> list[Any]:
    """All actions, in order, the last component changing fastest.

    Raises:
        SpecError: E713, where they are infinite, or more than there are keys.
    """
    layout = action_layout(task)
    if layout.form == "box" or math.prod(layout.counts) > len(KEYS):
        message = f"{task.id} cannot be played with the keyboard: it has more actions than {len(KEYS)} keys"
        raise invalid(message)
    ranges = [range(start, start + n) for start, n in zip(layout.starts, layout.counts, strict=True)]
    if layout.form == "discrete":
        return list(ranges[0])
    return [np.array(each, np.int64) for each in itertools.product(*(range(len(r)) for r in ranges))]


def keys_to_action(task: Task) -> dict[tuple[int, ...], Any]:
    """Keys, by the numbers of their characters, to actions: arrows for directions, else digits and letters in order."""
    known = actions(task)
    arrows = [_DIRECTIONS.get(name.lower()) for name in names(task)]
    taken = [code for code in arrows if code is not None]
    if len(taken) != len(set(taken)):
        arrows = [None] * len(known)
    return {(code or ord(key),): action for code, key, action in zip(arrows, KEYS, known, strict=False)}


def names(task: Task) -> list[str]:
    """The actions in words, in the order of `actions`."""
    layout = action_layout(task)

    def name(action: Any) -> str:
        values = unpack(layout, action)
        return ", ".join(
            str(labels(c, np.ravel(v)[0] if c.type.is_scalar else v)) for c, v in zip(task.action, values, strict=True)
        )

    return [name(action) for action in actions(task)]


def legend(task: Task) -> list[tuple[str, str]]:
    """Keys and what they do, in words."""
    shown = {code: name for name, code in _ARROWS.items()}
    keys = [shown.get(code) or chr(code) for (code,) in keys_to_action(task)]
    return list(zip(keys, names(task), strict=True))


def play(env: gymnasium.Env[Any, Any], callback: Step | None = None, fps: int | None = None) -> None:
    """Open Gymnasium's window, and step the environment (`render_mode="rgb_array"`) as keys are pressed, until it is closed.

    Raises:
        SpecError: E705 without pygame, or before Gymnasium 1.0; E717 where there is no display.
    """
    pygame = need("pygame", "play")
    try:
        pygame.display.init()
    except pygame.error as error:
        message = f"there is no display to play on ({error})"
        raise SpecError([Diagnostic("E717", None, message, "`taskspec run --render gif` makes a film")]) from None
    _needs_patience()
    with warnings.catch_warnings():  # it says that matplotlib is missing where that is only without windows of its own
        warnings.simplefilter("ignore", UserWarning)
        window = need("gymnasium.utils.play", "play")
    window.play(env, callback=callback, fps=fps, wait_on_player=True)


def _needs_patience() -> None:
    """Refuse a Gymnasium whose window goes on without keys, with the first action."""
    if int(gymnasium.__version__.split(".")[0]) < 1:
        message = f"play needs Gymnasium 1.0 or later; this is {gymnasium.__version__}"
        raise SpecError([Diagnostic("E705", None, message, install_package("gymnasium>=1.0"))])
