"""A board of cells as a scene: colours, letters, agents, values, and the direction of moves."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from taskspec.figures.marks import SIGNS, marked, sign
from taskspec.figures.scene import BROAD, Box, Circle, Color, Item, Label, Line, text_width
from taskspec.lang.ir import Role
from taskspec.model.space import Space
from taskspec.model.transitions import Steps
from taskspec.printers import tree as m
from taskspec.task.task import Task

Cell = tuple[int, int]
Way = tuple[float, float]
_WORDS: dict[str, Cell] = {
    "left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1), "west": (-1, 0), "east": (1, 0), "north": (0, -1),
    "south": (0, 1), "stay": (0, 0), "wait": (0, 0), "noop": (0, 0),
}  # fmt: skip


def chosen_ways(
    task: Task, policy: Mapping[int, tuple[int, ...]], cells: Mapping[int, Cell]
) -> Iterator[tuple[Cell, Way]]:
    """Return the moves on the board of the actions that a policy takes, by cell.

    Labels such as `left` or `down_right` say it. Other actions go where they lead in more than half of all cases, and
    nowhere where no outcome is that likely: an outcome of chance is no choice. From a cell of several states, only the
    ways that are taken in all of them.
    """
    said = [_said(task, i) for i in range(Space(task.action, Role.ACTION).size)]
    pairs = [(code, action) for code, actions in policy.items() for action in actions]
    ways = [way for way in said if way is not None]
    known = len(ways) == len(said)
    found = ((code, ways[action]) for code, action in pairs) if known else _led(task, pairs, cells)
    taken: dict[int, dict[Way, None]] = {code: {} for code in policy}
    for code, way in found:
        taken[code] |= {way: None} if any(way) else {}
    alike: dict[Cell, dict[Way, None]] = {}
    for code, some in taken.items():
        cell = cells[code]
        alike[cell] = {way: None for way in alike[cell] if way in some} if cell in alike else some
    yield from ((cell, way) for cell, some in alike.items() for way in some)


def _said(task: Task, action: int) -> Way | None:
    """Return the move that an action's label names, of at most one cell; None if it names none."""
    if len(task.action) != 1 or task.action[0].domain is None:
        return None
    words = re.split(r"[^a-z]+", task.action[0].domain.labels[action].lower())
    if not all(word in _WORDS for word in words):
        return None
    dx, dy = (sum(_WORDS[word][axis] for word in words) for axis in (0, 1))
    return float(np.sign(dx)), float(np.sign(dy))


def _led(task: Task, pairs: list[tuple[int, int]], cells: Mapping[int, Cell]) -> Iterator[tuple[int, Way]]:
    """Return where actions lead with a probability above one half, by code of the state."""
    if not pairs:
        return  # no overlay asks for a policy
    codes, actions = np.array(pairs, np.int64).reshape(-1, 2).T
    weights: dict[tuple[int, Cell], float] = {}
    for o in Steps(task).outcomes(codes, actions, 0):
        origin = np.arange(len(codes)) if o.origin is None else o.origin
        weight, target = (np.broadcast_to(x, origin.shape) for x in (o.weight, o.code))
        for point, p, code in zip(origin.tolist(), weight.tolist(), target.tolist(), strict=True):
            key = (point, cells[code])
            weights[key] = weights.get(key, 0.0) + p
    for (point, (bx, by)), p in weights.items():
        if p > 0.5:
            code = pairs[point][0]
            ax, ay = cells[code]
            length = max(abs(bx - ax), abs(by - ay)) or 1
            yield code, ((bx - ax) / length, (by - ay) / length)


# -- the board, with equal columns and rows of a large one left out

CELL = 0.8
ROOMY = 1.15
"""Sides of cells, and of those that have room for a number and arrows beside it."""
LARGEST = 24
"""Columns or rows that are drawn one by one."""
KEPT = 2
"""Columns that are drawn on either side of those that are left out, as they are alike."""
WIDEST = 12.0
SIGN = 0.26
"""In centimetres: the cells of boards that are larger still are as small as that needs, and their signs stay as large."""
CORNERS = ((-1, 1), (1, 1), (-1, -1), (1, -1))
"""In which corners of a cell objects are that share it, from its middle."""
BADGE = (0.3, 0.36)
BESIDE_VALUE = (0.34, 0.28)
"""How far from the middle of a cell objects in its corners are, and how large, as shares of its side; and beside a value."""
WALL = "#"
COORDINATE = 0.26
LETTER = 0.3
VALUE = 0.24
"""Heights of letters."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Neighbouring columns (or rows), drawn as one."""

    first: int
    last: int

    @property
    def alone(self) -> bool:
        return self.first == self.last


@dataclass(frozen=True, slots=True)
class Thing:
    """An object in a cell, as a letter or two, and the way that it faces; without a word, the way of the agent there."""

    word: str
    cell: Cell
    way: Way | None = None


@dataclass
class Board:
    """Cells by column and row, of `columns` and `rows`, to be drawn."""

    columns: range
    rows: range
    colors: Mapping[Cell, Color]
    letters: Mapping[Cell, str]
    agents: Mapping[Cell, float]
    shades: Mapping[Cell, float] = field(default_factory=dict)
    values: Mapping[Cell, float] = field(default_factory=dict)
    moves: Sequence[tuple[Cell, Way]] = ()
    things: Sequence[Thing] = ()
    folds: bool = True  # whether columns and rows may be left out
    open: bool = False  # the world goes on beyond the frame
    cell: float = CELL

    def items(self) -> list[Item]:
        if self.is_whole:
            return [*self._cells(_singly(self.columns), _singly(self.rows))]
        if self.folded is not None:
            across, down = self.folded
            return [*self._cells(across, down), *self._coordinates(across, 0), *self._coordinates(down, 1)]
        return [*self._map()]

    def notes(self) -> tuple[str, ...]:
        """Yield notes on how the board is drawn."""
        if self.is_whole:
            return ()
        if self.folded is not None:
            laid = self.values or self.moves or self.shades
            told = "; what is laid over them is not shown" if laid else ""
            return (f"Dots stand for columns and rows like those beside them{told}.",)
        return ("Letters are too small to show.",) if set(self.letters.values()) - {WALL} else ()

    @property
    def is_whole(self) -> bool:
        """Whether every cell is drawn, as large as usual."""
        return max(len(self.columns), len(self.rows)) <= LARGEST

    @cached_property
    def folded(self) -> tuple[list[Stretch], list[Stretch]] | None:
        """Columns and rows as they are drawn, alike ones as one; None where they are too many all the same."""
        if not self.folds:
            return None
        across, down = (self._stretches(axis) for axis in (0, 1))
        return (across, down) if max(len(across), len(down)) <= LARGEST else None

    def _marked(self, axis: int) -> dict[int, set[tuple[int, object]]]:
        """Return the contents of columns (or rows) that have any."""
        marked: dict[int, set[tuple[int, object]]] = {}
        for found in (self.colors, self.letters, self.agents):
            for cell, mark in found.items():
                marked.setdefault(cell[axis], set()).add((cell[1 - axis], mark))
        for thing in self.things:
            marked.setdefault(thing.cell[axis], set()).add((thing.cell[1 - axis], thing.word))
        return marked

    def _stretches(self, axis: int) -> list[Stretch]:
        """Return runs of columns (or rows): those that are equal to both neighbours together, others alone."""
        marked = self._marked(axis)
        out: list[Stretch] = []
        for _, group in groupby((self.columns, self.rows)[axis], key=lambda i: marked.get(i, set())):
            run = list(group)
            few = len(run) <= 2 * KEPT + 1
            out += _singly(run if few else run[:KEPT])
            out += [] if few else [Stretch(run[KEPT], run[-KEPT - 1]), *_singly(run[-KEPT:])]
        return out

    def _cells(self, across: Sequence[Stretch], down: Sequence[Stretch]) -> Iterator[Item]:
        for y, row in enumerate(down):
            for x, column in enumerate(across):
                alone = column.alone and row.alone
                yield from self._cell(x, y, (column.first, row.first), alone)
                if not alone:
                    dots: m.Math = m.Words("⋮") if column.alone else m.Sym("…")
                    yield Label(((x + 0.5) * self.cell, (y + 0.5) * self.cell), dots, LETTER, color="muted")
        if not self.open:
            yield Box((0, 0), len(across) * self.cell, len(down) * self.cell, None, "ink")
        at = {
            (c.first, r.first): (x, y) for y, r in enumerate(down) for x, c in enumerate(across) if c.alone and r.alone
        }
        yield from self._marks(at)

    def _cell(self, x: int, y: int, cell: Cell, alone: bool) -> Iterator[Item]:
        plain: Color = "muted" if self.letters.get(cell) == WALL else "paper"
        box = Box((x * self.cell, y * self.cell), self.cell, self.cell, self.colors.get(cell, plain), "faint")
        yield box
        if alone and cell in self.shades:
            yield replace(box, fill="accent", shade=self.shades[cell])
        written = not alone or any(cell in found for found in (self.values, self.letters, self.agents))
        yield from marked(box, 0.3 * self.cell if written else 0.0, self._free_corner(cell))

    def _free_corner(self, cell: Cell) -> tuple[int, int]:
        """Return a corner of a cell from its middle that no arrow points to, if there is one."""
        taken = {tuple(round(d) for d in way) for at, way in self.moves if at == cell}
        return next((corner for corner in ((1, -1), (-1, -1), (-1, 1), (1, 1)) if corner not in taken), (1, -1))

    def _marks(self, at: Mapping[Cell, Cell]) -> Iterator[Item]:
        """Yield the contents of the drawn cells at their places; values are left out beside objects."""
        middle = {cell: ((x + 0.5) * self.cell, (y + 0.5) * self.cell) for cell, (x, y) in at.items()}
        for cell, text in self.letters.items():
            if cell in middle and cell not in self.values and text != WALL:
                yield Label(middle[cell], m.Words(text), LETTER, color="muted")
        yield from (self._move(at[cell], cell, way) for cell, way in self.moves if cell in at)
        yield from (Label(middle[cell], self._value(cell), VALUE) for cell in self.values if cell in middle)
        for cell, weight in self.agents.items():
            if cell in middle and cell not in self.values:
                yield from agent(*middle[cell], weight, self.cell)
        for i, thing in enumerate(self.things):
            if thing.cell in middle:
                taken = sum(x.cell == thing.cell for x in self.things[:i] if x.word)
                taken += thing.cell in self.agents or thing.cell in self.values
                yield from self._thing(thing, middle[thing.cell], taken)

    def _thing(self, thing: Thing, at: tuple[float, float], taken: int) -> Iterator[Item]:
        """Yield a badge with a word, in a corner of an occupied cell; an arrow shows which way it faces."""
        if thing.way is not None:
            (near, far) = (
                (at[0] + r * self.cell * thing.way[0], at[1] + r * self.cell * thing.way[1]) for r in (0.2, 0.49)
            )
            yield Line((near, far), arrow=True, width=0.05)
        if not thing.word:
            return
        whole = 0.62 if thing.cell not in self.colors else 0.48  # beside a sign
        out, small = BESIDE_VALUE if thing.cell in self.values else BADGE
        side = (whole if not taken else small) * self.cell
        word = m.Words(thing.word)
        dx, dy = CORNERS[(taken - 1) % len(CORNERS)] if taken else (0, 0)
        x = at[0] + out * dx * self.cell
        y = at[1] + out * dy * self.cell
        yield Box((x - side / 2, y - side / 2), side, side, "second", "ink", round=0.15 * side)
        yield Label((x, y), word, min(0.7 * side, 0.9 * side / (BROAD * text_width(word, 1.0))))

    def _map(self) -> Iterator[Item]:
        """Yield cells too small for a grid: those with a colour or a letter, and the agents."""
        size = WIDEST / max(len(self.columns), len(self.rows))

        def corner(cell: Cell) -> tuple[float, float]:
            return (cell[0] - self.columns.start) * size, (cell[1] - self.rows.start) * size

        fills: dict[Cell, Color] = {**dict.fromkeys(self.letters, "muted"), **self.colors}
        yield from (Box(corner(cell), size, size, role, None) for cell, role in fills.items())
        for role in SIGNS:  # of each, at the one nearest to their middle
            spots = np.array([corner(cell) for cell in fills if fills[cell] == role])
            if len(spots):
                x, y = spots[np.abs(spots - spots.mean(axis=0)).sum(axis=1).argmin()]
                yield from sign(role, (float(x) + size / 2, float(y) + size / 2), SIGN)
        if not self.open:
            yield Box((0, 0), len(self.columns) * size, len(self.rows) * size, None, "ink")
        for thing in self.things:
            if thing.word and thing.cell[0] in self.columns and thing.cell[1] in self.rows:
                x, y = corner(thing.cell)
                yield Label((x + size / 2, y + size / 2), m.Words(thing.word), LETTER, halo=True)
        for cell, weight in self.agents.items():
            x, y = corner(cell)
            yield Circle((x + size / 2, y + size / 2), max(size / 2, 0.1), "ink", None, 1.0 if weight > 0.99 else 0.35)

    def _coordinates(self, stretches: Sequence[Stretch], axis: int) -> Iterator[Label]:
        """Yield numbers above the columns (0) or left of the rows (1); if there is no room, those of marked ones."""
        texts: list[m.Math] = [_coordinate(each, axis) for each in stretches]
        rooms = [text_width(text, COORDINATE) * 1.2 if axis == 0 else COORDINATE * 1.2 for text in texts]
        marked = self._marked(axis)
        end = float("-inf")
        for i, (each, text, room) in enumerate(zip(stretches, texts, rooms, strict=True)):
            at = (i + 0.5) * self.cell
            if at - room / 2 < end or (max(rooms) > self.cell and each.first not in marked):
                continue
            end = at + room / 2
            if axis == 0:
                yield Label((at, -0.25), text, COORDINATE, color="muted")
            else:
                yield Label((-0.15, at), text, COORDINATE, "end", color="muted")

    def _move(self, at: Cell, cell: Cell, way: Way) -> Line:
        """Return an arrow from near the middle of a cell, or from its number, to its edge."""
        first = 0.2
        if cell in self.values:
            room = text_width(self._value(cell), VALUE) / 2 + 0.05, VALUE / 2 + 0.05
            leaves = min(r / (self.cell * abs(d)) for r, d in zip(room, way, strict=True) if d)
            first = min(max(first, leaves), 0.36)
        (near, far) = (
            (self.cell * (at[0] + 0.5 + r * way[0]), self.cell * (at[1] + 0.5 + r * way[1])) for r in (first, 0.48)
        )
        return Line((near, far), arrow=True, color="muted")

    def _value(self, cell: Cell) -> m.Math:
        return m.Num(_short(self.values[cell]))


def _short(value: float) -> str:
    """Return a number of at most five letters, which have room in a cell, or six."""
    forms = (".3g", ".2g", ".1g") if abs(value) < 99.95 else (".0f", ".1e", ".0e")
    texts = [re.sub(r"e([+-]?)0*", lambda e: f"e{e[1].strip('+')}", f"{value:{form}}") for form in forms]
    return next((text for text in texts if len(text) <= 5), texts[-1]).replace("-", "−")


def _singly(numbers: Sequence[int]) -> list[Stretch]:
    return [Stretch(i, i) for i in numbers]


def _coordinate(each: Stretch, axis: int) -> m.Math:
    if each.alone:
        return m.Num(str(each.first).replace("-", "−"))
    return m.Words("⋮") if axis else m.Sym("…")


def agent(x: float, y: float, weight: float, cell: float = CELL) -> Iterator[Item]:
    """Yield the agent; faint if it may start in several cells."""
    shade = 1.0 if weight > 0.99 else 0.35
    yield Circle((x, y), cell * 0.27, "ink", None, shade)
    for side in (-1, 1):
        yield Circle((x + side * cell * 0.09, y - cell * 0.05), cell * 0.045, "paper", None)
