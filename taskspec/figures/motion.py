"""States that move: the plane of two numbers with its flow, and the links of an arm."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taskspec.figures.chart import arrow_axes
from taskspec.figures.curve import HEIGHT, WIDTH, plane, runs, turn
from taskspec.figures.marks import sign
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Box, Circle, Color, Item, Line, Point, Scene, fitted
from taskspec.figures.values import STEPS, Reads, at_states, expert_path, first_state, reads_of
from taskspec.lang import batch
from taskspec.lang.ir import Node, Read, draws
from taskspec.lang.ir import Role as Reading
from taskspec.model.space import Space
from taskspec.printers.names import of_task
from taskspec.task.task import Task

ACROSS = 11
DOWN = 7
"""Arrows of a flow."""
WIDE = 100
HIGH = 60
SEAM = 0.01
SIGN = 0.26
"""Into how many parts the plane is cut to shade it, how far strips overlap, and the size of signs, in centimetres."""
SIGNED: dict[str, Color] = {"good": "good", "bad": "bad", "end": "end"}
LINK = 1.2
REACH = 6.0
"""Length of a link, and how far an arm may reach at most, in centimetres."""
MOST_LINKS = 30


def portrait(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the plane of two components of the state: where a step leads from everywhere, and an episode of the expert.

    What is highlighted is shaded, everything but the two components being as in the first state.
    """
    at = () if task.figure is None else task.figure.at
    known = {c.name: c for c in task.state}
    if len(at) != 2 or draws(task.next) or not all(isinstance(node, Read) and not node.type.shape for node in at):
        return None
    pair = [known[node.name] for node in at if isinstance(node, Read)]
    ends = [(float(min(c.low)), float(max(c.high))) for c in pair]
    plot = plane(ends[0], ends[1])
    path = [dict(overlay.here)] if overlay.here is not None else expert_path(task, min(task.horizon or STEPS, STEPS))
    places = np.array([[float(state[c.name]) for c in pair] for state in path])
    if not (np.isfinite(places).all() and all(math.isfinite(high - low) for low, high in ends)):
        return None
    dots = [plot.at(float(x), float(y)) for x, y in np.clip(places, *np.transpose(ends))]
    names = of_task(task)
    items: list[Item] = [*arrow_axes(plot, [names.symbol(c.name) for c in pair])]
    items[:0] = _shades(task, [c.name for c in pair], ends, path[0])
    items += _flow(task, [c.name for c in pair], ends, path[0])
    lines = (tuple(dots[run]) for run in runs(places.tolist(), [turn(task, node) for node in at]))
    items += [Line(line, color="accent", width=0.05) for line in lines if len(line) > 1]
    items.append(Circle(dots[0], 0.09, "ink", None))
    told = f"Arrows: where a step leads with {_word(task)}, drawn longer than it is. Dot: a first state."
    notes = (told, "Line: an episode of the expert.") if len(dots) > 1 else (told,)
    return fitted(items, f"Phase portrait of {task.name}", notes, state=path[0])


def _neutral(task: Task) -> dict[Any, np.ndarray[Any, Any]]:
    """Return the action in the middle of those there are."""
    if all(c.is_finite for c in task.action):
        space = Space(task.action, Reading.ACTION)
        return dict(space.decode(np.array([space.size // 2])))
    middle = [(min(c.low) + max(c.high)) / 2 for c in task.action]
    values = [float(v) if math.isfinite(v) else 0.0 for v in middle]
    return {(Reading.ACTION, c.name): np.full((*c.type.shape, 1), v) for c, v in zip(task.action, values, strict=True)}


def _word(task: Task) -> str:
    """Return the name of that action."""
    if len(task.action) == 1 and task.action[0].domain is not None:
        labels = task.action[0].domain.labels
        return f"the action {labels[len(labels) // 2]}"
    return "the middle action"


def _grid(ends: Sequence[tuple[float, float]], counts: tuple[int, int], edge: float = 1.0) -> np.ndarray[Any, Any]:
    """Return points of the plane (rows * columns, 2), row by row; the margin is `edge` times their distance."""
    shares = (np.arange(edge, n + edge) / (n - 1 + 2 * edge) for n in counts)
    xs, ys = (low + (high - low) * share for (low, high), share in zip(ends, shares, strict=True))
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)


def _reads(task: Task, pair: Sequence[str], points: np.ndarray[Any, Any], state: dict[str, Any]) -> Reads:
    """Return the states at points of the plane, in everything else like one state."""
    reads = {key: np.repeat(v, len(points), axis=-1) for key, v in reads_of(task, state).items()}
    return reads | {(Reading.STATE, name): points[:, i] for i, name in enumerate(pair)}


def _shades(
    task: Task, pair: Sequence[str], ends: Sequence[tuple[float, float]], state: dict[str, Any]
) -> Iterator[Item]:
    """Yield where the conditions of the figure section hold: strips in their colours, and a sign in the middle of them."""
    points = _grid(ends, (WIDE, HIGH), 0.5)
    plot = plane(ends[0], ends[1])
    reads = _reads(task, pair, points, state)
    width = WIDTH / WIDE
    height = HEIGHT / HIGH
    for name, node in ({} if task.figure is None else task.figure.highlight).items():
        if name not in SIGNED or node.type.shape:
            continue
        holds = at_states(task, node, reads, len(points)).astype(bool)
        spots = np.array([plot.at(float(x), float(y)) for x, y in points[holds]])
        for y in np.unique(spots[:, 1]) if len(spots) else ():
            row = np.sort(spots[spots[:, 1] == y, 0])
            for run in np.split(row, np.flatnonzero(np.diff(row) > 1.5 * width) + 1):
                corner = (float(run[0]) - width / 2, float(y) - height / 2)
                yield Box(corner, float(run[-1] - run[0]) + width, height + SEAM, SIGNED[name], None)
        if len(spots):
            x, y = spots[np.abs(spots - spots.mean(axis=0)).sum(axis=1).argmin()]
            yield from sign(SIGNED[name], (float(x), float(y)), SIGN)


def _flow(
    task: Task, pair: Sequence[str], ends: Sequence[tuple[float, float]], state: dict[str, Any]
) -> Iterator[Line]:
    """Yield arrows for one step from points of the plane, the longest as long as there is room."""
    points = _grid(ends, (ACROSS, DOWN))
    given = _reads(task, pair, points, state) | _neutral(task) | {(Reading.TIME, "t"): np.zeros(1, dtype=np.int64)}
    after = dict(zip((c.name for c in task.state), batch.evaluate(task.next, given), strict=True))
    plot = plane(ends[0], ends[1])
    targets = np.stack([np.broadcast_to(after[name], len(points)) for name in pair], axis=-1).astype(float)
    led = np.isfinite(targets).all(1)
    starts = [plot.at(float(x), float(y)) for x, y in points[led]]
    ways = [plot.at(float(x), float(y)) for x, y in targets[led]]
    moves = [(bx - ax, by - ay) for (ax, ay), (bx, by) in zip(starts, ways, strict=True)]
    longest = max((max(abs(dx) * ACROSS / WIDTH, abs(dy) * DOWN / HEIGHT) for dx, dy in moves), default=0.0) or 1.0
    for (x, y), (dx, dy) in zip(starts, moves, strict=True):
        if math.hypot(dx, dy) / longest > 0.03:
            yield Line(
                ((x, y), (x + 0.9 * dx / longest, y + 0.9 * dy / longest)), arrow=True, color="muted", width=0.02
            )


def arm(task: Task, overlay: Overlay) -> Scene | None:
    """Draw links in a chain, each at the angle (from hanging down) that `values` has for it, in a first state."""
    node: Node | None = None if task.figure is None else task.figure.values
    if node is None or len(node.type.shape) != 1 or not 1 <= node.type.size <= MOST_LINKS:
        return None
    state = overlay.here or first_state(task)
    angles = at_states(task, node, reads_of(task, state), 1)[0].astype(float).tolist()
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
        Line(((0.0, 0.0), (0.0, reach)), color="faint", dash="dashed"),
    ]
    items.append(Line(tuple(points), color="accent", width=1.45 * joint))
    items += [Circle(p, joint, "paper") for p in points[:-1]] + [Circle(points[-1], joint, "ink")]
    notes = () if overlay.here is not None else ("A first state. The circle is how far the arm reaches.",)
    return fitted(items, f"{task.name} as an arm of {len(angles)} links", notes, state=state)
