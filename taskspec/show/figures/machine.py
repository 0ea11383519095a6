"""The part of a finite task that episodes visit, as transitions, with what figures say of it; and a table of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import filterfalse

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import number, plural
from taskspec.base.limits import limits
from taskspec.exact.model.space import Space
from taskspec.exact.model.transitions import Steps
from taskspec.language.expressions.types import Role
from taskspec.language.registry import load
from taskspec.language.task.parts import DEFAULT, Component
from taskspec.language.task.questions import reads_time
from taskspec.language.task.task import Task
from taskspec.show.figures import shapes as sc
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.states import as_printed, at_states, figure_of, reads_of
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import Notation, of_task
from taskspec.show.printers.text import plain

MAX_STATES = 1500
MAX_TRANSITIONS = 20_000
MAX_ACTIONS = 100
MAX_CONSIDERED = 200_000
"""Outcomes that are looked at in one go: many more than a graph could show, and few enough to take a second."""
FEW = 3  # as many states are named in a note


@dataclass(frozen=True, slots=True)
class Transition:
    source: int
    action: int
    target: int
    probability: float
    reward: float
    ends: bool


@dataclass(frozen=True)
class Machine:
    """States by code in the order of their discovery, what can happen in each, and their names, colours and notes."""

    task: Task
    start: dict[int, float]
    states: tuple[int, ...]
    transitions: tuple[Transition, ...]
    ending: frozenset[int]
    n_actions: int
    starters: Mapping[int, str] = field(default_factory=dict)  # who starts where, in tasks with roles
    timed: bool = False  # episodes end by the time as well

    @cached_property
    def space(self) -> Space:
        return Space(self.task.state, Role.STATE)

    @cached_property
    def labels(self) -> Mapping[int, m.Math]:
        return {code: self._combination(self.space, self.task.state, code) for code in self.states}

    @cached_property
    def actions(self) -> tuple[m.Math, ...]:
        space = Space(self.task.action, Role.ACTION)
        return tuple(self._combination(space, self.task.action, code) for code in range(space.size))

    @cached_property
    def notation(self) -> Notation:
        return of_task(self.task)

    def _combination(self, space: Space, components: tuple[Component, ...], code: int) -> m.Math:
        """Return the values of some components: labels by their symbols, numbers and conditions as digits."""
        values = space.values_of(code)
        parts: list[m.Math] = []
        for c in components:
            written = str(as_printed(c, values[c.name]))
            if c.domain is not None and not c.type.shape:
                parts.append(self.notation.labels[c.name][written])
            else:
                parts.append(m.Num(written.replace("-", "−")))
        return m.joined(parts)

    @cached_property
    def marks(self) -> Mapping[str, tuple[int, ...]]:
        """States in which the conditions under `figure: highlight:` hold, by colour."""
        states = {}
        codes = np.array(self.states)
        for name, node in figure_of(self.task).highlight.items():
            if not node.type.shape and name in sc.HIGHLIGHTS:
                holds = at_states(self.task, node, dict(self.space.decode(codes)), len(codes))
                states[name] = tuple(codes[holds.astype(bool)].tolist())
        return states

    @cached_property
    def fills(self) -> Mapping[int, sc.Color]:
        """Colours of states; the last of several."""
        fills: dict[int, sc.Color] = {}
        for name, codes in self.marks.items():
            fills |= dict.fromkeys(codes, sc.HIGHLIGHTS[name])
        return fills

    def unmarked(self, shown: Collection[int]) -> Iterator[str]:
        """Yield notes on what a figure of some states does not show of `figure: highlight:`."""
        for name, codes in self.marks.items():
            left = list(filterfalse(shown.__contains__, codes))
            if not codes:
                yield f"Not shown: {name}, which holds in no state that episodes reach."
            elif left:
                yield f"Not shown: {name} ({self.named(left)})."

    def named(self, codes: Sequence[int]) -> str:
        """Return a few states by name, or how many there are."""
        if len(codes) > FEW:
            return f"{len(codes):,} states"
        form = "({})"
        if len(self.task.state) == 1:
            (c,) = self.task.state
            form = "{}"
            if not c.domain:
                form = f"{plain(self.notation.symbol(c.name))} = {{}}"
        names = [plain(self.labels[code]) for code in codes]
        return ", ".join(map(form.format, names))

    @cached_property
    def rewards(self) -> tuple[str, Mapping[int, float]]:
        """Rewards by state "reached" or "left", or "all" if they are equal; by "arrow" where states do not decide them."""
        if len({t.reward for t in self.transitions}) == 1:
            return "all", {}
        for how, end in (("reached", "target"), ("left", "source")):
            by_state: dict[int, float] = {}
            for t in self.transitions:
                if by_state.setdefault(getattr(t, end), t.reward) != t.reward:
                    break
            else:
                return how, by_state
        return "arrow", {}

    def notes(self, shows_loops: bool) -> Iterator[str]:
        how, _ = self.rewards
        if how == "all":
            yield f"Every step pays {number(self.transitions[0].reward, 4)}."
        if how == "left":
            yield "The reward depends on the state before the step."
        if not shows_loops and any(t.source == t.target and not t.ends for t in self.transitions):
            yield "Actions without an arrow do not change the state."
        if self.timed:
            yield "Episodes also end at the horizon."

    def code_of(self, overlay: Overlay) -> int | None:
        if overlay.here is None:
            return None
        state = reads_of(self.task, overlay.here)
        return int(self.space.encode([state[c.read] for c in self.task.state], 1)[0][0])


def explore(task: Task) -> Machine | None:
    """Return the states that episodes visit; None if they are many, or if dynamics or rewards depend on the time."""
    explored = _explored(task)
    if explored is None:
        return None
    return replace(explored, task=task)


@lru_cache(maxsize=8)
def _explored(task: Task) -> Machine | None:
    """Explore a task once, for all its overlays; equal tasks may have other figure sections."""
    if not task.is_finite or reads_time((*task.process.next, task.process.reward)):
        return None
    try:
        steps = Steps(task)
        if steps.branching > limits().outcomes or steps.actions.size > MAX_ACTIONS:
            return None
        starts = _starts(task, steps)
    except SpecError:
        return None
    start: dict[int, float] = {}
    starters: dict[int, str] = {}
    for who, probabilities in starts.items():
        start |= probabilities
        if who:
            starters |= dict.fromkeys(probabilities, f"{who} starts")
    walked = _walk(steps, np.array(list(start)))
    if walked is None:
        return None
    states, transitions = walked
    ending = frozenset(t.target for t in transitions if t.ends)
    return Machine(task, start, states, transitions, ending, steps.actions.size, starters, steps.uses_time)


def _starts(task: Task, steps: Steps) -> dict[str, dict[int, float]]:
    own = steps.start_weights()
    given = {p.name: p.value for p in task.parameters if p.value != p.default}
    starts: dict[str, dict[int, float]] = {}
    for who, key in task.roles.items():
        other = task
        if key != task.source.variant:
            other = load(task, key, **given)
        if (other.state, other.spec.dynamics) != (task.state, task.spec.dynamics):
            return {"": own}
        if other is task:
            starts[who] = own
        else:
            starts[who] = Steps(other).start_weights()
    codes: list[int] = []
    for probabilities in starts.values():
        codes += probabilities
    if len(set(codes)) == len(codes) and own in starts.values():
        return starts
    return {"": own}


def _walk(steps: Steps, start: np.ndarray) -> tuple[tuple[int, ...], tuple[Transition, ...]] | None:
    """Search breadth first up to the horizon; return states and transitions."""
    seen: dict[int, None] = dict.fromkeys(start.tolist())
    level = list(seen)
    transitions: list[Transition] = []
    depth = 0
    while level and (steps.task.horizon is None or depth < steps.task.horizon):
        if len(seen) > MAX_STATES or len(level) * steps.actions.size * steps.branching > MAX_CONSIDERED:
            return None
        moved = _from(steps, level)
        transitions += moved
        new: dict[int, None] = {}
        over: dict[int, None] = {}
        for t in moved:
            if t.target in seen:
                continue
            if t.ends:
                over[t.target] = None
            else:
                new[t.target] = None
        seen |= new
        seen |= over
        if len(transitions) > MAX_TRANSITIONS:
            return None
        level = list(new)
        depth += 1
    if len(seen) <= MAX_STATES:
        return (tuple(seen), tuple(transitions))
    return None


def _from(steps: Steps, level: list[int]) -> list[Transition]:
    """Return transitions out of some states, state by state and action by action; equal outcomes are one."""
    actions = steps.actions.size
    sources = np.repeat(level, actions)
    choices = np.tile(np.arange(actions), len(level))
    total: dict[tuple[int, int, float, bool], float] = {}
    for outcomes in steps.outcomes(sources, choices, 0):
        columns = [column.tolist() for column in outcomes.spread(len(sources))]
        for point, code, p, reward, ends, _ in zip(*columns, strict=True):
            if p > 0:
                key = (point, int(code), float(reward), bool(ends))
                total[key] = total.get(key, 0.0) + p
    transitions = []
    for (point, code, reward, ends), p in sorted(total.items(), key=lambda item: item[0][0]):
        transitions.append(Transition(int(sources[point]), int(choices[point]), code, p, reward, ends))
    return transitions


def state_labels(task: Task) -> Mapping[int, m.Math]:
    """Return the symbols of the states of a task that has a graph, by code; none for other tasks."""
    machine = None
    if figure_of(task).kind == DEFAULT and len(task.state) == 1:
        machine = explore(task)
    if machine is None or task.modifiers:
        return {}
    return machine.labels


SIDE = 7.0  # of the table, in centimetres
LARGEST_CELL = 0.55  # side of a cell
LETTERS = 0.28
NAMED = 30  # as many states are all named
ROOM = 0.36  # height of a row with a name
GAP = 0.08  # between numbers beside one another
CLEAR = 0.25  # between names, which may have spaces in them
STRIP = 0.3  # width of the column that says which states are good, bad or an end, in centimetres
MOST = 300  # states whose cells can still be seen
LEAST_SHADE = 0.12
HEAD_ROOM = 0.13  # height of a row, in centimetres, beside which an arrow head has room
DRAWN = {
    "values": "V", "policy": "frames where they lead", "occupancy": "shade, {0}, in the column on the right",
}  # fmt: skip
"""How results are drawn."""


def matrix(task: Task, overlay: Overlay) -> sc.Scene | None:
    """Draw how likely a step of random actions leads from each state (rows) to each other (columns); None for too many states."""
    machine = explore(task)
    if machine is None or len(machine.states) > MOST:
        return None
    drawn = _Matrix(machine, overlay)
    notes = ["Shade: transition probability, from row to column, under uniformly random actions."]
    if machine.timed:
        notes.append("Episodes also end at the horizon.")
    notes += machine.unmarked(machine.states)
    alt = f"Transitions of {task.name} as a table: {plural(len(machine.states), 'state')}, {plural(machine.n_actions, 'action')}"
    items = [*drawn.cells(), *drawn.results(), *drawn.labels(), *drawn.starts()]
    return sc.fitted(items, alt, tuple(notes), drawn=DRAWN)


class _Matrix:
    def __init__(self, machine: Machine, overlay: Overlay) -> None:
        self.machine = machine
        self.overlay = overlay
        self.place = {code: i for i, code in enumerate(sorted(machine.states))}
        self.named = len(self.place) <= NAMED
        self.cell = min(LARGEST_CELL, max(SIDE / len(self.place), ROOM * self.named))
        self.side = self.cell * len(self.place)
        self.strip = STRIP * bool(machine.fills)
        self.right = self.side + (GAP + STRIP) * bool(overlay.occupancy)  # of all columns

    def cells(self) -> Iterator[sc.Item]:
        total: dict[tuple[int, int], float] = {}
        for t in self.machine.transitions:
            key = (self.place[t.source], self.place[t.target])
            total[key] = total.get(key, 0.0) + t.probability / self.machine.n_actions
        for (row, column), p in total.items():
            shade = min(1.0, LEAST_SHADE + (1 - LEAST_SHADE) * p)
            yield sc.Box((column * self.cell, row * self.cell), self.cell, self.cell, "ink", None, shade=shade)
        yield sc.Box((0, 0), self.side, self.side, None, "faint")
        for code, role in self.machine.fills.items():
            box = sc.Box((-self.strip, self.place[code] * self.cell), self.strip, self.cell, role, "faint")
            yield box
            yield from sc.marked(box)
        here = self.machine.code_of(self.overlay)
        if here is not None and here in self.place:
            yield sc.Box((0, self.place[here] * self.cell), self.side, self.cell, "accent", None, shade=0.4)

    def results(self) -> Iterator[sc.Item]:
        """Yield frames around where the chosen actions lead, and on the right how often states are visited."""
        led: dict[tuple[int, int], None] = {}
        for t in self.machine.transitions:
            if self.overlay.chosen(t.source, t.action):
                led[self.place[t.source], self.place[t.target]] = None
        for row, column in led:
            yield sc.Box((column * self.cell, row * self.cell), self.cell, self.cell, None, "accent")
        for code, share in self.overlay.occupancy.items():
            if code in self.place:
                corner = (self.side + GAP, self.place[code] * self.cell)
                yield sc.Box(corner, STRIP, self.cell, "accent", None, shade=min(1.0, share))
        if self.overlay.occupancy:
            yield sc.Box((self.side + GAP, 0), STRIP, self.side, None, "faint")

    def labels(self) -> Iterator[sc.Label]:
        texts = [self.machine.labels[code] for code in self.place]
        widest = max(sc.text_width(text, LETTERS) for text in texts)
        all_numbers = all(isinstance(text, m.Num) for text in texts)
        room = widest + CLEAR
        if all_numbers:
            room = widest + GAP
        left = -0.12 - self.strip
        beside = left
        heads = texts
        if self.named and room > self.cell and not all_numbers:
            heads = list(map(m.Num, map(str, range(len(texts)))))
            beside = left - sc.text_width(heads[-1], LETTERS) - 2 * GAP
            room = self.cell
        for i in self._spaced(ROOM):
            y = (i + 0.5) * self.cell
            yield sc.Label((beside, y), texts[i], LETTERS, "end", "muted")
            if heads is not texts:
                yield sc.Label((left, y), heads[i], LETTERS, "end", "muted")
        for i in self._spaced(room):
            yield sc.Label(((i + 0.5) * self.cell, -0.22), heads[i], LETTERS, "middle", "muted")
        for code, value in self.overlay.values.items():
            if self.named and code in self.place:
                y = (self.place[code] + 0.5) * self.cell
                yield sc.Label((self.right + 0.6, y), sc.equal("V", value), LETTERS, "start", "muted")
        yield sc.Label((self.side / 2, -0.65), m.Words("to"), LETTERS)
        yield sc.Label((beside - widest - 0.23, self.side / 2), m.Words("from"), LETTERS, "end")

    def _spaced(self, room: float) -> range:
        steps = np.array((1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000))
        return range(0, len(self.place), int(steps[steps * self.cell >= room - 1e-9][0]))

    def starts(self) -> Iterator[sc.Item]:
        """Yield arrows to the rows in which episodes start, or dots where there is no room."""
        for code in self.machine.start:
            y = (self.place[code] + 0.5) * self.cell
            if self.cell > HEAD_ROOM:
                yield sc.Line(((self.right + 0.5, y), (self.right + 0.06, y)), arrow=True, color="muted")
            else:
                yield sc.Circle((self.right + 0.1, y), 0.05, "muted", None)
