"""States that move: the plane of two numbers with its flow, and the links of an arm."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taskspec.exact.model.space import Space
from taskspec.figures.axes import HEIGHT, WIDTH, axes, plane
from taskspec.figures.overlay import Overlay
from taskspec.figures.scene import Circle, Item, Line, Point, Scene, fitted
from taskspec.figures.values import STEPS, at_states, expert_path, first_state, reads_of
from taskspec.lang import batch
from taskspec.lang.ir import Node, Read, draws
from taskspec.lang.ir import Role as Reading
from taskspec.printers.names import of_task
from taskspec.task.task import Task

ACROSS, DOWN = 11, 7
"""Arrows of a flow."""
LINK, REACH = 1.2, 6.0
"""Length of a link, and how far an arm may reach at most, in centimetres."""
MOST_LINKS = 30


def portrait(task: Task, overlay: Overlay) -> Scene | None:
    """The plane of two components of the state: where one step leads from everywhere, and an episode of the expert."""
    at = () if task.figure is None else task.figure.at
    known = {c.name: c for c in task.state}
    if len(at) != 2 or draws(task.next) or not all(isinstance(node, Read) and not node.type.shape for node in at):
        return None
    pair = [known[node.name] for node in at if isinstance(node, Read)]
    ends = [(float(min(c.low)), float(max(c.high))) for c in pair]
    to = plane(ends[0], ends[1])
    path = [dict(overlay.here)] if overlay.here is not None else expert_path(task, min(task.horizon or STEPS, STEPS))
    places = np.array([[float(state[c.name]) for c in pair] for state in path])
    if not (np.isfinite(places).all() and all(math.isfinite(high - low) for low, high in ends)):
        return None
    dots = [to((float(x), float(y))) for x, y in np.clip(places, *np.transpose(ends))]
    names = of_task(task)
    items: list[Item] = [*axes(*ends[0], *ends[1], to, [names.symbol(c.name) for c in pair])]
    items += _flow(task, [c.name for c in pair], ends, path[0])
    items += [Line(tuple(dots), color="accent", width=0.05)] if len(dots) > 1 else []
    items.append(Circle(dots[0], 0.09, "ink", None))
    told = f"Arrows: where a step leads with {_word(task)}, drawn longer than it is. Dot: a first state."
    notes = (told, "Line: an episode of the expert.") if len(dots) > 1 else (told,)
    return fitted(items, f"Phase portrait of {task.name}", notes, state=path[0])


def _neutral(task: Task) -> dict[Any, np.ndarray[Any, Any]]:
    """The action in the middle of those there are."""
    if all(c.is_finite for c in task.action):
        space = Space(task.action, Reading.ACTION)
        return dict(space.decode(np.array([space.size // 2])))
    middle = [(min(c.low) + max(c.high)) / 2 for c in task.action]
    values = [float(v) if math.isfinite(v) else 0.0 for v in middle]
    return {(Reading.ACTION, c.name): np.full((*c.type.shape, 1), v) for c, v in zip(task.action, values, strict=True)}


def _word(task: Task) -> str:
    """The name of that action."""
    if len(task.action) == 1 and task.action[0].domain is not None:
        labels = task.action[0].domain.labels
        return f"the action {labels[len(labels) // 2]}"
    return "the middle action"


def _flow(
    task: Task, pair: Sequence[str], ends: Sequence[tuple[float, float]], state: dict[str, Any]
) -> Iterator[Line]:
    """Arrows for one step from points of the plane, the longest as long as there is room."""
    xs, ys = (np.linspace(low, high, n + 2)[1:-1] for (low, high), n in zip(ends, (ACROSS, DOWN), strict=True))
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    reads = {key: np.repeat(v, len(points), axis=-1) for key, v in reads_of(task, state).items()}
    reads |= {(Reading.STATE, name): points[:, i] for i, name in enumerate(pair)}
    given = reads | _neutral(task) | {(Reading.TIME, "t"): np.zeros(1, dtype=np.int64)}
    after = dict(zip((c.name for c in task.state), batch.evaluate(task.next, given), strict=True))
    to = plane(ends[0], ends[1])
    targets = np.stack([np.broadcast_to(after[name], len(points)) for name in pair], axis=-1).astype(float)
    led = np.isfinite(targets).all(1)
    starts = [to((float(x), float(y))) for x, y in points[led]]
    ways = [to((float(x), float(y))) for x, y in targets[led]]
    moves = [(bx - ax, by - ay) for (ax, ay), (bx, by) in zip(starts, ways, strict=True)]
    longest = max((max(abs(dx) * ACROSS / WIDTH, abs(dy) * DOWN / HEIGHT) for dx, dy in moves), default=0.0) or 1.0
    for (x, y), (dx, dy) in zip(starts, moves, strict=True):
        if math.hypot(dx, dy) / longest > 0.03:
            yield Line(
                ((x, y), (x + 0.9 * dx / longest, y + 0.9 * dy / longest)), arrow=True, color="muted", width=0.02
            )


def arm(task: Task, overlay: Overlay) -> Scene | None:
    """Links in a chain, each at the angle (from hanging down) that `values` has for it, in a first state."""
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
    reach, joint = link * len(angles), min(0.11, 0.3 * link)
    items: list[Item] = [
        Circle((0.0, 0.0), reach, None, "faint"),
        Line(((0.0, 0.0), (0.0, reach)), color="faint", dashed=True),
    ]
    items.append(Line(tuple(points), color="accent", width=1.45 * joint))
    items += [Circle(p, joint, "paper") for p in points[:-1]] + [Circle(points[-1], joint, "ink")]
    notes = () if overlay.here is not None else ("A first state. The circle is how far the arm reaches.",)
    return fitted(items, f"{task.name} as an arm of {len(angles)} links", notes, state=state)
