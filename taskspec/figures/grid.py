"""A grid world as a scene: cells, walls or letters of a map, marked cells, and the agent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from operator import add
from typing import Any

import numpy as np

from taskspec.figures.board import CELL, LARGEST, ROOMY, WIDEST, Board, Cell, Thing, chosen_ways
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Color, Scene, fitted, shifted
from taskspec.figures.values import Reads, all_states, at_states, first_state, is_noisy, reads_of, seen
from taskspec.lang.ir import Node, Read, reads
from taskspec.lang.ir import Role as Reading
from taskspec.model.space import Space
from taskspec.model.transitions import Steps
from taskspec.task.task import Task

FARTHEST = 5_000
"""Columns or rows of a world that is drawn whole, and how far off what is marked of another may be."""
NOWHERE = 2**53
"""Places beyond it, or that are no number, are taken for this one."""
SMALL = 0.44
"""The side of a cell, in centimetres, where a part of a vast grid is drawn."""
DRAWN = {"values": "numbers", "policy": "arrows", "occupancy": "shade, {0}"}
DRAWN_TOGETHER = {
    "values": "numbers, of the best state in a cell",
    "policy": "arrows, where all states in a cell agree",
    "occupancy": "shade, relative to the most visited cell",
}
"""How results are drawn: with a state in each cell, and with several."""
_COLORS: dict[str, Color] = {"good": "good", "bad": "bad", "end": "end"}


def grid(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the grid on which a task's figure section places its states."""
    place = _place(task)
    if place is None:
        return None
    world = all_states(task)
    drawn = _whole(task, place, *world, overlay) if world is not None else _window(task, place, overlay)
    return _with_seen(task, drawn) if drawn is not None and overlay.here is None and is_noisy(task) else drawn


def _with_seen(task: Task, drawn: Scene) -> Scene:
    """Return the grid, and below it what the agent sees of a first state."""
    strip = fitted(seen(task), "", margin=0.0)
    left = max(0.0, (strip.width - drawn.width) / 2)
    items = [shifted(item, left, 0.0) for item in drawn.items]
    items += [shifted(item, left + (drawn.width - strip.width) / 2, drawn.height + 0.1) for item in strip.items]
    notes = (*drawn.notes, "Below the grid: what the agent sees at the start of an episode.")
    return fitted(items, f"{drawn.alt}, and an observation", notes, state=drawn.state, drawn=drawn.drawn)


def _place(task: Task) -> tuple[Node, ...] | None:
    """Return column and row of a state: two expressions, or one vector of two."""
    return None if task.figure is None or not task.figure.at else task.figure.at


def _cells(task: Task, place: tuple[Node, ...], reads: Reads, count: int) -> np.ndarray[Any, Any]:
    """Return column and row (count, 2) of states."""
    return _whole_numbers(_numbers(task, place, reads, count)[:, :2])


def _numbers(task: Task, place: tuple[Node, ...], reads: Reads, count: int) -> np.ndarray[Any, Any]:
    """Return column and row of states, and maybe a way, (count, 2) or (count, 4)."""
    found = [at_states(task, node, reads, count) for node in place]
    return found[0] if len(found) == 1 else np.stack(found, axis=1)


def _things(task: Task, place: tuple[Node, ...], reads: Reads) -> tuple[Thing, ...]:
    """Yield the objects of the figure section, and the nose of an agent with a direction, in one state."""
    places = {"": place} | ({} if task.figure is None else dict(task.figure.objects))
    found = []
    for word, at in places.items():
        (numbers,) = _numbers(task, at, reads, 1).astype(float)
        (cell,) = _whole_numbers(numbers[None, :2]).tolist()
        length = float(np.abs(numbers[2:]).max(initial=0.0))
        way = tuple((numbers[2:] / length).tolist()) if 0 < length < math.inf else None
        if word or way is not None:
            found.append(Thing(_letters_of(word, places), (cell[0], cell[1]), way))
    return tuple(found)


def _letters_of(word: str, others: Iterable[str]) -> str:
    """Return as few letters as tell an object from others."""
    count = next((n for n in range(1, len(word)) if sum(x[:n] == word[:n] for x in others) == 1), len(word))
    return word[:1].upper() + word[1:count]


def _key(task: Task) -> tuple[str, ...]:
    """Return a note that explains the letters of objects."""
    words = () if task.figure is None else tuple(task.figure.objects)
    told = [f"{_letters_of(word, words)}: {word}" for word in words if len(word) > 1]
    return (f"{', '.join(told)}.",) if told else ()


def _whole_numbers(places: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    found: np.ndarray[Any, Any] = np.clip(np.nan_to_num(places, nan=NOWHERE), -NOWHERE, NOWHERE).astype(int)
    return found


def _marks(task: Task, reads: Reads, count: int) -> Iterator[tuple[Color, np.ndarray[Any, Any]]]:
    """Yield conditions (count,) or places (count, 2) to highlight, with their colours."""
    highlight = {} if task.figure is None else task.figure.highlight
    for name, node in highlight.items():
        if name in _COLORS:
            yield _COLORS[name], at_states(task, node, reads, count)


def _marked(task: Task, cells: np.ndarray[Any, Any], reads: Reads, one: Reads) -> tuple[dict[Cell, Color], list[str]]:
    """Return the colours of marked cells, those of places in one state, and notes on what is not marked."""
    colors: dict[Cell, Color] = {}
    unplaced: list[str] = []
    for role, found in _marks(task, reads, len(cells)):
        if found.ndim == 1:
            marked = {(int(x), int(y)): role for x, y in cells[found.astype(bool)]}
            if not found.all() and len(marked) == len(np.unique(cells, axis=0)):
                unplaced.append(f"Not marked: {role}, which may hold in every cell.")
            else:
                colors |= marked
    for role, found in _marks(task, one, 1):
        if found.ndim == 2:
            colors |= {(int(x), int(y)): role for x, y in _whole_numbers(found)}
    return colors, unplaced


def _whole(task: Task, place: tuple[Node, ...], reads: Reads, count: int, overlay: Overlay) -> Scene | None:
    cells = _cells(task, place, reads, count)
    if np.ptp(np.vstack([cells, [(0, 0)]]), axis=0).max() >= FARTHEST:
        return None
    columns, rows = (
        range(min(0, int(low)), max(int(high) + 1, size))
        for low, high, size in zip(cells.min(0), cells.max(0), _size(task), strict=True)
    )
    state = overlay.here or first_state(task)
    one = reads_of(task, state)
    colors, unplaced = _marked(task, cells, reads, one)
    by_code = {code: (int(x), int(y)) for code, (x, y) in enumerate(cells)}
    agents = _agents(task, place, by_code, overlay)
    values = _by_cell(by_code, overlay.values, max)
    shades = _by_cell(by_code, overlay.occupancy, add)
    most = max(shades.values(), default=1.0)
    shades = {cell: share / most for cell, share in shades.items()} if most > 1 else shades
    moves = list(chosen_ways(task, overlay.policy, by_code))
    things = _things(task, place, one)
    if things and overlay.here is None:  # which belong to one state
        agents = {by_code[_code(task, one)]: 1.0}
    letters = _letters(task)
    cell = ROOMY if values and moves and len(columns) * ROOMY <= WIDEST else CELL
    board = Board(
        columns, rows, colors, letters, agents, shades, values, moves, things, overlay.here is None, cell=cell
    )
    alt = f"Grid of {task.name}: {len(columns)} columns and {len(rows)} rows"
    notes = (*_key(task), *unplaced, *board.notes())
    first = ("One of many starts.",) if things and len(agents) > 1 and overlay.here is None else ()
    how = DRAWN if len(set(by_code.values())) == len(by_code) else DRAWN_TOGETHER
    return fitted(board.items(), alt, (*first, *notes), state=state if things else None, drawn=how)


def _by_cell(
    by_code: Mapping[int, Cell], found: Mapping[int, float], together: Callable[[float, float], float]
) -> dict[Cell, float]:
    """Return numbers of cells from those of states."""
    cells: dict[Cell, float] = {}
    for code, number in found.items():
        cell = by_code[code]
        cells[cell] = together(cells[cell], number) if cell in cells else number
    return cells


def _code(task: Task, reads: Reads) -> int:
    """Return the code of a state."""
    return int(Space(task.state, Reading.STATE).encode([reads[c.read] for c in task.state], 1)[0][0])


def _agents(task: Task, place: tuple[Node, ...], by_code: Mapping[int, Cell], overlay: Overlay) -> dict[Cell, float]:
    if overlay.here is not None:
        ((x, y),) = _cells(task, place, reads_of(task, overlay.here), 1)
        return {(int(x), int(y)): 1.0}
    codes, weights = Steps(task).starts()
    found: dict[Cell, float] = {}
    for code, p in zip(codes.tolist(), weights.tolist(), strict=True):
        found[by_code[code]] = found.get(by_code[code], 0.0) + p
    return found


def _size(task: Task) -> Cell:
    """Return columns and rows of the map that `figure: map:` names; none without one."""
    lines = () if task.figure is None else task.figure.map
    return (len(lines[0]), len(lines)) if lines else (0, 0)


def _bounds(task: Task, place: tuple[Node, ...]) -> tuple[range, range] | None:
    """Return columns and rows where a map or the bounds of the agent's place say them, and they are few."""
    ends = [(node.low, node.high) for node in place[:2] if isinstance(node, Read)]
    if all(_size(task)):
        ends = [(0, size - 1) for size in _size(task)]
    elif len(place) == 1:
        ends = ends * 2  # one vector of both
    if len(ends) != 2 or not all(-LARGEST < low <= high < LARGEST for low, high in ends):
        return None
    columns, rows = (range(min(0, int(low)), int(high) + 1) for low, high in ends)
    return columns, rows


def _letters(task: Task) -> dict[Cell, str]:
    """Return the characters of the map, but for spaces."""
    lines = () if task.figure is None else task.figure.map
    return {(x, y): char for y, line in enumerate(lines) for x, char in enumerate(line) if char != " "}


def _stay(task: Task) -> bool:
    """Return whether no step changes what is marked."""
    marks = () if task.figure is None else task.figure.highlight.values()
    after = {c.read: node for c, node in zip(task.state, task.next, strict=True)}
    return all(isinstance(after.get(key), Read) and reads([after[key]]) == {key} for key in reads(marks))


def _window(task: Task, place: tuple[Node, ...], overlay: Overlay) -> Scene:
    """Return the part of a vast grid around one first state."""
    state = overlay.here or first_state(task)
    reads = reads_of(task, state)
    ((ax, ay),) = _cells(task, place, reads, 1)
    known = [(role, _whole_numbers(found[0])) for role, found in _marks(task, reads, 1) if found.shape == (1, 2)]
    marks = [(role, point) for role, point in known if np.abs(point - (ax, ay)).max() < FARTHEST]
    things = [x for x in _things(task, place, reads) if np.abs(np.array(x.cell) - (ax, ay)).max() < FARTHEST]
    points = np.array([(ax, ay), *(p for _, p in marks), *(x.cell for x in things)])
    middle = np.round(points.mean(axis=0)).astype(int)
    half = max(4, int(np.abs(points - middle).max()) + 1)
    if overlay.here is not None:  # a window that stays as the agent moves in it
        half = (LARGEST - 1) // 2
        anchor = marks[0][1] if marks and _stay(task) else np.zeros(2, dtype=int)
        middle = anchor + (np.array([ax, ay]) - anchor + half) // (2 * half + 1) * (2 * half + 1)
    colors: dict[Cell, Color] = {(int(p[0]), int(p[1])): role for role, p in marks}
    bounds = _bounds(task, place)
    if bounds is not None:
        board = Board(*bounds, colors, _letters(task), {(int(ax), int(ay)): 1.0}, things=things, folds=False)
        alt = f"Grid of {task.name}: {len(bounds[0])} columns and {len(bounds[1])} rows"
        return fitted(board.items(), alt, ("One of many starts.", *_key(task)), state=state)
    columns, rows = (range(int(v) - half, int(v) + half + 1) for v in middle)
    board = Board(columns, rows, colors, {}, {(int(ax), int(ay)): 1.0}, things=things, open=True, cell=SMALL)
    alt = f"Part of the grid of {task.name} around the agent"
    far = ("The marked objects are too far away to be shown.",) if len(marks) < len(known) else ()
    return fitted(board.items(), alt, ("One of many starts.", *_key(task), *far, *board.notes()), state=state)
