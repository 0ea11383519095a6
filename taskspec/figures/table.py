"""Any state as a scene: a line for each component. What is shown of tasks that have no figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskspec.figures.scene import Box, Item, Label, Scene, fitted
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.task.task import Component, Task

_SHOWN = 6
WIDTH = 9.0


def table(task: Task, state: Mapping[str, Any]) -> Scene:
    """Names and values of the components."""
    notation = of_task(task)
    items: list[Item] = [Box((0.0, 0.0), WIDTH, 0.1, None, None)]  # room, so that the frames of an episode are alike
    for i, c in enumerate(task.state):
        text = m.Row((notation.symbol(c.name), m.Sym("="), m.Words(_words(c, state[c.name]))))
        items.append(Label((0.0, 0.55 * i), text, anchor="start"))
    return fitted(items, f"A state of {task.name}", margin=0.3)


def _words(c: Component, value: Any) -> str:
    if c.domain is not None and not isinstance(value, str) and np.ndim(value) == 0:
        return c.domain.labels[int(value)]
    flat = np.asarray(value).reshape(-1).tolist()
    shown = ", ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in flat[:_SHOWN])
    return f"({shown}{', …' if len(flat) > _SHOWN else ''})" if c.type.shape else shown
