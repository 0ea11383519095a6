"""Numbers over time: an episode of the expert, or the steps so far of one that is being watched."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskspec.base.display import plural
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.types import Expression
from taskspec.language.task.parts import Component
from taskspec.language.task.questions import component, constant, elements, period
from taskspec.language.task.task import Task
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.plane import GAP, SYMBOL, TICKS, WIDTH, are_short, runs
from taskspec.show.figures.shapes import Box, Circle, Item, Label, Line, Scene, fitted, signed
from taskspec.show.figures.states import STEPS, State, at_state, episode_path, figure_of
from taskspec.show.printers import tree as m
from taskspec.show.printers.expressions import mathematics
from taskspec.show.printers.names import expression, of_task
from taskspec.show.printers.pieces import indexed

MOST = 6  # numbers that are followed
FEW_STEPS = 12  # each is marked
SHORT = 4
SEEDS = 8  # of an episode of as few states, the longest one of several is shown
PANEL = 1.0  # height of the picture of one, in centimetres
APART = 1.35  # distance of these pictures
BEFORE = 1.2
AFTER = 2.8
"""Room for numbers on the left, and for what is equal to one on the right, so that all frames of an episode are alike."""


@dataclass(frozen=True)
class _Number:
    """A number to follow: its symbol, its values, the bounds that the spec has for it, and the range that it goes around."""

    symbol: m.Math
    values: Sequence[float]
    ends: tuple[float, float]
    period: float = math.inf


def series(task: Task, overlay: Overlay) -> Scene | None:
    """Draw components of the state (or the elements of `values`) over an episode, or the present one so far."""
    if overlay.here is not None:
        return _so_far(task, overlay.seen)
    if not any(map(_is_followed, task.state)) and task.annotations.figure is None:
        return None
    path, whose = episode_path(task)
    if len(path) <= SHORT:
        episodes = [episode_path(task, seed=seed) for seed in range(SEEDS)]
        path, whose = max(episodes, key=lambda each: len(each[0]))
    steps = len(path) - 1
    numbers = _measured(task, path) if steps > 0 else []
    if task.annotations.figure is None:
        numbers = [x for x in numbers if len(set(x.values)) > 1]
    if not _is_finite(numbers):
        return None
    items: list[Item] = []
    for i, number in enumerate(numbers[:MOST]):
        ends = _wide(min(number.values), max(number.values))
        if len(set(number.values)) == 1:
            ends = _scale(number)
        items += _panel(number, number.symbol, ends, steps, i * APART, range(len(path)))
    items += _time(0, steps, len(numbers[:MOST]))
    return fitted(items, f"An episode of {whose} in {task.name} over time, {plural(steps, 'step')}")


def _so_far(task: Task, seen: Mapping[int, State]) -> Scene | None:
    """Draw numbers up to the present, on axes that stay: the window moves by whole pages."""
    if not seen:
        return None
    now = max(seen)
    span = min(task.horizon or STEPS, STEPS)
    first = max(0, now - 1) // span * span
    times = [t for t in sorted(seen) if t >= first]
    numbers = _measured(task, [seen[t] for t in times])[:MOST]
    if not _is_finite(numbers):
        return None
    items: list[Item] = [*_time(first, first + span, len(numbers))]
    points = [t - first for t in times]
    for i, number in enumerate(numbers):
        label = m.equal(number.symbol, signed(number.values[-1]))
        items += _panel(number, label, _scale(number), span, i * APART, points, is_frame=True)
    items.append(Box((-BEFORE, 0.0), BEFORE + WIDTH + AFTER, PANEL, None, None))
    return fitted(items, f"{task.name} over time, {plural(now, 'step')}")


def _is_finite(numbers: Sequence[_Number]) -> bool:
    return bool(numbers) and all(math.isfinite(max(x.values) - min(x.values)) for x in numbers)


def _scale(number: _Number) -> tuple[float, float]:
    """Return the bounds of a number; if it has none, round numbers around its values, symmetric around 0."""
    low, high = number.ends
    if not math.isfinite(high - low):
        size = max(map(abs, number.values)) or 1.0
        if 1e-300 < size < 1e300:  # the next one of 1, 2, 5 times a power of ten
            unit = 10.0 ** math.floor(math.log10(size))
            size = min(filter(size.__le__, (unit, 2 * unit, 5 * unit)), default=10 * unit)
        low = -size * (low < 0)
        high = size * (high > 0)
    return _wide(low, high)


def _wide(low: float, high: float) -> tuple[float, float]:
    """Return the ends of an axis: round numbers in place of long ones, and room around a single value."""
    if low == high:
        return low - 0.5, high + 0.5
    if are_short((low, high)):
        return low, high
    unit = 10.0 ** math.floor(math.log10((high - low) / 2)) / 2
    digits = max(0, -math.floor(math.log10(unit)))
    return round(math.floor(low / unit) * unit, digits), round(math.ceil(high / unit) * unit, digits)


def _panel(
    number: _Number,
    label: m.Math,
    ends: tuple[float, float],
    span: int,
    top: float,
    times: Sequence[int],
    is_frame: bool = False,
) -> Iterator[Item]:
    """Yield one number over time, on a scale of its own; a frame has a dot at the present."""
    low, high = ends
    points = []
    for t, value in zip(times, number.values, strict=True):
        points.append((WIDTH * t / span, top + PANEL * (high - value) / (high - low)))
    yield Box((0.0, top), WIDTH, PANEL, None, "faint")
    for run in runs(list(zip(number.values, strict=True)), (number.period,)):
        yield Line(tuple(points[run]), color="accent", width=0.05)
    if len(points) <= FEW_STEPS and not is_frame:
        for point in points:
            yield Circle(point, 0.06, "accent", None)
    if is_frame:
        yield Circle(points[-1], 0.08, "ink", None)
    yield Label((WIDTH + 0.2, top + PANEL / 2), label, SYMBOL, "start")
    for value, y in ((high, top), (low, top + PANEL)):
        yield Label((-0.15, y), signed(value), TICKS, "end", color="muted")


def _time(first: int, last: int, panels: int) -> Iterator[Item]:
    y = PANEL + (panels - 1) * APART + GAP
    yield Line(((0.0, y), (WIDTH + GAP, y)), arrow=True, color="muted", width=0.02)
    yield Label((WIDTH + GAP + 0.22, y), m.Ident("t"), SYMBOL)
    for x, t in ((0.0, first), (WIDTH, last)):
        yield Label((x, y + 0.25), m.Num(str(t)), TICKS, color="muted")


def _is_followed(c: Component) -> bool:
    return c.domain is None and c.type.size <= MOST


def _measured(task: Task, path: Sequence[State]) -> list[_Number]:
    node = figure_of(task).values
    numbers = []
    if node is None:
        names = of_task(task)
        for c in filter(_is_followed, task.state):
            rows = np.array([state[c.name] for state in path], dtype=float).reshape(len(path), -1)
            around = period(task, c.value) if c.type.is_scalar else math.inf
            for i in range(c.type.size):
                symbol = names.symbol(c.name)
                if not c.type.is_scalar:
                    symbol = indexed(symbol, m.Num(str(i)))
                numbers.append(_Number(symbol, rows[:, i].tolist(), (float(c.low[i]), float(c.high[i])), around))
        return numbers
    rows = np.array([at_state(task, node, state).reshape(-1) for state in path])
    parts = elements(node) or (node,) * node.type.size
    for i, (symbol, part) in enumerate(zip(_symbols(task, node)[:MOST], parts, strict=False)):
        if constant(part) is not None:  # a parameter beside the numbers that change
            continue
        numbers.append(_Number(symbol, rows[:, i].tolist(), bounds(part, {}), period(task, part)))
    return numbers


def _symbols(task: Task, node: Expression) -> list[m.Math]:
    names = of_task(task)
    whole = expression("v")
    if task.spec.figure is not None and task.spec.figure.values is not None:
        whole = expression(task.spec.figure.values)
    if isinstance(whole, s.Vector) and len(whole.items) == node.type.size:
        return [mathematics(item, names) for item in whole.items]
    base = mathematics(whole, names)
    if not node.type.shape:
        return [base]
    if component(node) is None:
        base = m.brackets(base)
    return [m.Script(base, sub=m.Num(str(i))) for i in range(node.type.size)]
