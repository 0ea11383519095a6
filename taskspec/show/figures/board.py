"""A board of cells as a scene: colours, letters, agents, values, and the direction of moves."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from taskspec.exact.model.space import Space
from taskspec.exact.model.transitions import Steps
from taskspec.language.expressions.types import Role
from taskspec.language.task.task import Task
from taskspec.show.figures import shapes as sc
from taskspec.show.figures.shapes import BROAD, ROLES, Box, Circle, Color, Item, Label, Line, Point, text_width
from taskspec.show.printers import tree as m

Cell = tuple[int, int]
Way = tuple[float, float]
_WORDS: dict[str, Cell] = {
    "left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1), "west": (-1, 0), "east": (1, 0), "north": (0, -1),
    "south": (0, 1), "stay": (0, 0), "wait": (0, 0), "noop": (0, 0),
}  # fmt: skip
CELL = 0.8
ROOMY = 1.15  # sides of cells, and of those that have room for a number and arrows beside it
LARGEST = 24  # columns or rows that are drawn one by one
WIDEST = 12.0
SIGN = 0.26
"""In centimetres: the cells of boards that are larger still are as small as that needs, and their signs stay as large."""
CORNERS = ((-1, 1), (1, 1), (-1, -1), (1, -1))  # corners of a cell, from its middle, for the objects that share it
BADGE = (0.3, 0.36)
BESIDE_VALUE = (0.34, 0.28)
"""How far from the middle of a cell objects in its corners are, and how large, as shares of its side; and beside a value."""
WALL = "#"
FENCES = {"|": (0.16, 1.0), "-": (1.0, 0.16)}  # thin walls: width and height, as shares of a cell
LETTER = 0.3  # height of letters
VALUE = 0.24  # height of numbers


def chosen_ways(
    task: Task, policy: Mapping[int, tuple[int, ...]], cells: Mapping[int, Cell]
) -> Iterator[tuple[Cell, Way]]:
    """Yield the moves on the board of the actions that a policy takes, by cell.

    Labels such as `left` or `down_right` say it. Other actions go where they lead in more than half of all cases, and
    nowhere where no outcome is that likely: an outcome of chance is no choice. From a cell of several states, only the
    ways that are taken in all of them.
    """
    pairs = []
    for code, actions in policy.items():
        for action in actions:
            pairs.append((code, action))
    if not pairs:
        return
    ways = _ways_by_label(task)
    if ways is None:
        moves = _probable_ways(task, pairs, cells)
    else:
        moves = ((code, ways[action]) for code, action in pairs)
    taken: dict[int, list[Way]] = {code: [] for code in policy}
    for code, way in moves:
        taken[code].append(way)
    common: dict[Cell, list[Way]] = {}
    for code, some in taken.items():
        cell = cells[code]
        common[cell] = list(filter(some.__contains__, common.get(cell, some)))
    for cell, some in common.items():
        for way in dict.fromkeys(some):
            if any(way):
                yield cell, way


def _ways_by_label(task: Task) -> list[Way] | None:
    """Return the moves that the labels of actions name, each of at most one cell; None if one names none."""
    if len(task.action) != 1 or task.action[0].domain is None:
        return None
    ways = []
    for action in range(Space(task.action, Role.ACTION).size):
        words = re.split(r"[^a-z]+", task.action[0].domain.labels[action].lower())
        if not _WORDS.keys() >= set(words):
            return None
        dx, dy = np.sign(np.sum([_WORDS[word] for word in words], axis=0)).tolist()
        ways.append((float(dx), float(dy)))
    return ways


def _probable_ways(task: Task, pairs: list[tuple[int, int]], cells: Mapping[int, Cell]) -> Iterator[tuple[int, Way]]:
    codes, actions = np.array(pairs, np.int64).T
    weights: dict[tuple[int, Cell], float] = {}
    for outcomes in Steps(task).outcomes(codes, actions, 0):
        points, targets, chances, *_ = outcomes.spread(len(codes))
        for point, code, p in zip(points.tolist(), targets.tolist(), chances.tolist(), strict=True):
            key = (point, cells[code])
            weights[key] = weights.get(key, 0.0) + p
    for (point, (bx, by)), p in weights.items():
        if p > 0.5:
            code = pairs[point][0]
            ax, ay = cells[code]
            length = max(abs(bx - ax), abs(by - ay)) or 1
            yield code, ((bx - ax) / length, (by - ay) / length)


@dataclass(frozen=True, slots=True)
class Thing:
    """An object in a cell, as a letter or two, and the way that it faces; without a word, the way of the agent there."""

    word: str
    cell: Cell
    way: Way | None = None


@dataclass
class Board:
    """Cells by column and row, of `columns` and `rows`, to be drawn; a board of many is drawn as a map of small cells."""

    columns: range
    rows: range
    colors: Mapping[Cell, Color]
    letters: Mapping[Cell, str]
    agents: Mapping[Cell, float]
    shades: Mapping[Cell, float] = field(default_factory=dict)
    values: Mapping[Cell, float] = field(default_factory=dict)
    moves: Sequence[tuple[Cell, Way]] = ()
    things: Sequence[Thing] = ()
    open: bool = False  # the world goes on beyond the frame
    cell: float = CELL

    def items(self) -> list[Item]:
        if self.is_whole:
            return [*self._cells()]
        return [*self._map()]

    def notes(self) -> tuple[str, ...]:
        if self.is_whole or not set(self.letters.values()) - {WALL}:
            return ()
        return ("Letters are too small to show.",)

    @property
    def is_whole(self) -> bool:
        """True if every cell is drawn as large as usual; those of larger boards are as small as that needs."""
        return max(len(self.columns), len(self.rows)) <= LARGEST

    def _cells(self) -> Iterator[Item]:
        at: dict[Cell, Cell] = {}
        for y, row in enumerate(self.rows):
            for x, column in enumerate(self.columns):
                cell = (column, row)
                yield from self._cell(x, y, cell)
                at[cell] = (x, y)
        if not self.open:
            yield Box((0, 0), len(self.columns) * self.cell, len(self.rows) * self.cell, None, "ink")
        yield from self._contents(at)

    def _cell(self, x: int, y: int, cell: Cell) -> Iterator[Item]:
        plain: Color = "muted" if self.letters.get(cell) == WALL else "paper"
        box = Box((x * self.cell, y * self.cell), self.cell, self.cell, self.colors.get(cell, plain), "faint")
        yield box
        if cell in self.shades:
            yield replace(box, fill="accent", shade=self.shades[cell])
        written = cell in self.values or cell in self.letters or cell in self.agents
        ways = set()
        for at, way in self.moves:
            if at == cell:
                ways.add((round(way[0]), round(way[1])))
        for free in ((1, -1), (-1, -1), (-1, 1), (1, 1), (1, -1)):
            if free not in ways:
                break
        yield from sc.marked(box, written, free)

    def _contents(self, at: Mapping[Cell, Cell]) -> Iterator[Item]:
        middle = {cell: ((x + 0.5) * self.cell, (y + 0.5) * self.cell) for cell, (x, y) in at.items()}
        yield from self._letters(middle)
        for cell, way in self.moves:
            if cell in middle:
                yield Line(self._ray(middle[cell], way, self._leaves(cell, way), 0.48), arrow=True, color="muted")
        for cell in self.values:
            if cell in middle:
                yield Label(middle[cell], self._value(cell), VALUE)
        for cell, weight in self.agents.items():
            if cell in middle and cell not in self.values:
                x, y = middle[cell]
                yield Circle((x, y), self.cell * 0.27, "ink", None, _certainty(weight))
                for side in (-1, 1):
                    eye = (x + side * self.cell * 0.09, y - self.cell * 0.05)
                    yield Circle(eye, self.cell * 0.045, "paper", None)
        taken = Counter({*self.agents, *self.values})
        for thing in self.things:
            if thing.cell in middle:
                yield from self._thing(thing, middle[thing.cell], taken[thing.cell])
            taken[thing.cell] += bool(thing.word)

    def _letters(self, middle: Mapping[Cell, Point]) -> Iterator[Item]:
        for cell, text in self.letters.items():
            if cell not in middle or cell in self.values or text == WALL:
                continue
            if text in FENCES:
                width, height = np.multiply(FENCES[text], self.cell).tolist()
                x, y = middle[cell]
                yield Box((x - width / 2, y - height / 2), width, height, "muted", None)
            else:
                yield Label(middle[cell], m.Words(text), LETTER, color="muted")

    def _ray(self, at: Point, way: Way, near: float, far: float) -> tuple[Point, Point]:
        x = self.cell * way[0]
        y = self.cell * way[1]
        return (at[0] + near * x, at[1] + near * y), (at[0] + far * x, at[1] + far * y)

    def _thing(self, thing: Thing, at: Point, taken: int) -> Iterator[Item]:
        """Yield a badge with a word, in a corner of an occupied cell; an arrow shows which way it faces."""
        if thing.way is not None:
            yield Line(self._ray(at, thing.way, 0.2, 0.49), arrow=True, width=0.05)
        if not thing.word:
            return
        x, y = at
        share = 0.62
        if thing.cell in self.colors:  # beside a sign
            share = 0.48
        if taken:
            out, share = BADGE
            if thing.cell in self.values:
                out, share = BESIDE_VALUE
            dx, dy = CORNERS[(taken - 1) % len(CORNERS)]
            x += out * dx * self.cell
            y += out * dy * self.cell
        side = share * self.cell
        word = m.Words(thing.word)
        yield Box((x - side / 2, y - side / 2), side, side, "second", "ink", round=0.15 * side)
        yield Label((x, y), word, min(0.7 * side, 0.9 * side / (BROAD * text_width(word, 1.0))))

    def _map(self) -> Iterator[Item]:
        size = WIDEST / max(len(self.columns), len(self.rows))

        def corner(cell: Cell) -> Point:
            return (cell[0] - self.columns.start) * size, (cell[1] - self.rows.start) * size

        fills: dict[Cell, Color] = {**dict.fromkeys(self.letters, "muted"), **self.colors}
        for cell, role in fills.items():
            yield Box(corner(cell), size, size, role, None)
        for cell, shade in self.shades.items():
            yield Box(corner(cell), size, size, "accent", None, shade=shade)
        for role in ROLES.values():
            spots = [corner(cell) for cell in fills if fills[cell] == role]
            if spots:
                x, y = central(spots)
                yield from sc.sign(role, (x + size / 2, y + size / 2), SIGN)
        if not self.open:
            yield Box((0, 0), len(self.columns) * size, len(self.rows) * size, None, "ink")
        for thing in self.things:
            if thing.word and thing.cell[0] in self.columns and thing.cell[1] in self.rows:
                x, y = corner(thing.cell)
                yield Label((x + size / 2, y + size / 2), m.Words(thing.word), LETTER, halo=True)
        for cell, weight in self.agents.items():
            x, y = corner(cell)
            yield Circle((x + size / 2, y + size / 2), max(size / 2, 0.1), "ink", None, _certainty(weight))

    def _leaves(self, cell: Cell, way: Way) -> float:
        """Return how far from the middle of a cell an arrow begins, as a share of its side: where it has left the number."""
        if cell not in self.values:
            return 0.2
        room = np.array((text_width(self._value(cell), VALUE) / 2, VALUE / 2)) + 0.05
        with np.errstate(divide="ignore"):
            leaves = float((room / (self.cell * np.abs(way))).min())
        return min(max(0.2, leaves), 0.36)

    def _value(self, cell: Cell) -> m.Math:
        value = self.values[cell]
        forms = (".3g", ".2g", ".1g")
        if abs(value) >= 99.95:
            forms = (".0f", ".1e", ".0e")
        text = ""
        for form in forms:
            text = re.sub(r"e([+-]?)0*", lambda e: f"e{e[1].strip('+')}", f"{value:{form}}")
            if len(text) <= 5:
                break
        return m.Num(text.replace("-", "−"))


def central(points: Sequence[Point]) -> Point:
    at = np.array(points)
    x, y = at[np.abs(at - at.mean(axis=0)).sum(axis=1).argmin()].tolist()
    return x, y


def _certainty(weight: float) -> float:
    """Return how dark an agent is: faint if it may start in several cells."""
    if weight > 0.99:
        return 1.0
    return 0.35
