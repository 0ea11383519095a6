"""A vector as bars, or as cells with the moves of their elements; a matrix as a board."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.display import fixed, plural
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.types import Expression, Kind, Role
from taskspec.language.task.questions import component, elements
from taskspec.language.task.task import Task
from taskspec.show.figures import shapes as sc
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.series import MOST as FOLLOWED
from taskspec.show.figures.series import series
from taskspec.show.figures.states import State, at_state, at_states, episode_path, expert_path, figure_of, reads_of
from taskspec.show.printers import tree as m

CELLS_UP_TO = 8
ROWS = 4
SEEDS = 6
LONGEST = 100  # steps of an episode that are followed, so that figures stay quick
MOST_BARS = 400
BELOW = 2.5
LETTERS = 0.28
SQUARE = 0.8  # side of a cell of a board
MOST_SQUARES = 24  # rows or columns of a board
FEW_STEPS = 3


@dataclass(frozen=True)
class _Row:
    """The vector at a time of an episode, with a colour for each element."""

    t: int
    values: Array
    colors: list[sc.Color]


def bars(task: Task, overlay: Overlay) -> sc.Scene | None:
    """Draw the vector that the figure section names (or the only vector of the state).

    Of a short one the changes of an episode, row by row; of a long one the first state and the last one. Of a few episodes
    it is the one in which most happens. Of a matrix the first state, as a board; a few numbers that are written one by one
    are drawn over time.
    """
    node = _vector(task)
    if node is None or (len(node.type.shape) == 2 and max(node.type.shape) > MOST_SQUARES):
        return None
    if elements(node) is not None and len(node.type.shape) == 1 and node.type.size <= FOLLOWED:
        return series(task, overlay)
    changes, whose = _episode(task, node, overlay)
    rows: list[_Row] = []
    for t, state in changes:
        rows.append(_Row(t, at_state(task, node, state), _colors(task, node, state)))
    if len(node.type.shape) == 2:
        return _board(task, node, rows[0].values, overlay.here is not None)
    alt = f"A state of {task.name} as"
    if node.type.size <= CELLS_UP_TO:
        items = [*_cells(rows)]
        alt = f"{alt} {plural(node.type.size, 'cell')}"
        if len(rows) > 1:
            return sc.fitted(items, f"{alt}, and its changes in an episode of {whose}")
        return sc.fitted([*items, *_sums(rows[0], 1.0, 1.05)], alt)
    alt = f"{alt} {node.type.size} bars"
    first = rows[0]
    last = rows[-1]
    after = f"after {plural(last.t, 'step')} of {whose}"
    if overlay.here is not None:
        items = [*_bars(first, _bound(node)), *_bar_sums(first)]
        return sc.fitted(items, alt)
    if len(rows) > 1 and first.values.any():
        items = [*_bars(first), *sc.moved(_bars(last), 0.0, BELOW)]
        return sc.fitted(items, alt, (f"Above a first state, below the one {after}.",))
    notes: tuple[str, ...] = ()
    if len(rows) > 1:
        notes = (f"The state {after}.",)
    return sc.fitted([*_bars(last), *_bar_sums(last)], alt, notes)


def _bar_sums(row: _Row) -> Iterator[sc.Label]:
    yield from _sums(row, _step(len(row.values)), 0.35)


def _episode(task: Task, node: Expression, overlay: Overlay) -> tuple[list[tuple[int, dict[str, Any]]], str]:
    if overlay.here is not None:
        return [(0, dict(overlay.here))], ""
    episodes = [_changes(task, node, expert_path(task, LONGEST, seed)) for seed in range(SEEDS)]
    whose = "the expert"
    if max(map(len, episodes)) == 1:
        path, whose = episode_path(task, LONGEST)
        episodes.append(_changes(task, node, path))
    # of episodes in which nothing changes, the one whose numbers differ most
    return max(episodes, key=lambda each: (len(each), len(set(at_state(task, node, each[0][1]).flat)))), whose


def _changes(task: Task, node: Expression, path: list[dict[str, Any]]) -> list[tuple[int, dict[str, Any]]]:
    changes: list[tuple[int, dict[str, Any]]] = []
    before = None
    for t, state in enumerate(path):
        row = at_state(task, node, state)
        if before is None or not np.array_equal(row, before):
            changes.append((t, state))
        before = row
    return changes


def _sums(row: _Row, step: float, y: float) -> Iterator[sc.Label]:
    """Yield the sums of the elements of both colours, and which of them is larger."""
    totals: list[float] = []
    middles: list[float] = []
    texts: list[m.Math] = []
    halves: list[float] = []
    for color in ("accent", "second"):
        part = np.flatnonzero(np.array(row.colors) == color)
        if not part.size:
            return
        with np.errstate(over="ignore"):
            total = float(row.values[part].sum())
        text = m.Row((m.Words("sum "), sc.signed(total)))
        totals.append(total)
        middles.append(float(part[0] + part[-1] + 1) / 2 * step)
        texts.append(text)
        halves.append(sc.text_width(text, LETTERS) / 2)
    if not math.isfinite(sum(map(abs, totals))):
        return
    relation = ("=", ">", "<")[int(np.sign(totals[0] - totals[1]))]
    between = sum(middles) / 2
    if middles[1] - middles[0] < sum(halves) + 0.6:
        middles = [between - 0.4 - halves[0], between + 0.4 + halves[1]]
    for at, words in zip(middles, texts, strict=True):
        yield sc.Label((at, y), words, LETTERS)
    yield sc.Label((between, y), m.Sym(relation), LETTERS)


def _vector(task: Task) -> Expression | None:
    nodes = [c.value for c in task.state]
    values = figure_of(task).values
    if values is not None:
        nodes = [values]
    return next((node for node in nodes if node.type.shape and node.type.size), None)


def _colors(task: Task, node: Expression, state: State) -> list[sc.Color]:
    """Return the colours of elements: for a condition those for which it holds, for a slice those in it.

    The slice is taken of the vector's indices, and so says which elements are meant.
    """
    count = node.type.size
    colors: list[sc.Color] = ["accent"] * count
    reads = reads_of(task, state)
    own = component(node)
    for name, part in figure_of(task).highlight.items():
        if name not in sc.HIGHLIGHTS:
            continue
        if part.type.kind is Kind.BOOL and part.type.shape in ((), (count,)):
            chosen = np.flatnonzero(np.broadcast_to(at_states(task, part, reads)[0], count))
        elif own is not None and len(part.type.shape) == 1 and part.type.kind in (node.type.kind, Kind.INT):
            indices = {(Role.STATE, own): np.arange(count, dtype=float)[:, None]}
            chosen = at_states(task, part, reads | indices)[0].astype(int)
        else:
            continue
        for i in chosen[(chosen >= 0) & (chosen < count)].tolist():
            colors[i] = sc.HIGHLIGHTS[name]
    return colors


def _bound(node: Expression) -> float | None:
    if component(node) is None:
        return None
    most = max(map(abs, bounds(node, {})))
    if 0 < most < math.inf:
        return most
    return None


def _bars(row: _Row, most: float | None = None) -> Iterator[sc.Item]:
    """Yield bars of equal width above a line, in a frame that `most` fills; of very many values every second, third and so on."""
    every = -(-len(row.values) // MOST_BARS)
    values = row.values[::every]
    colors = row.colors[::every]
    step = _step(len(values))
    scale = 2.0 / (most or float(np.abs(values).max()) or 1.0)
    if most is not None:
        yield sc.Box((0.0, -2.0), len(values) * step, 2.0, None, "faint")
    for i, (value, color) in enumerate(zip(values.tolist(), colors, strict=True)):
        top = -scale * max(value, 0.0)
        yield sc.Box((i * step, top), step * 0.8, max(0.01, scale * abs(value)), color, None)
    for role, run in groupby(range(len(colors)), key=colors.__getitem__):
        places = list(run)
        if role in sc.SIGNS:
            yield from sc.sign(role, ((sum(places) / len(places) + 0.4) * step, 0.2), 0.2)
    yield sc.Line(((-0.1, 0.0), (len(values) * step + 0.02, 0.0)), color="muted")


def _board(task: Task, node: Expression, values: Array, is_frame: bool) -> sc.Scene:
    """Return a matrix as a board, its signs in two colours; in place of an empty first state, one after a few steps."""
    notes: tuple[str, ...] = ()
    if not values.any() and not is_frame:
        path, whose = episode_path(task, FEW_STEPS)
        values = at_state(task, node, path[-1])
        notes = (f"A state after {len(path) - 1} steps of {whose}.",)
    height, width = node.type.shape
    most = float(np.abs(values).max()) or 1.0
    digits = 0 if np.array_equal(values, np.rint(values)) else 2
    items: list[sc.Item] = []
    for (row, column), value in np.ndenumerate(values):
        cell = sc.Box((column * SQUARE, row * SQUARE), SQUARE, SQUARE, "paper", "faint")
        items.append(cell)
        if value:
            color: sc.Color = "second" if value < 0 else "accent"
            items.append(replace(cell, fill=color, shade=0.3 + 0.6 * abs(value) / most))
        if value and node.type.kind is not Kind.BOOL:
            middle = ((column + 0.5) * SQUARE, (row + 0.5) * SQUARE)
            items.append(sc.Label(middle, m.Num(fixed(value, digits)), LETTERS))
    items.append(sc.Box((0, 0), width * SQUARE, height * SQUARE, None, "ink"))
    return sc.fitted(items, f"A state of {task.name} as a board of {height} rows and {width} columns", notes)


def _step(count: int) -> float:
    return min(0.3, 7.0 / count)


def _cells(all_rows: list[_Row]) -> Iterator[sc.Item]:
    """Yield rows of cells, shaded by value, with dots for rows that are left out.

    Where a row has the elements of the one before in another order, arrows say where they went; else times are beside them.
    """
    shown = list(all_rows)
    if len(shown) > ROWS:
        shown[ROWS - 1 : -1] = []
    left_out = len(shown) < len(all_rows)
    rows = [row.values for row in shown]
    moved = all(np.array_equal(np.unique(row), np.sort(rows[0])) for row in rows)
    tops = np.arange(len(rows), dtype=float)
    if moved:
        tops *= 1.5
    elif left_out:
        tops[-1] += 0.6
    low = float(np.min(rows))
    high = float(np.max(rows))
    digits = 0 if np.array_equal(rows, np.rint(rows)) else 2
    for r, row in enumerate(rows):
        top = float(tops[r])
        if len(rows) > 1 and not moved:
            time = m.equal(m.Ident("t"), m.Num(str(shown[r].t)))
            yield sc.Label((-0.2, top + 0.4), time, LETTERS, "end", "muted")
        for i, value in enumerate(row.tolist()):
            shade = 0.2 + 0.7 * (value - low) / ((high - low) or 1.0)
            box = sc.Box((i * 1.0, top), 1.0, 0.8, shown[r].colors[i], "paper", shade=shade)
            yield box
            yield from sc.marked(box, True)
            yield sc.Label((i + 0.5, top + 0.4), m.Num(fixed(value, digits)), LETTERS)
        if left_out and r + 2 == len(rows):
            yield sc.Label((len(row) / 2, float(top + tops[r + 1]) / 2 + 0.4), m.Words("⋮"), 0.42)
        elif r + 1 < len(rows) and moved:
            yield from _moves(row, rows[r + 1], top)


def _moves(row: Array, after: Array, top: float) -> Iterator[sc.Line]:
    for i, value in enumerate(row.tolist()):
        j = int(np.flatnonzero(after == value)[0])
        if j != i:
            yield sc.Line(((i + 0.5, top + 0.84), (j + 0.5, top + 1.46)), arrow=True)
