"""Planes of two numbers: a curve with a trajectory beside it, a phase portrait with its flow, and the links of an arm."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import starmap
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import plural
from taskspec.base.named import all_names
from taskspec.exact.model.space import Space
from taskspec.language.expressions import batch
from taskspec.language.expressions.types import TIME, Expression, Role
from taskspec.language.task.parts import are_finite
from taskspec.language.task.questions import component, is_random, period
from taskspec.language.task.task import Task
from taskspec.show.figures.board import central
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.shapes import ROLES, Box, Circle, Item, Label, Line, Point, Scene, fitted, sign, signed
from taskspec.show.figures.states import Reads, at_state, at_states, expert_path, figure_of, first_state, repeated
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import of_task

WIDTH = 5.0
HEIGHT = 3.0  # of the plane of a curve or a phase portrait, in centimetres
SAMPLES = 60
SEED = 8
MOST_DOTS = 40
ACROSS = 11
DOWN = 7  # arrows of a flow
WIDE = 100
HIGH = 60
SEAM = 0.01
SIGN = 0.26
"""Into how many parts the plane is cut to shade it, how far strips overlap, and the size of signs, in centimetres."""
LINK = 1.2
REACH = 6.0  # length of a link, and how far an arm may reach at most, in centimetres
MOST_LINKS = 30
GAP = 0.15
TICKS = 0.25
SYMBOL = 0.3
"""Of axes: their distance from the plane, and the sizes of numbers and symbols, in centimetres."""
SHORT = 4
"""Letters of a number that is short."""
MOST_TICKS = 6


# Axes.


@dataclass(frozen=True)
class Axes:
    """The plane of two numbers, `WIDTH` by `HEIGHT` centimetres from (0, 0); y points upwards. `x` and `y` are the ends."""

    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: float, y: float) -> Point:
        """Return the place of a point in the scene."""
        return WIDTH * _share(x, self.x), HEIGHT - HEIGHT * _share(y, self.y)

    def arrows(self, symbols: Sequence[m.Math]) -> Iterator[Item]:
        """Yield axes as arrows with numbers near their ends, and fine lines through zero."""
        if self.x[0] < 0 < self.x[1]:
            yield Line((self.at(0.0, self.y[0]), self.at(0.0, self.y[1])), color="faint", width=0.02)
        if self.y[0] < 0 < self.y[1]:
            yield Line((self.at(self.x[0], 0.0), self.at(self.x[1], 0.0)), color="faint", width=0.02)
        below = HEIGHT + GAP
        yield Line(((-GAP, below), (WIDTH + GAP, below)), arrow=True, color="muted", width=0.02)
        yield Line(((-GAP, below), (-GAP, -GAP)), arrow=True, color="muted", width=0.02)
        ends = ((WIDTH + GAP + 0.22, below), (-GAP, -GAP - 0.25))
        for symbol, place in zip(symbols, ends, strict=False):
            yield Label(place, symbol, SYMBOL)
        for x in _short_ends(self.x):
            yield Label((self.at(x, self.y[0])[0], below + 0.25), signed(x), TICKS, color="muted")
        for y in _short_ends(self.y):
            yield Label((-GAP - 0.1, self.at(self.x[0], y)[1]), signed(y), TICKS, "end", color="muted")


def _share(value: float, ends: tuple[float, float]) -> float:
    return (value - ends[0]) / ((ends[1] - ends[0]) or 1.0)


def are_short(ends: tuple[float, float]) -> bool:
    return max(len(f"{end:.6g}") for end in ends) <= SHORT


def _short_ends(ends: tuple[float, float]) -> Sequence[float]:
    if are_short(ends):
        return ends
    ticks = _round_numbers(*ends)
    return (ticks[0], ticks[-1])


def _round_numbers(low: float, high: float) -> list[float]:
    """Return multiples of 1, 2, 2.5 or 5 times a power of ten within a range, at most `MOST_TICKS` of them if there are two."""
    width = high - low
    if not 0 < width < math.inf:
        return [low]
    unit = 10.0 ** math.floor(math.log10(width / MOST_TICKS))
    for step in (factor * unit for factor in (1, 2, 2.5, 5, 10, 20)):
        first = math.ceil(low / step - 1e-9)
        last = math.floor(high / step + 1e-9)
        if last - first < MOST_TICKS:
            return [i * step for i in range(first, last + 1)]
    return [low, high]


# Figures.


def runs(points: Sequence[Sequence[float]], periods: Sequence[float]) -> Iterator[slice]:
    """Yield stretches of two points or more of a path, each without a step of a coordinate over more than half of its period."""
    breaks = [0]
    for i in range(1, len(points)):
        if any(abs(b - a) > most / 2 for a, b, most in zip(points[i - 1], points[i], periods, strict=True)):
            breaks.append(i)
    for first, last in zip(breaks, [*breaks[1:], len(points)], strict=True):
        if last - first > 1:
            yield slice(first, last)


def curve(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the curve of the figure section over its first coordinate, and an episode of the expert."""
    figure = figure_of(task)
    if figure.curve is None or len(figure.at) != 2:
        return None
    place, level = figure.at
    across = component(place)
    if across is None:
        return None
    steps = 20 if task.horizon is None else 100
    along = expert_path(task, steps, SEED)
    path = [_place(task, figure.at, state) for state in along]
    first = along[0]
    shown = path
    if overlay.here is not None:
        first = dict(overlay.here)
        shown = [_place(task, figure.at, first)]
    low, _ = min(path + shown)
    high, _ = max(path + shown)
    if high - low < 1e-9:
        xs = np.linspace(low - 0.5, high + 0.5, SAMPLES)
    else:
        xs = np.linspace(low - 0.1 * (high - low), high + 0.15 * (high - low), SAMPLES)
    reads = repeated(task, first, SAMPLES) | {(Role.STATE, across): xs}
    ys = at_states(task, figure.curve, reads, SAMPLES)
    line = list(zip(xs.tolist(), ys.tolist(), strict=True))
    heights = [y for _, y in line + path + shown]
    plot = Axes((float(xs[0]), float(xs[-1])), (min(heights), max(heights)))
    names = of_task(task)
    upwards: m.Math = m.Ident("y")
    up = component(level)
    if up is not None:
        upwards = names.symbol(up)
    items: list[Item] = [*plot.arrows([names.symbol(across), upwards])]
    items.append(Line(tuple(starmap(plot.at, line)), color="accent", width=0.07))
    dots = list(starmap(plot.at, shown))
    for run in runs(shown, [period(task, node) for node in figure.at]):
        items.append(Line(tuple(dots[run]), color="second", width=0.03))
    every = -(-len(dots) // MOST_DOTS)
    items += [Circle(dot, 0.05, "ink", None) for dot in dots[::every]]
    notes: tuple[str, ...] = ()
    if len(dots) > 1:
        items.append(Circle(dots[0], 0.1, None, "ink"))
        notes = ("Dots: an episode of the expert, from the ringed one on.",)
    return fitted(items, f"Curve of {task.name}, with the places of an episode marked on it", notes)


def _place(task: Task, at: Sequence[Expression], state: dict[str, Any]) -> Point:
    x, y = (float(at_state(task, node, state)) for node in at)
    return x, y


def portrait(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the plane of two components of the state: where a step leads from everywhere, and an episode of the expert.

    What is highlighted is shaded, everything but the two components being as in the first state.
    """
    at = figure_of(task).at
    scalars = {c.name: c for c in task.state if not c.type.shape}
    pair = [scalars[name] for name in map(component, at) if name in scalars]
    if len(pair) != 2 or len(at) != 2 or is_random(task.process.next):
        return None
    ends = [(float(min(c.low)), float(max(c.high))) for c in pair]
    if overlay.here is None:
        path = expert_path(task)
    else:
        path = [dict(overlay.here)]
    places = np.array([[state[c.name] for state in path] for c in pair], np.float64).T
    if not (np.isfinite(places).all() and all(math.isfinite(high - low) for low, high in ends)):
        return None
    plot = Axes(*ends)
    plane = _Plane(task, all_names(pair), plot, path[0])
    dots = list(starmap(plot.at, np.clip(places, *np.transpose(ends)).tolist()))
    names = of_task(task)
    symbols = list(map(names.symbol, plane.pair))
    items: list[Item] = [*plane.shades(), *plot.arrows(symbols), *plane.flow()]
    for run in runs(places.tolist(), [period(task, node) for node in at]):
        items.append(Line(tuple(dots[run]), color="accent", width=0.05))
    items.append(Circle(dots[0], 0.09, "ink", None))
    action = "the middle action"
    if len(task.action) == 1 and task.action[0].domain is not None:
        labels = task.action[0].domain.labels
        action = f"the action {labels[len(labels) // 2]}"
    notes: tuple[str, ...] = (
        f"Arrows: where a step leads with {action}, drawn longer than it is. Dot: a first state.",
    )
    if len(dots) > 1:
        notes += ("Line: an episode of the expert.",)
    return fitted(items, f"Phase portrait of {task.name}", notes)


def _spread(low: float, high: float, n: int, edge: float) -> Array:
    """Return n numbers (n,) at equal distances, with a margin of `edge` times their distance at both ends."""
    return low + (high - low) * np.arange(edge, n + edge) / (n - 1 + 2 * edge)


@dataclass(frozen=True)
class _Plane:
    """The plane of two components, whose names are `pair`; everything else is as in `state`."""

    task: Task
    pair: Sequence[str]
    plot: Axes
    state: dict[str, Any]

    def grid(self, columns: int, rows: int, edge: float = 1.0) -> tuple[Array, Reads]:
        """Return points (rows * columns, 2) with a margin of `edge` times their distance, row by row, and states there."""
        x = _spread(*self.plot.x, columns, edge)
        y = _spread(*self.plot.y, rows, edge)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        reads = repeated(self.task, self.state, len(points))
        for name, column in zip(self.pair, points.T, strict=True):
            reads[Role.STATE, name] = column
        return points, reads

    def shades(self) -> Iterator[Item]:
        """Yield where the conditions of the figure section hold: strips in their colours, and a sign in the middle of them."""
        points, reads = self.grid(WIDE, HIGH, 0.5)
        width = WIDTH / WIDE
        height = HEIGHT / HIGH
        for name, node in figure_of(self.task).highlight.items():
            if name not in ROLES or node.type.shape:
                continue
            holds = at_states(self.task, node, reads, len(points)).astype(bool)
            spots = list(starmap(self.plot.at, points[holds].tolist()))
            rows: dict[float, list[float]] = {}
            for x, y in spots:
                rows.setdefault(y, []).append(x)
            for y in sorted(rows):
                row = np.sort(rows[y])
                for run in np.split(row, np.flatnonzero(np.diff(row) > 1.5 * width) + 1):
                    corner = (float(run[0]) - width / 2, y - height / 2)
                    yield Box(corner, float(run[-1] - run[0]) + width, height + SEAM, ROLES[name], None)
            if spots:
                yield from sign(ROLES[name], central(spots), SIGN)

    def flow(self) -> Iterator[Line]:
        """Yield arrows for one step from points of the plane, the longest as long as there is room."""
        points, reads = self.grid(ACROSS, DOWN)
        reads |= _neutral(self.task) | {TIME: np.zeros(1, dtype=np.int64)}
        after = dict(zip(all_names(self.task.state), batch.evaluate(self.task.process.next, reads), strict=True))
        targets = np.stack([np.broadcast_to(after[name], len(points)) for name in self.pair], axis=-1).astype(float)
        led = np.isfinite(targets).all(1)
        starts = np.array(list(starmap(self.plot.at, points[led].tolist()))).reshape(-1, 2)
        ends = np.array(list(starmap(self.plot.at, targets[led].tolist()))).reshape(-1, 2)
        moves = ends - starts
        longest = (np.abs(moves) * (ACROSS / WIDTH, DOWN / HEIGHT)).max(initial=0.0) or 1.0
        tips = starts + 0.9 * moves / longest
        for i in np.flatnonzero(np.hypot(*moves.T) / longest > 0.03):
            line = (tuple(starts[i].tolist()), tuple(tips[i].tolist()))
            yield Line(line, arrow=True, color="muted", width=0.02)


def _neutral(task: Task) -> Reads:
    if are_finite(task.action):
        space = Space(task.action, Role.ACTION)
        return dict(space.decode(np.array([space.size // 2])))
    reads: Reads = {}
    for c in task.action:
        middle = (min(c.low) + max(c.high)) / 2
        if not math.isfinite(middle):
            middle = 0.0
        reads[Role.ACTION, c.name] = np.full((*c.type.shape, 1), middle)
    return reads


def arm(task: Task, overlay: Overlay) -> Scene | None:
    """Draw links in a chain, each at the angle (from hanging down) that `values` has for it, in a first state."""
    node = figure_of(task).values
    if node is None or len(node.type.shape) != 1 or not 1 <= node.type.size <= MOST_LINKS:
        return None
    state = overlay.here or first_state(task)
    angles = at_state(task, node, state).tolist()
    if not all(map(math.isfinite, angles)):
        return None
    link = min(LINK, REACH / len(angles))
    points: list[Point] = [(0.0, 0.0)]
    for angle in angles:
        x, y = points[-1]
        points.append((x + link * math.sin(angle), y + link * math.cos(angle)))
    reach = link * len(angles)
    joint = min(0.11, 0.3 * link)
    items: list[Item] = [
        Circle((0.0, 0.0), reach, None, "faint"),
        Line(((0.0, 0.0), (0.0, reach)), color="faint", is_dashed=True),
        Line(tuple(points), color="accent", width=1.45 * joint),
        *(Circle(p, joint, "paper") for p in points[:-1]),
        Circle(points[-1], joint, "ink"),
    ]
    notes: tuple[str, ...] = ()
    if overlay.here is None:
        notes = ("A first state. The circle is how far the arm reaches.",)
    return fitted(items, f"{task.name} as an arm of {plural(len(angles), 'link')}", notes)
