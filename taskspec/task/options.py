"""Options of environments that a task's own methods take as well."""

from __future__ import annotations

from typing import Literal, TypeAlias

Ending: TypeAlias = Literal["terminate", "absorb"]
"""What becomes of terminal states: the episode ends, or they absorb until the horizon."""
RenderMode: TypeAlias = Literal["ansi", "rgb_array", "rgb_array_list", "human"]
"""What `render` gives: text, pixels, the pixels of all states since the last call, or a window."""
