"""A vector as a scene: bars for a long one, cells with values for a short one, and swaps from row to row."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from taskspec.figures.overlay import Overlay
from taskspec.figures.scene import Box, Item, Label, Line, Role, Scene, fitted
from taskspec.figures.values import at_states, expert_path, reads_of
from taskspec.lang.ir import Node, Read
from taskspec.printers import tree as m
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]
CELLS_UP_TO, ROWS, SEEDS = 8, 3, 6
_COLORS: dict[str, Role] = {"first": "accent", "second": "second", "good": "good", "bad": "bad"}


def bars(task: Task, overlay: Overlay) -> Scene | None:
    """The vector that the figure section names (or the only vector of the state)."""
    node = _vector(task)
    if node is None:
        return None
    if overlay.here is not None:
        rows = _rows(task, node, [dict(overlay.here)])
    else:  # the episode, of a few, in which most happens
        rows = max((_rows(task, node, expert_path(task, ROWS, seed)) for seed in range(SEEDS)), key=len)
    colors = _colors(task, node, len(rows[0]))
    if len(rows[0]) <= CELLS_UP_TO:
        alt = f"A state of {task.name} as {len(rows[0])} cells" + (
            ", and the swaps that sort it" if len(rows) > 1 else ""
        )
        return fitted(_cells(rows, colors), alt)
    return fitted(_bars(rows[0], colors), f"A state of {task.name} as {len(rows[0])} bars")


def _rows(task: Task, node: Node, path: list[dict[str, Any]]) -> list[Array]:
    """The vector along a path, each time that it changes."""
    rows = [at_states(task, node, reads_of(task, state), 1)[0].astype(float) for state in path]
    return [row for i, row in enumerate(rows) if i == 0 or not np.array_equal(row, rows[i - 1])]


def _vector(task: Task) -> Node | None:
    """The vector that the figure names, else the first component of the state that is one."""
    if task.figure is not None and task.figure.values is not None:
        node = task.figure.values
        return node if len(node.type.shape) == 1 else None
    b = task.builder
    vectors = (b.read(*c.read, c.type, min(c.low), max(c.high)) for c in task.state if len(c.type.shape) == 1)
    return next(vectors, None)


def _colors(task: Task, node: Node, count: int) -> list[Role]:
    """Parts of the vector by colour: a slice of it, taken of its indices, says which elements are meant."""
    colors: list[Role] = ["accent"] * count
    highlight = {} if task.figure is None else task.figure.highlight
    for name, part in highlight.items():
        if name not in _COLORS or not isinstance(node, Read) or len(part.type.shape) != 1:
            continue
        indices = {(node.role, node.name): np.arange(count, dtype=float)[:, None]}
        for i in at_states(task, part, indices, 1)[0].astype(int):
            colors[i] = _COLORS[name]
    return colors


def _bars(values: Array, colors: list[Role]) -> Iterator[Item]:
    """Bars of equal width above a line."""
    step = min(0.3, 7.0 / len(values))
    scale = 2.0 / (float(np.abs(values).max()) or 1.0)
    for i, (value, color) in enumerate(zip(values.tolist(), colors, strict=True)):
        top = -scale * max(value, 0.0)
        yield Box((i * step, top), step * 0.8, max(0.01, scale * abs(value)), color, None)
    yield Line(((-0.1, 0.0), (len(values) * step + 0.02, 0.0)), color="muted")


def _cells(rows: list[Array], colors: list[Role]) -> Iterator[Item]:
    """Rows of cells, shaded by value, with arrows for elements that moved."""
    low, high = float(rows[0].min()), float(rows[0].max())
    digits = 0 if all(np.array_equal(row, np.rint(row)) for row in rows) else 2
    for r, row in enumerate(rows):
        for i, value in enumerate(row.tolist()):
            shade = 0.2 + 0.7 * (value - low) / ((high - low) or 1.0)
            yield Box((i * 1.0, r * 1.5), 1.0, 0.8, colors[i], "paper", shade=shade)
            yield Label((i + 0.5, r * 1.5 + 0.4), m.Num(f"{value:.{digits}f}".replace("-", "−")), 0.28)
        if r + 1 < len(rows):
            for i, value in enumerate(row.tolist()):
                j = _where(rows[r + 1], value)
                if j is not None and j != i:
                    yield Line(((i + 0.5, r * 1.5 + 0.84), (j + 0.5, r * 1.5 + 1.46)), arrow=True)


def _where(row: Array, value: float) -> int | None:
    found = np.flatnonzero(row == value)
    return int(found[0]) if len(found) else None
