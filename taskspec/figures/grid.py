"""A grid world as a scene: cells, walls or letters of a map, marked cells, and the agent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from taskspec.exact.model.transitions import Steps
from taskspec.figures.board import LARGEST, Board
from taskspec.figures.overlay import Overlay
from taskspec.figures.scene import Role, Scene, fitted, shifted
from taskspec.figures.seen import is_noisy, seen
from taskspec.figures.values import Reads, all_states, at_states, first_state, reads_of
from taskspec.figures.ways import Cell, chosen_ways
from taskspec.lang.ir import Node, Read, reads
from taskspec.task.task import Task

FARTHEST = 5_000
"""Columns or rows of a world that is drawn whole, and how far off what is marked of another may be."""
NOWHERE = 2**53
"""Places beyond it, or that are no number, are taken for this one."""
SMALL = 0.44
"""The side of a cell, in centimetres, where a part of a vast grid is drawn."""
_COLORS: dict[str, Role] = {"good": "good", "bad": "bad", "end": "end"}


def grid(task: Task, overlay: Overlay) -> Scene | None:
    """The grid that a task's figure section places its states on."""
    place = _place(task)
    if place is None:
        return None
    world = all_states(task)
    drawn = _whole(task, place, *world, overlay) if world is not None else _window(task, place, overlay)
    return _with_seen(task, drawn) if drawn is not None and overlay.here is None and is_noisy(task) else drawn


def _with_seen(task: Task, drawn: Scene) -> Scene:
    """The grid, and below it what the agent sees of a first state."""
    strip = fitted(seen(task), "", margin=0.0)
    left = max(0.0, (strip.width - drawn.width) / 2)
    items = [shifted(item, left, 0.0) for item in drawn.items]
    items += [shifted(item, left + (drawn.width - strip.width) / 2, drawn.height + 0.1) for item in strip.items]
    notes = (*drawn.notes, "Below the grid: what the agent sees at the start of an episode.")
    return fitted(items, f"{drawn.alt}, and an observation", notes, state=drawn.state)


def _place(task: Task) -> tuple[Node, ...] | None:
    """Column and row of a state: two expressions, or one vector of two."""
    return None if task.figure is None or not task.figure.at else task.figure.at


def _cells(task: Task, place: tuple[Node, ...], reads: Reads, count: int) -> np.ndarray[Any, Any]:
    """Column and row (count, 2) of states."""
    found = [at_states(task, node, reads, count) for node in place]
    return _whole_numbers(found[0] if len(found) == 1 else np.stack(found, axis=1))


def _whole_numbers(places: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    found: np.ndarray[Any, Any] = np.clip(np.nan_to_num(places, nan=NOWHERE), -NOWHERE, NOWHERE).astype(int)
    return found


def _marks(task: Task, reads: Reads, count: int) -> Iterator[tuple[Role, np.ndarray[Any, Any]]]:
    """Conditions (count,) or places (count, 2) to highlight, with their colours."""
    highlight = {} if task.figure is None else task.figure.highlight
    for name, node in highlight.items():
        if name in _COLORS:
            yield _COLORS[name], at_states(task, node, reads, count)


def _whole(task: Task, place: tuple[Node, ...], reads: Reads, count: int, overlay: Overlay) -> Scene | None:
    cells = _cells(task, place, reads, count)
    if np.ptp(np.vstack([cells, [(0, 0)]]), axis=0).max() >= FARTHEST:
        return None
    columns, rows = (
        range(min(0, int(low)), int(high) + 1) for low, high in zip(cells.min(0), cells.max(0), strict=True)
    )
    colors: dict[Cell, Role] = {}
    for role, found in _marks(task, reads, count):
        points = cells[found.astype(bool)] if found.ndim == 1 else _whole_numbers(found[:1])
        colors |= {(int(x), int(y)): role for x, y in points}
    by_code = {code: (int(x), int(y)) for code, (x, y) in enumerate(cells)}
    agents = _agents(task, place, by_code, overlay)
    shades, values = ({by_code[c]: v for c, v in by.items()} for by in (overlay.occupancy, overlay.values))
    moves = list(chosen_ways(task, overlay.policy, by_code))
    letters = _letters(task, len(columns), len(rows))
    board = Board(columns, rows, colors, letters, agents, shades, values, moves, folds=overlay.here is None)
    return fitted(board.items(), f"Grid of {task.name}: {len(columns)} columns and {len(rows)} rows", board.notes())


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


def _stay(task: Task) -> bool:
    """Whether no step changes what is marked."""
    marks = () if task.figure is None else task.figure.highlight.values()
    after = {c.read: node for c, node in zip(task.state, task.next, strict=True)}
    return all(isinstance(after.get(key), Read) and reads([after[key]]) == {key} for key in reads(marks))


def _window(task: Task, place: tuple[Node, ...], overlay: Overlay) -> Scene:
    """The part of a vast grid around one first state."""
    state = overlay.here or first_state(task)
    reads = reads_of(task, state)
    ((ax, ay),) = _cells(task, place, reads, 1)
    known = [(role, _whole_numbers(found[0])) for role, found in _marks(task, reads, 1) if found.shape == (1, 2)]
    marks = [(role, point) for role, point in known if np.abs(point - (ax, ay)).max() < FARTHEST]
    points = np.array([(ax, ay), *(p for _, p in marks)])
    middle = np.round(points.mean(axis=0)).astype(int)
    half = max(4, int(np.abs(points - middle).max()) + 1)
    if overlay.here is not None:  # a window that stays as the agent moves in it
        half = (LARGEST - 1) // 2
        anchor = marks[0][1] if marks and _stay(task) else np.zeros(2, dtype=int)
        middle = anchor + (np.array([ax, ay]) - anchor + half) // (2 * half + 1) * (2 * half + 1)
    columns, rows = (range(int(v) - half, int(v) + half + 1) for v in middle)
    colors: dict[Cell, Role] = {(int(p[0]), int(p[1])): role for role, p in marks}
    board = Board(columns, rows, colors, {}, {(int(ax), int(ay)): 1.0}, open=True, cell=SMALL)
    alt = f"Part of the grid of {task.name} around the agent"
    far = ("What is marked is too far away to be shown.",) if len(marks) < len(known) else ()
    return fitted(board.items(), alt, ("One start of many.", *far, *board.notes()), state=state)
