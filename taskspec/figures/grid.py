"""A grid world as a scene: cells, walls or letters of a map, marked cells, and the agent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.exact.model.transitions import Steps
from taskspec.figures.overlay import Overlay
from taskspec.figures.scene import Box, Circle, Item, Label, Line, Role, Scene, fitted, scaled
from taskspec.figures.values import Reads, all_states, at_states, first_state, reads_of
from taskspec.figures.ways import Cell, Way, chosen_ways
from taskspec.lang.ir import Node
from taskspec.printers import tree as m
from taskspec.task.task import Task

CELL = 0.8
LARGEST = 24
_COLORS: dict[str, Role] = {"good": "good", "bad": "bad", "end": "end"}


def grid(task: Task, overlay: Overlay) -> Scene | None:
    """The grid that a task's figure section places its states on."""
    place = _place(task)
    if place is None:
        return None
    world = all_states(task)
    return _whole(task, place, *world, overlay) if world is not None else _window(task, place, overlay)


def _place(task: Task) -> tuple[Node, ...] | None:
    """Column and row of a state: two expressions, or one vector of two."""
    return None if task.figure is None or not task.figure.at else task.figure.at


def _cells(task: Task, place: tuple[Node, ...], reads: Reads, count: int) -> np.ndarray[Any, Any]:
    """Column and row (count, 2) of states."""
    found = [at_states(task, node, reads, count) for node in place]
    return np.asarray(found[0] if len(found) == 1 else np.stack(found, axis=1)).astype(int)


def _marks(task: Task, reads: Reads, count: int) -> Iterator[tuple[Role, np.ndarray[Any, Any]]]:
    """Conditions (count,) or places (count, 2) to highlight, with their colours."""
    highlight = {} if task.figure is None else task.figure.highlight
    for name, node in highlight.items():
        if name in _COLORS:
            yield _COLORS[name], at_states(task, node, reads, count)


@dataclass
class _Board:
    """Cells from (0, 0), to be drawn."""

    columns: int
    rows: int
    colors: dict[Cell, Role]
    letters: Mapping[Cell, str]
    agents: dict[Cell, float]
    shades: dict[Cell, float]
    values: dict[Cell, float]
    moves: list[tuple[Cell, Way]] = field(default_factory=list)
    open: bool = False  # the world goes on beyond the frame

    def items(self) -> Iterator[Item]:
        for y in range(self.rows):
            for x in range(self.columns):
                fill = self.colors.get((x, y), "paper")
                shade = 1.0
                if (x, y) in self.shades and fill == "paper":
                    fill, shade = "accent", self.shades[x, y]
                yield Box((x * CELL, y * CELL), CELL, CELL, fill, "faint", shade=shade)
        if not self.open:
            yield Box((0, 0), self.columns * CELL, self.rows * CELL, None, "ink")
        for (x, y), text in self.letters.items():
            yield Label(((x + 0.5) * CELL, (y + 0.5) * CELL), m.Words(text), 0.3, color="muted")
        yield from (_move(cell, way) for cell, way in self.moves)
        for (x, y), value in self.values.items():
            yield Label(((x + 0.5) * CELL, (y + 0.5) * CELL), m.Num(f"{value:.3g}".replace("-", "−")), 0.24)
        for (x, y), weight in self.agents.items():
            yield from _agent((x + 0.5) * CELL, (y + 0.5) * CELL, weight)


def _move(cell: Cell, way: Way) -> Line:
    """An arrow from near the middle of a cell to its edge."""
    near, far = ((CELL * (cell[0] + 0.5 + r * way[0]), CELL * (cell[1] + 0.5 + r * way[1])) for r in (0.2, 0.48))
    return Line((near, far), arrow=True, color="muted")


def _agent(x: float, y: float, weight: float) -> Iterator[Item]:
    """The agent; where it may start among several cells, faint."""
    shade = 1.0 if weight > 0.99 else 0.35
    yield Circle((x, y), CELL * 0.27, "ink", None, shade)
    for side in (-1, 1):
        yield Circle((x + side * CELL * 0.09, y - CELL * 0.05), CELL * 0.045, "paper", None)


def _whole(task: Task, place: tuple[Node, ...], reads: Reads, count: int, overlay: Overlay) -> Scene | None:
    cells = _cells(task, place, reads, count)
    columns, rows = (int(v) + 1 for v in cells.max(axis=0))
    if max(columns, rows) > LARGEST or cells.min() < 0:
        return None
    colors: dict[Cell, Role] = {}
    for role, found in _marks(task, reads, count):
        points = cells[found.astype(bool)] if found.ndim == 1 else found.astype(int)[:1]
        colors |= {(int(x), int(y)): role for x, y in points}
    by_code = {code: (int(x), int(y)) for code, (x, y) in enumerate(cells)}
    agents = _agents(task, place, by_code, overlay)
    shades, values = ({by_code[c]: v for c, v in by.items()} for by in (overlay.occupancy, overlay.values))
    moves = list(chosen_ways(task, overlay.policy, by_code))
    letters = {} if values else _letters(task, columns, rows)  # a cell has room for one of them
    board = _Board(columns, rows, colors, letters, {} if values else agents, shades, values, moves)
    return fitted(board.items(), f"Grid of {task.name}: {columns} columns and {rows} rows")


def _agents(task: Task, place: tuple[Node, ...], by_code: Mapping[int, Cell], overlay: Overlay) -> dict[Cell, float]:
    if overlay.here is not None:
        ((x, y),) = _cells(task, place, reads_of(task, overlay.here), 1)
        return {(int(x), int(y)): 1.0}
    codes, weights = Steps(task).starts()
    found: dict[Cell, float] = {}
    for code, p in zip(codes.tolist(), weights.tolist(), strict=True):
        found[by_code[code]] = found.get(by_code[code], 0.0) + p
    return found


def _letters(task: Task, columns: int, rows: int) -> dict[Cell, str]:
    """The characters of the map that `figure: map:` names, where it has a character for every cell."""
    lines = () if task.figure is None else task.figure.map
    if len(lines) != rows or len(lines[0]) != columns:
        return {}
    return {(x, y): char for y, line in enumerate(lines) for x, char in enumerate(line) if char != " "}


def _window(task: Task, place: tuple[Node, ...], overlay: Overlay) -> Scene | None:
    """The part of a vast grid around one first state."""
    state = overlay.here or first_state(task)
    reads = reads_of(task, state)
    ((ax, ay),) = _cells(task, place, reads, 1)
    marks = [(role, found[0].astype(int)) for role, found in _marks(task, reads, 1) if found.shape == (1, 2)]
    points = np.array([(ax, ay), *(p for _, p in marks)])
    middle = np.round(points.mean(axis=0)).astype(int)
    half = (
        LARGEST // 2 if overlay.here is not None else min(LARGEST // 2, max(4, int(np.abs(points - middle).max()) + 1))
    )
    corner = middle - half
    colors: dict[Cell, Role] = {(int(p[0] - corner[0]), int(p[1] - corner[1])): role for role, p in marks}
    agents = {(int(ax - corner[0]), int(ay - corner[1])): 1.0}
    board = _Board(2 * half + 1, 2 * half + 1, colors, {}, agents, {}, {}, open=True)
    return fitted(
        scaled(board.items(), 0.55), f"Part of the grid of {task.name} around the agent", ("One start of many.",)
    )
