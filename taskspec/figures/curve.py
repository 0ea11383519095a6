"""A curve and a trajectory beside it: axes, numbers at their ends, angles that wrap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import starmap

import numpy as np

from taskspec.figures.chart import Axes, Scale, arrow_axes
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Circle, Item, Line, Point, Scene, fitted
from taskspec.figures.values import State, at_states, expert_path, reads_of
from taskspec.lang import interval
from taskspec.lang.ir import Apply, Node, Read, Role, walk
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.task.task import Task

WIDTH = 5.0
HEIGHT = 3.0
"""Of the plane of a curve or a phase portrait, in centimetres."""


def plane(xs: tuple[float, float], ys: tuple[float, float]) -> Axes:
    """Return the plane of two ranges."""
    return Axes(0.0, 0.0, WIDTH, HEIGHT, Scale(*xs), Scale(*ys))


def turn(task: Task, node: Node) -> float:
    """Return the largest step of a number that is drawn as a line: half the range of a component that a remainder keeps in it."""
    if isinstance(node, Read) and node.role is Role.STATE:
        later = next((after for c, after in zip(task.state, task.next, strict=True) if c.name == node.name), None)
        if later is not None and any(isinstance(x, Apply) and x.op == "mod" for x in walk([later])):
            low, high = interval.bounds(later, {})
            return (high - low) / 2 if math.isfinite(high - low) else math.inf
    return math.inf


def runs(points: Sequence[Sequence[float]], turns: Sequence[float]) -> Iterator[slice]:
    """Yield stretches of a path, each without a step of a coordinate that is more than its turn."""
    first = 0
    for i in range(1, len(points)):
        if any(abs(b - a) > most for a, b, most in zip(points[i - 1], points[i], turns, strict=True)):
            yield slice(first, i)
            first = i
    yield slice(first, len(points))


SAMPLES = 60
SEED = 8
MOST_DOTS = 40


def curve(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the curve of the figure section over its first coordinate, and an episode of the expert."""
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
    """Return where a state lies."""
    x, y = (float(at_states(task, node, reads_of(task, state), 1)[0]) for node in (place, level))
    return x, y


def _draw(task: Task, line: list[Point], along: list[Point], dots: list[Point], symbols: Sequence[m.Math]) -> Scene:
    turns = [turn(task, node) for node in (() if task.figure is None else task.figure.at)]
    xs = [x for x, _ in (*line, *along, *dots)]
    ys = [y for _, y in (*line, *along, *dots)]
    plot = plane((min(xs), max(xs)), (min(ys), max(ys)))
    items: list[Item] = [*arrow_axes(plot, symbols)]
    items.append(Line(tuple(starmap(plot.at, line)), color="accent", width=0.07))
    for run in runs(dots, turns):
        if len(dots[run]) > 1:
            items.append(Line(tuple(starmap(plot.at, dots[run])), color="second", width=0.03))
    every = -(-len(dots) // MOST_DOTS)
    items += [Circle(plot.at(*p), 0.05, "ink", None) for p in dots[::every]]
    if len(dots) > 1:
        items.append(Circle(plot.at(*dots[0]), 0.1, None, "ink"))
    alt = f"Curve of {task.name}, with the places of an episode marked on it"
    notes = ("Dots: an episode of the expert, from the ringed one on.",) if len(dots) > 1 else ()
    return fitted(items, alt, notes)
