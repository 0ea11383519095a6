"""Figures as data, in centimetres, y downwards: circles, boxes, areas, lines and labels; and frames in place of missing figures.

Colours are roles, so that a page can show the same scene on light and dark paper; charts have colours of their own.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NewType, assert_never

import numpy as np

from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.model.space import Space
from taskspec.printers import tree as m
from taskspec.task.task import Task

BROAD = 1.15
"""How much wider labels may be in the broadest of the fonts that figures are shown in."""
Color = Literal["ink", "muted", "faint", "paper", "good", "bad", "end", "accent", "second"]
Hex = NewType("Hex", str)
"""A colour that is not a role, as `#0072b2`."""
Paint = Color | Hex
Point = tuple[float, float]
Anchor = Literal["start", "middle", "end"]
Dash = Literal["solid", "dashed", "dotted", "dashdot"]

COLORS: dict[str, str] = {
    "ink": "#1f2933", "muted": "#6b7785", "faint": "#c3cad2", "paper": "#ffffff", "good": "#b7e4bf", "bad": "#f3a6a0",
    "end": "#d5d9de", "accent": "#7aa7e0", "second": "#f2bd74",
}  # fmt: skip
"""Colours of roles on light paper."""


def hex_color(paint: Paint) -> str:
    """Return a colour as `#rrggbb`."""
    return COLORS.get(paint, paint)


@dataclass(frozen=True, slots=True)
class Circle:
    centre: Point
    radius: float
    fill: Paint | None = "paper"
    line: Paint | None = "ink"
    shade: float = 1.0  # opacity of the fill


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle by its upper left corner."""

    corner: Point
    width: float
    height: float
    fill: Paint | None = "paper"
    line: Paint | None = "ink"
    round: float = 0.0
    shade: float = 1.0


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon."""

    points: tuple[Point, ...]
    fill: Paint | None = "paper"
    line: Paint | None = None
    shade: float = 1.0


@dataclass(frozen=True, slots=True)
class Line:
    """A polyline, or with `curved` one cubic Bézier curve through four points; maybe with an arrow head."""

    points: tuple[Point, ...]
    arrow: bool = False
    curved: bool = False
    color: Paint = "ink"
    width: float = 0.03
    dash: Dash = "solid"
    shade: float = 1.0  # opacity


@dataclass(frozen=True, slots=True)
class Label:
    """Words or mathematics centred on a height; `size` is that of the font in centimetres, `angle` turns it left (degrees)."""

    at: Point
    text: m.Math
    size: float = 0.36
    anchor: Anchor = "middle"
    color: Paint = "ink"
    halo: bool = False
    angle: float = 0.0
    bold: bool = False


Item = Circle | Box | Area | Line | Label


@dataclass(frozen=True, slots=True)
class Scene:
    """Items from back to front, inside a frame; `alt` describes them in words.

    `state` is the one state of the task that is shown, or the first one of several; `focus` is where the present state of a
    frame is, which stays in sight if there is no room for all. `drawn` has for each part of an overlay a description of how it
    is drawn, in which `{0}` stands for the scale. Figures have a serif font, which suits mathematics; charts have none.
    """

    width: float
    height: float
    items: tuple[Item, ...]
    alt: str
    notes: tuple[str, ...] = ()
    state: Mapping[str, Any] | None = field(default=None, compare=False)
    focus: Point | None = None
    drawn: Mapping[str, str] = field(default_factory=dict, compare=False)
    font: Literal["serif", "sans"] = "serif"

    @property
    def caption(self) -> str:
        """The description and the notes."""
        return " ".join((f"{self.alt}.", *self.notes))

    def shows(self, other: Scene | None) -> bool:
        """Return whether another scene, maybe of a task with another name, looks the same."""
        return other is not None and (self.items, self.notes) == (other.items, other.notes)


def text_width(tree: m.Math, size: float = 0.36) -> float:
    """Return about how wide a label is, in centimetres."""
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
    """Return a scene just large enough for its items."""
    items = tuple(items)
    boxes = [_extent(item) for item in items] or [(0.0, 0.0, 1.0, 1.0)]
    left = min(b[0] for b in boxes) - margin
    top = min(b[1] for b in boxes) - margin
    right = max(b[2] for b in boxes) + margin
    bottom = max(b[3] for b in boxes) + margin
    moved = tuple(shifted(item, -left, -top) for item in items)
    seen = None if focus is None else (focus[0] - left, focus[1] - top)
    return Scene(right - left, bottom - top, moved, alt, notes, state, seen, drawn or {})


def extended(scene: Scene, more: Iterable[Item], alt: str | None = None) -> Scene:
    """Return the scene with more items."""
    items = (*scene.items, *more)
    return fitted(items, alt or scene.alt, scene.notes, state=scene.state, focus=scene.focus, drawn=scene.drawn)


def with_legend(scene: Scene, lines: Sequence[str]) -> Scene:
    """Return the scene with lines of words below it, on its left."""
    if not lines:
        return scene
    words = [
        Label((0.0, scene.height + 0.25 + 0.45 * i), m.Words(line), 0.26, "start", "muted")
        for i, line in enumerate(lines)
    ]
    return extended(scene, words, f"{scene.alt}; {'; '.join(lines)}")


def _extent(item: Item) -> tuple[float, float, float, float]:
    """Return left, top, right and bottom."""
    match item:
        case Circle(centre=(x, y), radius=r):
            return x - r, y - r, x + r, y + r
        case Box(corner=(x, y), width=w, height=h):
            return x, y, x + w, y + h
        case Line(points=points, curved=True):
            return _around([bezier(points, i / 8) for i in range(9)])
        case Line(points=points) | Area(points=points):
            return _around(points)
        case Label(at=(x, y), text=text, size=size, anchor=anchor, angle=angle):
            w = BROAD * text_width(text, size)
            left = {"start": 0.0, "middle": -w / 2, "end": -w}[anchor]
            half = size * 0.7
            if not angle:
                return x + left, y - half, x + left + w, y + half
            cos = math.cos(math.radians(angle))
            sin = math.sin(math.radians(angle))
            corners = [(a, b) for a in (left, left + w) for b in (-half, half)]
            return _around([(x + a * cos + b * sin, y - a * sin + b * cos) for a, b in corners])
        case _:
            assert_never(item)


def _around(points: Sequence[Point]) -> tuple[float, float, float, float]:
    xs, ys = zip(*points, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def shifted(item: Item, dx: float, dy: float) -> Item:
    match item:
        case Circle(centre=(x, y)):
            return replace(item, centre=(x + dx, y + dy))
        case Box(corner=(x, y)):
            return replace(item, corner=(x + dx, y + dy))
        case Line(points=points) | Area(points=points):
            return replace(item, points=tuple((x + dx, y + dy) for x, y in points))
        case Label(at=(x, y)):
            return replace(item, at=(x + dx, y + dy))
        case _:
            assert_never(item)


def bezier(points: tuple[Point, ...], t: float) -> Point:
    """Return the point of a cubic curve at t in [0, 1]."""
    weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
    x = sum(w * p[0] for w, p in zip(weights, points, strict=True))
    y = sum(w * p[1] for w, p in zip(weights, points, strict=True))
    return x, y


HEAD = 0.17


def head(line: Line) -> tuple[Point, Point, Point]:
    """Return the triangle at the end of an arrow."""
    (x0, y0), (x1, y1) = (bezier(line.points, 0.9) if line.curved else line.points[-2]), line.points[-1]
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    ux = (x1 - x0) / length
    uy = (y1 - y0) / length
    bx = x1 - HEAD * ux
    by = y1 - HEAD * uy
    half = HEAD * 0.36
    return (x1, y1), (bx - half * uy, by + half * ux), (bx + half * uy, by - half * ux)


def shaft(line: Line) -> tuple[Point, ...]:
    """Return the points of an arrow's line, short of its tip so that the tip stays sharp."""
    if not line.arrow:
        return line.points
    _, a, b = head(line)
    return (*line.points[:-1], ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2))


_FRAME_LETTERS = 44
_FRAME_FONT = 0.3
_FRAME_LINE = 0.5


def not_drawn(task: Task, needs: str) -> Scene:
    """Return the frame in place of a figure that does not fit: the size of the task and what a figure of its kind needs."""
    size = f"{_count(task, 'state')} and {_count(task, 'action')}"
    kind = "" if task.figure is None else task.figure.kind
    reason = f"No {kind} is drawn: {needs.replace('`', '')}"
    lines = [size, *textwrap.wrap(reason, _FRAME_LETTERS)]
    words = [
        Label((0.0, _FRAME_LINE * i), m.Words(line), _FRAME_FONT, "start", "muted" if i else "ink")
        for i, line in enumerate(lines)
    ]
    inside = fitted(words, "", margin=0.3)
    frame = Box((0, 0), inside.width, inside.height, None, "faint", round=0.1)
    return fitted([frame, *inside.items], f"{task.name}: {size}, not drawn")


def _count(task: Task, what: str) -> str:
    """Return how many states or actions there are, or how many numbers one has: `48 states`, `states of 4 numbers`."""
    components, role = (task.state, Role.STATE) if what == "state" else (task.action, Role.ACTION)
    if all(c.type.kind is not Kind.REAL for c in components) and (what == "action" or task.is_finite):
        return f"{Space(components, role).size:,} {what}s"
    return f"{what}s of {int(sum(np.prod(c.type.shape, dtype=int) for c in components)):,} numbers"
