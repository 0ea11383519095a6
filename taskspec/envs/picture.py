"""States as text: what `render_mode="ansi"` shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.task.task import Task
from taskspec.visible import visible


def text(task: Task, state: dict[str, Any], time: int) -> str:
    """One line a component, and the time."""
    width = max(len(name) for name in state)
    return "\n".join([heading(task, time), *(f"  {name:<{width}} = {_shown(value)}" for name, value in state.items())])


def heading(task: Task, time: int) -> str:
    """The task and the time."""
    return f"{task.name}, step {time}" + ("" if task.horizon is None else f" of {task.horizon}")


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return np.array2string(value, precision=4, suppress_small=True, threshold=32)
    return f"{value:.6g}" if isinstance(value, float) else visible(str(value), keep="")
