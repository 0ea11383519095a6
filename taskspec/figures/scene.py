"""A figure as data: circles, boxes, lines, curves and labels in centimetres, and placeholders."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.model.space import Space
from taskspec.printers import tree as m
from taskspec.task.task import Task

# ---------- scene
# A figure as data: circles, boxes, lines, curves and labels, in centimetres, y downwards.
#
# Colours are roles, so that a page can show the same scene on light and dark paper.

BROAD = 1.15
"""How much wider labels may be in the broadest of the fonts that figures are shown in."""
Color = Literal["ink", "muted", "faint", "paper", "good", "bad", "end", "accent", "second"]
Point = tuple[float, float]
Anchor = Literal["start", "middle", "end"]


@dataclass(frozen=True, slots=True)
class Circle:
    centre: Point
    radius: float
    fill: Color | None = "paper"
    line: Color | None = "ink"
    shade: float = 1.0  # strength of the fill


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle by its upper left corner."""

    corner: Point
    width: float
    height: float
    fill: Color | None = "paper"
    line: Color | None = "ink"
    round: float = 0.0
    shade: float = 1.0


@dataclass(frozen=True, slots=True)
class Line:
    """A polyline, or with `curved` one cubic Bézier curve through four points; maybe with an arrow head."""

    points: tuple[Point, ...]
    arrow: bool = False
    curved: bool = False
    color: Color = "ink"
    width: float = 0.03
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Label:
    """Words or mathematics centred on a height; `size` is the height of the letters in centimetres."""

    at: Point
    text: m.Math
    size: float = 0.36
    anchor: Anchor = "middle"
    color: Color = "ink"
    halo: bool = False


Item = Circle | Box | Line | Label


@dataclass(frozen=True, slots=True)
class Scene:
    """Items from back to front, inside a frame; `alt` says in words what is to be seen.

    `state` is the one state of the task that is shown, or the first one of several; `focus` is where the present state of a
    frame is, which stays in sight where there is no room for all. `drawn` says of each result that may be laid over it how it
    is drawn; `{0}` in it stands for the scale.
    """

    width: float
    height: float
    items: tuple[Item, ...]
    alt: str
    notes: tuple[str, ...] = ()
    state: Mapping[str, Any] | None = field(default=None, compare=False)
    focus: Point | None = None
    drawn: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def caption(self) -> str:
        """What is seen, and what has to be known of it."""
        return " ".join((f"{self.alt}.", *self.notes))

    def shows(self, other: Scene | None) -> bool:
        """Whether another scene, maybe of a task of another name, looks the same."""
        return other is not None and (self.items, self.notes) == (other.items, other.notes)


def text_width(tree: m.Math, size: float = 0.36) -> float:
    """About how wide a label is."""
    return m.width(tree) * size * 0.62


def fitted(
    items: Iterable[Item],
    alt: str,
    notes: tuple[str, ...] = (),
    margin: float = 0.15,
    state: Mapping[str, Any] | None = None,
    focus: Point | None = None,
    drawn: Mapping[str, str] | None = None,
) -> Scene:
    """A scene just large enough for its items."""
    items = tuple(items)
    boxes = [_extent(item) for item in items] or [(0.0, 0.0, 1.0, 1.0)]
    left, top = min(b[0] for b in boxes) - margin, min(b[1] for b in boxes) - margin
    right, bottom = max(b[2] for b in boxes) + margin, max(b[3] for b in boxes) + margin
    moved = tuple(shifted(item, -left, -top) for item in items)
    seen = None if focus is None else (focus[0] - left, focus[1] - top)
    return Scene(right - left, bottom - top, moved, alt, notes, state, seen, drawn or {})


def extended(scene: Scene, more: Iterable[Item], alt: str | None = None) -> Scene:
    """The scene with more items."""
    items = (*scene.items, *more)
    return fitted(items, alt or scene.alt, scene.notes, state=scene.state, focus=scene.focus, drawn=scene.drawn)


def with_legend(scene: Scene, lines: Sequence[str]) -> Scene:
    """The scene with lines of words below it, on its left."""
    if not lines:
        return scene
    words = [
        Label((0.0, scene.height + 0.25 + 0.45 * i), m.Words(line), 0.26, "start", "muted")
        for i, line in enumerate(lines)
    ]
    return extended(scene, words, f"{scene.alt}; {'; '.join(lines)}")


def _extent(item: Item) -> tuple[float, float, float, float]:
    match item:
        case Circle(centre=(x, y), radius=r):
            return x - r, y - r, x + r, y + r
        case Box(corner=(x, y), width=w, height=h):
            return x, y, x + w, y + h
        case Line(points=points, curved=curved):
            xs, ys = zip(*(_samples(points) if curved else points), strict=True)
            return min(xs), min(ys), max(xs), max(ys)
        case Label(at=(x, y), text=text, size=size, anchor=anchor):
            w = BROAD * text_width(text, size)
            left = {"start": x, "middle": x - w / 2, "end": x - w}[anchor]
            return left, y - size * 0.7, left + w, y + size * 0.7


def shifted(item: Item, dx: float, dy: float) -> Item:
    match item:
        case Circle(centre=(x, y)):
            return replace(item, centre=(x + dx, y + dy))
        case Box(corner=(x, y)):
            return replace(item, corner=(x + dx, y + dy))
        case Line(points=points):
            return replace(item, points=tuple((x + dx, y + dy) for x, y in points))
        case Label(at=(x, y)):
            return replace(item, at=(x + dx, y + dy))


def bezier(points: tuple[Point, ...], t: float) -> Point:
    """A point of a cubic curve."""
    weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
    return sum(w * p[0] for w, p in zip(weights, points, strict=True)), sum(
        w * p[1] for w, p in zip(weights, points, strict=True)
    )


def _samples(points: tuple[Point, ...]) -> list[Point]:
    return [bezier(points, i / 8) for i in range(9)]


HEAD = 0.17


def head(line: Line) -> tuple[Point, Point, Point]:
    """The triangle at the end of an arrow."""
    (x0, y0), (x1, y1) = (bezier(line.points, 0.9) if line.curved else line.points[-2]), line.points[-1]
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    bx, by, half = x1 - HEAD * ux, y1 - HEAD * uy, HEAD * 0.36
    return (x1, y1), (bx - half * uy, by + half * ux), (bx + half * uy, by - half * ux)


def shaft(line: Line) -> tuple[Point, ...]:
    """The points of an arrow's line, short of its tip so that the tip stays sharp."""
    if not line.arrow:
        return line.points
    _, a, b = head(line)
    return (*line.points[:-1], ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2))


# ---------- stated
# What stands in the place of a figure that a spec asks for and that these parameters leave no room for.

WIDTH, LETTERS, LINE = 44, 0.3, 0.5


def not_drawn(task: Task, needed: str) -> Scene:
    """A frame with the size of the task and what a figure of its kind would need."""
    size = f"{_size(task, 'state')} and {_size(task, 'action')}"
    lines = [
        size,
        *textwrap.wrap(
            f"No {'' if task.figure is None else task.figure.kind} is drawn: {needed.replace('`', '')}", WIDTH
        ),
    ]
    words = [
        Label((0.0, LINE * i), m.Words(line), LETTERS, "start", "muted" if i else "ink") for i, line in enumerate(lines)
    ]
    inside = fitted(words, "", margin=0.3)
    frame = Box((0, 0), inside.width, inside.height, None, "faint", round=0.1)
    return fitted([frame, *inside.items], f"{task.name}: {size}, not drawn")


def _size(task: Task, what: str) -> str:
    """How many states or actions there are, or of how many numbers they are."""
    components, role = (task.state, Role.STATE) if what == "state" else (task.action, Role.ACTION)
    if all(c.type.kind is not Kind.REAL for c in components) and (what == "action" or task.is_finite):
        return f"{Space(components, role).size:,} {what}s"
    return f"{what}s of {int(sum(np.prod(c.type.shape, dtype=int) for c in components)):,} numbers"
