"""A vector as bars or cells, and any state as a table with a line for each component."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.figures.marks import SIGNS, marked, sign
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Box, Color, Item, Label, Line, Scene, fitted, shifted, text_width
from taskspec.figures.values import State, at_states, expert_path, reads_of
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Node, Read
from taskspec.lang.types import Kind
from taskspec.printers import tree as m
from taskspec.task.task import Task

CELLS_UP_TO = 8
ROWS = 4
SEEDS = 6
LONGEST = 100
"""Steps of an episode that are followed, so that figures stay quick."""
MOST_BARS = 400
BELOW = 2.5
LETTERS = 0.28
_COLORS: dict[str, Color] = {"first": "accent", "second": "second", "good": "good", "bad": "bad"}


def bars(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the vector that the figure section names (or the only vector of the state).

    Of a short one every change that the expert makes, as swaps from row to row; of a long one the first state, and the
    last of the expert's episode where it has another order. Of a few episodes it is the one in which most happens.
    """
    node = _vector(task)
    if node is None:
        return None
    steps = min(LONGEST, LONGEST if task.horizon is None else task.horizon)
    here = overlay.here
    paths = [expert_path(task, steps, seed) for seed in range(SEEDS)] if here is None else [[dict(here)]]
    states, state = max(((_changes(task, node, path), path[0]) for path in paths), key=lambda found: len(found[0]))
    rows = [_row(task, node, each) for each in states]
    colors = [_colors(task, node, each) for each in states]
    alt = f"A state of {task.name} as {len(rows[0])}"
    if len(rows[0]) <= CELLS_UP_TO:
        drawn = list(zip(rows, colors, strict=True))
        shown = drawn if len(drawn) <= ROWS else [*drawn[: ROWS - 1], drawn[-1]]
        moves = "" if len(rows) == 1 else ", and how the expert changes it"
        return fitted(
            [*_cells(shown, len(rows) - len(shown)), *_sums(rows, colors[0], 1.0, 1.05)],
            f"{alt} cells{moves}",
            state=state,
        )
    items = [*_bars(rows[0], colors[0], None if here is None else _bound(node))]
    notes: tuple[str, ...] = ()
    if len(rows) > 1:
        items += [x for item in _bars(rows[-1], colors[-1]) for x in [shifted(item, 0.0, BELOW)]]
        notes = (f"Above a first state, below what the expert has made of it after {len(rows) - 1} changes.",)
    return fitted([*items, *_sums(rows, colors[0], _step(len(rows[0])), 0.35)], f"{alt} bars", notes, state=state)


def _row(task: Task, node: Node, state: State) -> Array:
    """Return the vector in a state."""
    found: Array = at_states(task, node, reads_of(task, state), 1)[0].astype(float)
    return found


def _changes(task: Task, node: Node, path: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the states of a path in which the vector has another value than in the one before."""
    rows = [_row(task, node, state) for state in path]
    return [state for i, state in enumerate(path) if i == 0 or not np.array_equal(rows[i], rows[i - 1])]


def _sums(rows: list[Array], colors: list[Color], step: float, y: float) -> Iterator[Label]:
    """Yield the sums of two parts with colours of their own, and how they compare."""
    parts = [[i for i, color in enumerate(colors) if color == role] for role in ("accent", "second")]
    if len(rows) > 1 or not all(parts):
        return
    with np.errstate(over="ignore"):
        first, second = (float(rows[0][part].sum()) for part in parts)
    if not math.isfinite(first) or not math.isfinite(second):
        return
    relation = "=" if first == second else "<" if first < second else ">"
    middles = [(min(part) + max(part) + 1) / 2 * step for part in parts]
    between = sum(middles) / 2
    texts = [m.Row((m.Words("sum "), m.Num(f"{x:.4g}".replace("-", "−")))) for x in (first, second)]
    if middles[1] - middles[0] < sum(text_width(t, LETTERS) for t in texts) / 2 + 0.6:
        middles = [between - 0.4 - text_width(texts[0], LETTERS) / 2, between + 0.4 + text_width(texts[1], LETTERS) / 2]
    for at, text in zip(middles, texts, strict=True):
        yield Label((at, y), text, LETTERS)
    yield Label((between, y), m.Sym(relation), LETTERS)


def _vector(task: Task) -> Node | None:
    """Return the vector that the figure names, else the first component of the state that is one."""
    if task.figure is not None and task.figure.values is not None:
        node = task.figure.values
        return node if len(node.type.shape) == 1 and node.type.size else None
    b = Builder()
    vectors = (b.read(*c.read, c.type, c.least, c.most) for c in task.state if len(c.type.shape) == 1 and c.type.size)
    return next(vectors, None)


def _colors(task: Task, node: Node, state: State) -> list[Color]:
    """Return the colours of elements: for a condition those for which it holds, for a slice those in it.

    The slice is taken of the vector's indices, and so says which elements are meant.
    """
    count = node.type.size
    colors: list[Color] = ["accent"] * count
    reads = reads_of(task, state)
    for name, part in ({} if task.figure is None else task.figure.highlight).items():
        if name not in _COLORS:
            continue
        if part.type.kind is Kind.BOOL and part.type.shape in ((), (count,)):
            holds = np.broadcast_to(at_states(task, part, reads, 1)[0], count)
            chosen = np.flatnonzero(holds)
        elif isinstance(node, Read) and len(part.type.shape) == 1 and part.type.kind in (node.type.kind, Kind.INT):
            own = {(node.role, node.name): np.arange(count, dtype=float)[:, None]}
            chosen = at_states(task, part, reads | own, 1)[0].astype(int)
        else:
            continue
        for i in chosen[(chosen >= 0) & (chosen < count)].tolist():
            colors[i] = _COLORS[name]
    return colors


def _bound(node: Node) -> float | None:
    """Return the largest size of an element, where it is known beforehand."""
    most = max(abs(node.low), abs(node.high)) if isinstance(node, Read) else math.inf
    return most if 0 < most < math.inf else None


def _bars(values: Array, colors: list[Color], most: float | None = None) -> Iterator[Item]:
    """Yield bars of equal width above a line, in a frame that `most` fills; of very many values means of neighbours."""
    values, colors = _binned(values, colors)
    step = _step(len(values))
    scale = 2.0 / (most or float(np.abs(values).max()) or 1.0)
    if most is not None:
        yield Box((0.0, -2.0), len(values) * step, 2.0, None, "faint")
    for i, (value, color) in enumerate(zip(values.tolist(), colors, strict=True)):
        top = -scale * max(value, 0.0)
        yield Box((i * step, top), step * 0.8, max(0.01, scale * abs(value)), color, None)
    for role, run in groupby(range(len(colors)), key=lambda i: colors[i]):
        places = list(run)
        if role in SIGNS:
            yield from sign(role, ((sum(places) / len(places) + 0.4) * step, 0.2), 0.2)
    yield Line(((-0.1, 0.0), (len(values) * step + 0.02, 0.0)), color="muted")


def _binned(values: Array, colors: list[Color]) -> tuple[Array, list[Color]]:
    """Return at most about `MOST_BARS` values: means of as many neighbours each, which share a colour."""
    size = -(-len(values) // MOST_BARS)
    runs = [list(run) for _, run in groupby(range(len(values)), key=lambda i: colors[i])]
    bins = [run[i : i + size] for run in runs for i in range(0, len(run), size)]
    return np.array([values[b].mean() for b in bins]), [colors[b[0]] for b in bins]


def _step(count: int) -> float:
    """Return how far bars lie apart."""
    return min(0.3, 7.0 / count)


def _cells(shown: list[tuple[Array, list[Color]]], left_out: int) -> Iterator[Item]:
    """Yield rows of cells, shaded by value, with arrows for elements that moved and dots for rows that are left out."""
    rows = [row for row, _ in shown]
    low = float(np.min(rows))
    high = float(np.max(rows))
    digits = 0 if all(np.array_equal(row, np.rint(row)) for row in rows) else 2
    for r, (row, colors) in enumerate(shown):
        for i, value in enumerate(row.tolist()):
            shade = 0.2 + 0.7 * (value - low) / ((high - low) or 1.0)
            box = Box((i * 1.0, r * 1.5), 1.0, 0.8, colors[i], "paper", shade=shade)
            yield box
            yield from marked(box, 0.3)
            yield Label((i + 0.5, r * 1.5 + 0.4), m.Num(f"{value:.{digits}f}".replace("-", "−")), LETTERS)
        if left_out and r + 2 == len(rows):
            yield Label((len(row) / 2, r * 1.5 + 1.15), m.Words("⋮"), 0.42)
        elif r + 1 < len(rows):
            for i, value in enumerate(row.tolist()):
                j = _where(rows[r + 1], value)
                if j is not None and j != i:
                    yield Line(((i + 0.5, r * 1.5 + 0.84), (j + 0.5, r * 1.5 + 1.46)), arrow=True)


def _where(row: Array, value: float) -> int | None:
    found = np.flatnonzero(row == value)
    return int(found[0]) if len(found) else None
