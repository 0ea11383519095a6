"""A grid world as a scene: cells, walls or letters of a map, marked cells, and the agent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from operator import add

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import plural
from taskspec.exact.model.transitions import Steps
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.types import Expression
from taskspec.language.task.questions import component, components_read, reads_time, unchanged
from taskspec.language.task.task import Task
from taskspec.show.figures.board import CELL, LARGEST, ROOMY, WIDEST, Board, Cell, Thing, chosen_ways
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.shapes import ROLES, Color, Scene, fitted, moved
from taskspec.show.figures.states import Reads, all_states, at_states, figure_of, first_state, observed, reads_of

FARTHEST = 5_000  # columns or rows of a world that is drawn whole, and how far off what is marked of another may be
NOWHERE = 2**53  # places beyond it, or that are no number, are taken for this one
SMALL = 0.44  # the side of a cell, in centimetres, where a part of a vast grid is drawn
FLOOR = frozenset(" .:")  # characters of a map that are not drawn
DRAWN = {"values": "numbers", "policy": "arrows", "occupancy": "shade, {0}"}
DRAWN_TOGETHER = {
    "values": "numbers, of the best state in a cell",
    "policy": "arrows, where all states in a cell agree",
    "occupancy": "shade, relative to the most visited cell",
}
"""How results are drawn: with a state in each cell, and with several."""


def grid(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the grid on which a task's figure section places its states."""
    if not figure_of(task).at:
        return None
    grid = _Grid(task, overlay)
    world = all_states(task)
    if world is None:
        drawn: Scene | None = grid.window()
    else:
        drawn = grid.whole(*world)
    if drawn is None or overlay.here is not None or not task.observation.is_random:
        return drawn
    strip = fitted(observed(task), "", margin=0.0)  # below the grid, what the agent sees of a first state
    left = max(0.0, (strip.width - drawn.width) / 2)
    below = moved(strip.items, left + (drawn.width - strip.width) / 2, drawn.height + 0.1)
    items = (*moved(drawn.items, left, 0.0), *below)
    notes = (*drawn.notes, "Below the grid: what the agent sees at the start of an episode.")
    return fitted(items, f"{drawn.alt}, and an observation", notes, drawn=drawn.drawn)


class _Grid:
    """Places of the agent, objects and marks, in the state that is shown and in others."""

    def __init__(self, task: Task, overlay: Overlay) -> None:
        self.task = task
        self.figure = figure_of(task)
        self.overlay = overlay
        self.state = overlay.here or first_state(task)
        self.reads = reads_of(task, self.state)
        self.things = tuple(self._things())
        hidden = {thing.cell for thing in self.things}
        self.letters: dict[Cell, str] = {}
        for y, line in enumerate(self.figure.map):
            for x, char in enumerate(line):
                if char not in FLOOR and (x, y) not in hidden:
                    self.letters[x, y] = char

    def numbers(self, place: Iterable[Expression], reads: Reads, count: int = 1) -> Array:
        """Return column and row of states, and maybe a way, (count, 2) or (count, 4)."""
        parts = [at_states(self.task, node, reads, count) for node in place]
        if len(parts) == 1:
            return parts[0]
        return np.stack(parts, axis=1)

    def _things(self) -> Iterator[Thing]:
        places = {"": self.figure.at} | dict(self.figure.objects)
        for word, place in places.items():
            (numbers,) = self.numbers(place, self.reads).astype(float)
            length = float(np.abs(numbers[2:]).max(initial=0.0))
            way = None
            if 0 < length < math.inf:
                way = tuple((numbers[2:] / length).tolist())
            if word or way is not None:
                yield Thing(self.short(word), _cell(numbers), way)

    def short(self, word: str) -> str:
        """Return as few letters as tell an object from others."""
        for n in range(1, len(word)):
            if sum(other[:n] == word[:n] for other in self.figure.objects) == 1:
                return word[:1].upper() + word[1:n]
        return word[:1].upper() + word[1:]

    def key(self) -> tuple[str, ...]:
        words = []
        for word in self.figure.objects:
            if len(word) > 1:
                words.append(f"{self.short(word)}: {word}")
        if words:
            return (f"{', '.join(words)}.",)
        return ()

    def marks(self, reads: Reads, count: int = 1) -> Iterator[tuple[Color, Array]]:
        """Yield conditions (count,) or places (count, 2) to highlight, with their colours."""
        for name, node in self.figure.highlight.items():
            if name in ROLES:
                yield ROLES[name], at_states(self.task, node, reads, count)

    def whole(self, reads: Reads, count: int) -> Scene | None:
        """Return all cells of a finite task."""
        overlay = self.overlay
        cells = _whole_numbers(self.numbers(self.figure.at, reads, count)[:, :2])
        if np.ptp(np.vstack([cells, [(0, 0)]]), axis=0).max() >= FARTHEST:
            return None
        left, top = cells.min(0).tolist()
        right, bottom = cells.max(0).tolist()
        lines = self.figure.map
        columns = range(min(0, left), max(right + 1, *map(len, lines[:1]), 0))
        rows = range(min(0, top), max(bottom + 1, len(lines)))
        by_code: dict[int, Cell] = {code: (x, y) for code, (x, y) in enumerate(cells.tolist())}
        distinct = len(set(by_code.values()))
        colors: dict[Cell, Color] = {}
        unplaced = []
        for role, at in self.marks(reads, count):
            if at.ndim == 1:
                marked = dict.fromkeys(map(_cell, cells[at.astype(bool)]), role)
                if not at.all() and len(marked) == distinct:
                    unplaced.append(f"Not marked: {role}, which may hold in every cell.")
                else:
                    colors |= marked
        for role, at in self.marks(self.reads):
            if at.ndim == 2:
                colors |= {_cell(point): role for point in at}
        if self.things or overlay.here is not None:  # in one state
            agents = {self._own(): 1.0}
        else:
            agents = _by_cell(by_code, Steps(self.task).start_weights(), add)
        values = _by_cell(by_code, overlay.values, max)
        shades = _by_cell(by_code, overlay.occupancy, add)
        most = max((1.0, *shades.values()))
        shades = {cell: share / most for cell, share in shades.items()}
        moves = list(chosen_ways(self.task, overlay.policy, by_code))
        cell = CELL
        if values and moves and len(columns) * ROOMY <= WIDEST:
            cell = ROOMY
        board = Board(columns, rows, colors, self.letters, agents, shades, values, moves, self.things, cell=cell)
        notes = (*self.key(), *unplaced, *board.notes())
        how = DRAWN if distinct == len(by_code) else DRAWN_TOGETHER
        return fitted(board.items(), self._alt(columns, rows), notes, drawn=how)

    def _own(self) -> Cell:
        return _cell(self.numbers(self.figure.at, self.reads)[0])

    def window(self) -> Scene:
        """Return the part of a vast grid around one first state."""
        own = self._own()
        marks = {}
        leaves_out = False
        for role, at in self.marks(self.reads):
            if at.shape == (1, 2) and _is_near(_cell(at[0]), own):
                marks[_cell(at[0])] = role
            elif at.shape == (1, 2):
                leaves_out = True
        things = [thing for thing in self.things if _is_near(thing.cell, own)]
        agents = {own: 1.0}
        notes = ["One sampled initial state.", *self.key()]
        sides = self._sides()
        if sides is not None:
            columns, rows = sides
            board = Board(columns, rows, marks, self.letters, agents, things=things)
            return fitted(board.items(), self._alt(columns, rows), tuple(notes))
        points = np.array([own, *marks, *(thing.cell for thing in things)])
        middle = np.round(points.mean(axis=0)).astype(int)
        half = max(4, int(np.abs(points - middle).max()) + 1)
        if self.overlay.here is not None:  # a window that stays as the agent moves in it
            half = (LARGEST - 1) // 2
            size = 2 * half + 1
            anchor = np.zeros(2, int)
            if marks and self._stay():
                anchor = np.array(next(iter(marks)))
            middle = anchor + (own - anchor + half) // size * size
        columns, rows = (range(int(v) - half, int(v) + half + 1) for v in middle)
        board = Board(columns, rows, marks, {}, agents, things=things, open=True, cell=SMALL)
        if leaves_out:
            notes.append("The marked objects are too far away to be shown.")
        alt = f"Part of the grid of {self.task.name} around the agent"
        return fitted(board.items(), alt, (*notes, *board.notes()))

    def _alt(self, columns: range, rows: range) -> str:
        return f"Grid of {self.task.name}: {plural(len(columns), 'column')} and {plural(len(rows), 'row')}"

    def _sides(self) -> tuple[range, range] | None:
        """Return columns and rows that the agent may be in, where they are few."""
        place = self.figure.at
        ends = [bounds(node, {}) for node in place[:2] if component(node) is not None]
        if self.figure.map:
            ends = [(0, len(self.figure.map[0]) - 1), (0, len(self.figure.map) - 1)]
        elif len(place) == 1:
            ends = ends * 2  # one vector of both
        sides = []
        for low, high in ends:
            if -LARGEST < low <= high < LARGEST:
                sides.append(range(min(0, int(low)), int(high) + 1))
        if len(ends) != 2 or len(sides) != 2:
            return None
        return sides[0], sides[1]

    def _stay(self) -> bool:
        """Test whether marks stay where they are."""
        marked = self.figure.highlight.values()
        return not reads_time(marked) and components_read(marked) <= unchanged(self.task)


def _is_near(cell: Cell, other: Cell) -> bool:
    return max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) < FARTHEST


def _whole_numbers(places: Array) -> Array:
    return np.clip(np.nan_to_num(places, nan=NOWHERE), -NOWHERE, NOWHERE).astype(int)


def _cell(place: Array) -> Cell:
    x, y = _whole_numbers(place[:2]).tolist()
    return x, y


def _by_cell(
    by_code: Mapping[int, Cell], by_state: Mapping[int, float], together: Callable[[float, float], float]
) -> dict[Cell, float]:
    cells: dict[Cell, float] = {}
    for code, number in by_state.items():
        cell = by_code[code]
        if cell in cells:
            cells[cell] = together(cells[cell], number)
        else:
            cells[cell] = number
    return cells
