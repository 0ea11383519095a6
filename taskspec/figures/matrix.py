"""The transitions of a finite task as a table of shades: for machines whose graph would be a knot."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.figures.machine import Captions, explore
from taskspec.figures.marks import equal, marked
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Box, Circle, Item, Label, Line, Scene, fitted, text_width
from taskspec.printers import tree as m
from taskspec.task.task import Task

SIDE = 7.0
LARGEST_CELL = 0.55
"""Of the table and of a cell, in centimetres."""
LETTERS = 0.28
NAMED = 30
ROOM = 0.36
"""As many states are all named, and the height of a row with a name, in centimetres."""
GAP = 0.08
CLEAR = 0.25
"""Between numbers beside one another, in centimetres, and between names, which may have spaces in them."""
STRIP = 0.3
"""Width of the column that says which states are good, bad or an end, in centimetres."""
MOST = 300
"""States whose cells can still be seen."""
LEAST_SHADE = 0.12
HEAD_ROOM = 0.13
"""Height of a row, in centimetres, beside which an arrow head has room."""
DRAWN = {
    "values": "V", "policy": "frames where they lead", "occupancy": "shade, {0}, in the column on the right",
}  # fmt: skip
"""How results are drawn."""


def matrix(task: Task, overlay: Overlay) -> Scene | None:
    """Draw how likely a step of random actions leads from each state (rows) to each other (columns); None for too many states."""
    machine = explore(task)
    if machine is None or len(machine.states) > MOST:
        return None
    drawn = _Matrix(Captions(machine), overlay)
    notes = ["Shade: how likely a uniformly random action leads from the state of a row to that of a column."]
    if machine.timed:
        notes.append("The time ends episodes, too.")
    notes += drawn.says.unmarked(machine.states)
    alt = f"Transitions of {task.name} as a table: {len(machine.states)} states, {machine.n_actions} actions"
    items = [*drawn.cells(), *drawn.results(), *drawn.labels(), *drawn.starts()]
    return fitted(items, alt, tuple(notes), drawn=DRAWN)


class _Matrix:
    def __init__(self, says: Captions, overlay: Overlay) -> None:
        self.says = says
        self.overlay = overlay
        self.place = {code: i for i, code in enumerate(sorted(says.machine.states))}
        self.named = len(self.place) <= NAMED
        self.cell = min(LARGEST_CELL, max(SIDE / len(self.place), ROOM if self.named else 0.0))
        self.side = self.cell * len(self.place)
        self.strip = STRIP if says.fills else 0.0
        self.right = self.side + (GAP + STRIP if overlay.occupancy else 0.0)  # of all columns

    def cells(self) -> Iterator[Item]:
        machine = self.says.machine
        total: dict[tuple[int, int], float] = {}
        for t in machine.transitions:
            key = (self.place[t.source], self.place[t.target])
            total[key] = total.get(key, 0.0) + t.probability / machine.n_actions
        for (row, column), p in total.items():
            shade = min(1.0, LEAST_SHADE + (1 - LEAST_SHADE) * p)
            yield Box((column * self.cell, row * self.cell), self.cell, self.cell, "ink", None, shade=shade)
        yield Box((0, 0), self.side, self.side, None, "faint")
        for code, role in self.says.fills.items():
            box = Box((-self.strip, self.place[code] * self.cell), self.strip, self.cell, role, "faint")
            yield box
            yield from marked(box)
        here = self.says.code_of(self.overlay)
        if here is not None and here in self.place:
            yield Box((0, self.place[here] * self.cell), self.side, self.cell, "accent", None, shade=0.4)

    def results(self) -> Iterator[Item]:
        """Yield frames around where the chosen actions lead, and on the right how often states are visited."""
        chosen = (t for t in self.says.machine.transitions if self.overlay.chosen(t.source, t.action))
        for row, column in dict.fromkeys((self.place[t.source], self.place[t.target]) for t in chosen):
            yield Box((column * self.cell, row * self.cell), self.cell, self.cell, None, "accent")
        for code, share in self.overlay.occupancy.items():
            if code in self.place:
                corner = (self.side + GAP, self.place[code] * self.cell)
                yield Box(corner, STRIP, self.cell, "accent", None, shade=min(1.0, share))
        if self.overlay.occupancy:
            yield Box((self.side + GAP, 0), STRIP, self.side, None, "faint")

    def labels(self) -> Iterator[Label]:
        """Yield names of states on the left, with numbers where columns have no room for names, and values on the right."""
        texts = [self.says.labels[code] for code in self.place]
        widest = max(text_width(text, LETTERS) for text in texts)
        all_numbers = all(isinstance(text, m.Num) for text in texts)
        room = widest + (GAP if all_numbers else CLEAR)
        left = -0.12 - self.strip
        beside = left
        heads = texts
        if self.named and room > self.cell and not all_numbers:
            heads = [m.Num(str(i)) for i in range(len(texts))]
            beside = left - text_width(heads[-1], LETTERS) - 2 * GAP
            room = self.cell
        for i in self._spaced(ROOM):
            y = (i + 0.5) * self.cell
            yield Label((beside, y), texts[i], LETTERS, "end", "muted")
            if heads is not texts:
                yield Label((left, y), heads[i], LETTERS, "end", "muted")
        for i in self._spaced(room):
            yield Label(((i + 0.5) * self.cell, -0.22), heads[i], LETTERS, "middle", "muted")
        for code, value in self.overlay.values.items() if self.named else ():
            if code in self.place:
                y = (self.place[code] + 0.5) * self.cell
                yield Label((self.right + 0.6, y), equal("V", value), LETTERS, "start", "muted")
        yield Label((self.side / 2, -0.65), m.Words("to"), LETTERS)
        yield Label((beside - widest - 0.23, self.side / 2), m.Words("from"), LETTERS, "end")

    def _spaced(self, room: float) -> range:
        """Return every state, or every second, fifth, tenth, …, so that each has some room, in centimetres."""
        steps = (k * 10**e for e in range(4) for k in (1, 2, 5))
        return range(0, len(self.place), next(k for k in steps if k * self.cell >= room - 1e-9))

    def starts(self) -> Iterator[Item]:
        """Yield arrows to the rows in which episodes start, or dots where there is no room."""
        for code in self.says.machine.start:
            y = (self.place[code] + 0.5) * self.cell
            if self.cell > HEAD_ROOM:
                yield Line(((self.right + 0.5, y), (self.right + 0.06, y)), arrow=True, color="muted")
            else:
                yield Circle((self.right + 0.1, y), 0.05, "muted", None)
