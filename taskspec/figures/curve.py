"""A curve and a trajectory beside it: axes, numbers at their ends, angles that wrap."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from taskspec.figures.marks import signed
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Circle, Item, Label, Line, Point, Scene, fitted
from taskspec.figures.values import State, at_states, expert_path, reads_of
from taskspec.lang import interval
from taskspec.lang.ir import Apply, Node, Read, Role, walk
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.task.task import Task

# ---------- axes
# Axes of plots: lines below and on the left, numbers at their ends, and a plane in which to draw.

WIDTH, HEIGHT = 5.0, 3.0
GAP, LETTERS, TICKS = 0.15, 0.3, 0.25
Range = tuple[float, float]


def plane(xs: Range, ys: Range) -> Callable[[Point], Point]:
    """Where points of a rectangle, y upwards, lie in a scene."""
    sx, sy = WIDTH / (xs[1] - xs[0] or 1.0), HEIGHT / (ys[1] - ys[0] or 1.0)
    return lambda p: ((p[0] - xs[0]) * sx, (ys[1] - p[1]) * sy)


def axes(
    x0: float, x1: float, y0: float, y1: float, to: Callable[[Point], Point], symbols: Sequence[m.Math]
) -> Iterator[Item]:
    """Axes below and on the left, with the numbers at their ends, and fine lines through zero."""
    (left, bottom), (right, top) = to((x0, y0)), to((x1, y1))
    for axis, (low, high) in enumerate(((x0, x1), (y0, y1))):
        if low < 0 < high:
            x, y = to((0.0, 0.0))
            yield Line(((x, bottom), (x, top)) if axis == 0 else ((left, y), (right, y)), color="faint", width=0.02)
    corner = (left - GAP, bottom + GAP)
    yield Line((corner, (right + GAP, bottom + GAP)), arrow=True, color="muted", width=0.02)
    yield Line((corner, (left - GAP, top - GAP)), arrow=True, color="muted", width=0.02)
    for symbol, place in zip(
        symbols, ((right + GAP + 0.22, bottom + GAP), (left - GAP, top - GAP - 0.25)), strict=False
    ):
        yield Label(place, symbol, LETTERS)
    for x in (x0, x1):
        yield Label((to((x, y0))[0], bottom + GAP + 0.25), signed(x), TICKS, color="muted")
    for y in (y0, y1):
        yield Label((left - GAP - 0.1, to((x0, y))[1]), signed(y), TICKS, "end", color="muted")


# ---------- wraps
# Numbers that come round: an angle kept within its bounds by a remainder jumps by its period, and is drawn in pieces.


def turn(task: Task, node: Node) -> float:
    """The largest step of a number that is drawn as a line: half the range of a component that a remainder keeps in it."""
    if isinstance(node, Read) and node.role is Role.STATE:
        later = next((after for c, after in zip(task.state, task.next, strict=True) if c.name == node.name), None)
        if later is not None and any(isinstance(x, Apply) and x.op == "mod" for x in walk([later])):
            low, high = interval.bounds(later, {})
            return (high - low) / 2 if math.isfinite(high - low) else math.inf
    return math.inf


def runs(points: Sequence[Sequence[float]], turns: Sequence[float]) -> Iterator[slice]:
    """Stretches of a path, each without a step of a coordinate that is more than its turn."""
    first = 0
    for i in range(1, len(points)):
        if any(abs(b - a) > most for a, b, most in zip(points[i - 1], points[i], turns, strict=True)):
            yield slice(first, i)
            first = i
    yield slice(first, len(points))


# ---------- curve
# A curve and a trajectory beside it, as a scene.

SAMPLES, SEED = 60, 8
MOST_DOTS = 40


def curve(task: Task, overlay: Overlay) -> Scene | None:
    """The curve of the figure section over the first place expression, and where an episode goes."""
    if task.figure is None or len(task.figure.at) != 2:
        return None
    (place, level), height = task.figure.at, task.figure.curve
    if not isinstance(place, Read) or height is None:
        return None
    here = overlay.here
    path = expert_path(task, min(task.horizon or 20, 100), SEED)
    state = path[0] if here is None else dict(here)
    along = [_point(task, place, level, s) for s in path]
    dots = along if here is None else [_point(task, place, level, state)]
    low, high = (pick(x for x, _ in (*along, *dots)) for pick in (min, max))
    low, high = (low - 0.5, high + 0.5) if high - low < 1e-9 else (low - 0.1 * (high - low), high + 0.15 * (high - low))
    xs = np.linspace(low, high, SAMPLES)
    reads = {k: np.repeat(v, SAMPLES, axis=-1) for k, v in reads_of(task, state).items()}
    ys = at_states(task, height, reads | {(Role.STATE, place.name): xs}, SAMPLES)
    names = of_task(task)
    symbols = [
        names.symbol(x.name) if isinstance(x, Read) else m.Ident(letter) for x, letter in ((place, "x"), (level, "y"))
    ]
    found = _draw(task, list(zip(xs.tolist(), ys.tolist(), strict=True)), along, dots, symbols)
    return replace(found, state=state)


def _point(task: Task, place: Node, level: Node, state: State) -> Point:
    """Where a state lies."""
    x, y = (float(at_states(task, node, reads_of(task, state), 1)[0]) for node in (place, level))
    return x, y


def _draw(task: Task, line: list[Point], along: list[Point], dots: list[Point], symbols: Sequence[m.Math]) -> Scene:
    turns = [turn(task, node) for node in (() if task.figure is None else task.figure.at)]
    xs = [x for x, _ in (*line, *along, *dots)]
    ys = [y for _, y in (*line, *along, *dots)]
    to = plane((min(xs), max(xs)), (min(ys), max(ys)))
    items: list[Item] = [*axes(min(xs), max(xs), min(ys), max(ys), to, symbols)]
    items.append(Line(tuple(map(to, line)), color="accent", width=0.07))
    for run in runs(dots, turns):
        if len(dots[run]) > 1:
            items.append(Line(tuple(map(to, dots[run])), color="second", width=0.03))
    every = -(-len(dots) // MOST_DOTS)
    items += [Circle(to(p), 0.05, "ink", None) for p in dots[::every]]
    if len(dots) > 1:
        items.append(Circle(to(dots[0]), 0.1, None, "ink"))
    alt = f"Curve of {task.name}, with the places of an episode marked on it"
    notes = ("Dots: an episode of the expert, from the ringed one on.",) if len(dots) > 1 else ()
    return fitted(items, alt, notes)
