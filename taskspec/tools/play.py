"""Tasks played with the keyboard, in Gymnasium's window."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium

from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import install_package, need
from taskspec.envs.window import ARROWS, keys_to_action, names
from taskspec.language.task.task import Task

Step = Callable[[Any, Any, Any, float, bool, bool, dict[str, Any]], None]
"""Called after every step: observation before, observation after, action, reward, terminated, truncated, info."""


def legend(task: Task) -> list[tuple[str, str]]:
    """Keys and what they do, in words."""
    shown = {code: name for name, code in ARROWS.items()}
    pairs = []
    for (code,), name in zip(keys_to_action(task), names(task), strict=True):
        pairs.append((shown.get(code) or chr(code), name))
    return pairs


class Warned(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment with legal actions that tells, in words, when an illegal one is taken."""

    def __init__(self, env: Any, say: Callable[[str], None]) -> None:
        super().__init__(env)
        self._say = say
        self._names = names(env.task)
        self._first = env.task.action_layout.starts[0]

    def step(self, action: Any) -> Any:
        inside: Any = self.unwrapped
        number = action - self._first
        if not inside.action_masks()[number]:
            self._say(f"{self._names[number]} is illegal here")
        return self.env.step(action)


def play(env: gymnasium.Env[Any, Any], callback: Step | None = None, fps: int | None = None) -> None:
    """Open Gymnasium's window, and step the environment (`render_mode="rgb_array"`) as keys are pressed, until it is closed.

    Raises:
        SpecError: E705 without pygame, or before Gymnasium 1.0; E717 where there is no display.
    """
    pygame = need("pygame", "play")
    problem = ""
    try:
        pygame.display.init()
        if pygame.display.get_driver() == "offscreen" and "SDL_VIDEODRIVER" not in os.environ:
            problem = "SDL found none"
    except pygame.error as error:
        problem = str(error)
    if problem:
        message = f"there is no display to play on ({problem})"
        raise spec_error("E717", message, "`taskspec run --render gif` makes a film")
    if int(gymnasium.__version__.split(".")[0]) < 1:  # its window goes on without keys, with the first action
        message = f"play needs Gymnasium 1.0 or later; this is {gymnasium.__version__}"
        raise spec_error("E705", message, install_package("gymnasium>=1.0"))
    with warnings.catch_warnings():  # it says that matplotlib is missing where that is only without windows of its own
        warnings.simplefilter("ignore", UserWarning)
        window = need("gymnasium.utils.play", "play")
    window.play(env, callback=callback, fps=fps, wait_on_player=True)
