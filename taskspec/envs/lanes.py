"""One of many environments, as those who ask a vector environment for its parts want to see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import gymnasium

from taskspec.backends.vector import Engine
from taskspec.envs import state, window
from taskspec.envs import window as keyboard
from taskspec.envs.options import LaneError, NotRunningError, one_of
from taskspec.envs.state import plain_state
from taskspec.task.parameters import RenderMode
from taskspec.task.spaces import space
from taskspec.task.task import Task

RENDER_MODES: tuple[RenderMode, ...] = ("ansi", "rgb_array")
"""What lanes render: a window would be one too many for each."""


@dataclass(frozen=True)
class LaneView:
    """A lane: what it is, and how it stands. It is read only; lanes are arrays, and are stepped together."""

    task: Task
    engine: Engine
    number: int
    render_mode: str | None
    started: bool
    drawing: window.Frames

    @property
    def state(self) -> dict[str, Any]:
        """The present state by component: labels for choices, numbers, arrays for vectors."""
        if not self.started:
            raise NotRunningError("E707: there is no state before the first reset()")
        values = [s[..., self.number] for s in self.engine.buffers.state]
        return plain_state(self.task, tuple(v.ravel().tolist() if v.ndim else v.item() for v in values))

    @property
    def time(self) -> int:
        """Steps taken in the present episode."""
        return int(self.engine.buffers.time[self.number])

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        return space(self.engine.observation)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        return space(self.engine.action)

    def render(self) -> Any:
        """Return the present state as text or as pixels, as the render mode says; None without one."""
        match self.render_mode:
            case "ansi":
                return state.text(self.task, self.state, self.time)
            case "rgb_array":
                episode = int(self.engine.buffers.episodes[self.number])
                return self.drawing.draw(self.task, self.state, self.time, episode=episode)
        return None

    def get_keys_to_action(self) -> dict[tuple[int, ...], Any]:
        return keyboard.keys_to_action(self.task)


KNOWN = ("task", "state", "time", "observation_space", "action_space", "render_mode", "render", "get_keys_to_action")


def asked(lane: LaneView, name: str, *args: Any, **options: Any) -> Any:
    """Return an attribute of a lane, or what a method of it gives.

    Raises:
        LaneError: lanes have nothing of that name.
    """
    if name not in KNOWN:
        raise LaneError(f"E713: a lane has no {name!r}; it has {', '.join(KNOWN)}")
    found = getattr(lane, name)
    return found(*args, **options) if callable(found) else found


def unset(name: str) -> NoReturn:
    """Refuse to set an attribute: lanes share one task, and have none of their own.

    Raises:
        LaneError: always.
    """
    raise LaneError(
        f"E713: {name!r} cannot be set: all lanes are one task; make another environment with other options"
    )


def rendered(mode: RenderMode | None) -> RenderMode | None:
    """Return a render mode of lanes.

    Raises:
        SpecError: E713 for another one; E705 without the packages that pixels need.
    """
    if mode is not None:
        one_of("render_mode", mode, RENDER_MODES)
    if mode == "rgb_array":
        window.require()
    return mode
