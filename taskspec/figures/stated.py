"""What stands in the place of a figure that a spec asks for and that these parameters leave no room for."""

from __future__ import annotations

import textwrap

import numpy as np

from taskspec.exact.model.space import Space
from taskspec.figures.scene import Box, Label, Scene, fitted
from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.printers import tree as m
from taskspec.task.task import Task

WIDTH, LETTERS, LINE = 44, 0.3, 0.5


def stated(task: Task, needed: str) -> Scene:
    """A frame with the size of the task and what a figure of its kind would need."""
    size = f"{_size(task, 'state')} and {_size(task, 'action')}"
    lines = [
        size,
        *textwrap.wrap(
            f"No {'' if task.figure is None else task.figure.kind} is drawn: {needed.replace('`', '')}", WIDTH
        ),
    ]
    words = [
        Label((0.0, LINE * i), m.Words(line), LETTERS, "start", "muted" if i else "ink") for i, line in enumerate(lines)
    ]
    inside = fitted(words, "", margin=0.3)
    frame = Box((0, 0), inside.width, inside.height, None, "faint", round=0.1)
    return fitted([frame, *inside.items], f"{task.name}: {size}, not drawn")


def _size(task: Task, what: str) -> str:
    """How many states or actions there are, or of how many numbers they are."""
    components, role = (task.state, Role.STATE) if what == "state" else (task.action, Role.ACTION)
    if all(c.type.kind is not Kind.REAL for c in components) and (what == "action" or task.is_finite):
        return f"{Space(components, role).size:,} {what}s"
    return f"{what}s of {int(sum(np.prod(c.type.shape, dtype=int) for c in components)):,} numbers"
