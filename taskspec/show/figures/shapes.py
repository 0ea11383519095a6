"""Figures as data, in centimetres, y downwards: circles, boxes, areas, lines and labels; signs of roles and their key."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import mul
from typing import Literal, assert_never

from taskspec.base.display import number, small_fraction
from taskspec.show.printers import tree as m

BROAD = 1.15  # how much wider labels may be in the broadest of the fonts that figures are shown in
Color = Literal["ink", "muted", "faint", "paper", "good", "bad", "end", "accent", "second"]
Point = tuple[float, float]
Anchor = Literal["start", "middle", "end"]

COLORS: dict[Color, str] = {
    "ink": "#1f2933", "muted": "#6b7785", "faint": "#c3cad2", "paper": "#ffffff", "good": "#b7e4bf", "bad": "#f3a6a0",
    "end": "#d5d9de", "accent": "#7aa7e0", "second": "#f2bd74",
}  # fmt: skip
"""Colours of roles on light paper."""


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle; `state` is the code of the state that it is drawn for."""

    centre: Point
    radius: float
    fill: Color | None = "paper"
    line: Color | None = "ink"
    shade: float = 1.0  # opacity of the fill
    state: int | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle by its upper left corner; `state` is the code of the state that it is drawn for."""

    corner: Point
    width: float
    height: float
    fill: Color | None = "paper"
    line: Color | None = "ink"
    round: float = 0.0
    shade: float = 1.0
    state: int | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Line:
    """A polyline, or with `curved` one cubic Bézier curve through four points; maybe with an arrow head."""

    points: tuple[Point, ...]
    arrow: bool = False
    curved: bool = False
    color: Color = "ink"
    width: float = 0.03
    is_dashed: bool = False

    def at(self, t: float) -> Point:
        """Return the point at t in [0, 1] on a curve, or between the ends of a line."""
        if self.curved:
            return bezier(self.points, t)
        (x0, y0), *_, (x1, y1) = self.points
        return x0 + (x1 - x0) * t, y0 + (y1 - y0) * t


@dataclass(frozen=True, slots=True)
class Label:
    """Words or mathematics centred on a height; `size` is that of the font in centimetres."""

    at: Point
    text: m.Math
    size: float = 0.36
    anchor: Anchor = "middle"
    color: Color = "ink"
    halo: bool = False


Item = Circle | Box | Line | Label


@dataclass(frozen=True, slots=True)
class Scene:
    """Items from back to front, inside a frame; `alt` describes them in words.

    `focus` is where the present state of a frame is, which stays in sight if there is no room for all. `drawn` has for each
    part of an overlay a description of how it is drawn, in which `{0}` is the scale.
    """

    width: float
    height: float
    items: tuple[Item, ...]
    alt: str
    notes: tuple[str, ...] = ()
    focus: Point | None = None
    drawn: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def caption(self) -> str:
        return " ".join((f"{self.alt}.", *self.notes))

    def shows(self, other: Scene | None) -> bool:
        """Return whether another scene, maybe of a task with another name, looks the same."""
        return other is not None and (self.items, self.notes) == (other.items, other.notes)

    def extended(self, more: Iterable[Item], alt: str | None = None) -> Scene:
        items = (*self.items, *more)
        return fitted(items, alt or self.alt, self.notes, focus=self.focus, drawn=self.drawn)


def text_width(tree: m.Math, size: float = 0.36) -> float:
    return m.width(tree) * size * 0.62


def fitted(
    items: Iterable[Item],
    alt: str,
    notes: tuple[str, ...] = (),
    margin: float = 0.15,
    focus: Point | None = None,
    drawn: Mapping[str, str] | None = None,
) -> Scene:
    items = tuple(items)
    extents = list(map(_extent, items)) or [(0.0, 0.0, 1.0, 1.0)]
    lefts, tops, rights, bottoms = zip(*extents, strict=True)
    left = min(lefts) - margin
    top = min(tops) - margin
    if max(abs(left), abs(top)) > 1e-9:
        items = moved(items, -left, -top)
    if focus is not None:
        focus = (focus[0] - left, focus[1] - top)
    return Scene(max(rights) + margin - left, max(bottoms) + margin - top, items, alt, notes, focus, drawn or {})


def _extent(item: Item) -> tuple[float, float, float, float]:
    match item:
        case Circle(centre=(x, y), radius=r):
            return x - r, y - r, x + r, y + r
        case Box(corner=(x, y), width=w, height=h):
            return x, y, x + w, y + h
        case Line(curved=True):
            return _around([item.at(i / 8) for i in range(9)])
        case Line(points=points):
            return _around(points)
        case Label(at=(x, y), text=text, size=size, anchor=anchor):
            w = BROAD * text_width(text, size)
            left = {"start": 0.0, "middle": -w / 2, "end": -w}[anchor]
            return x + left, y - size * 0.7, x + left + w, y + size * 0.7
        case _:
            assert_never(item)


def _around(points: Sequence[Point]) -> tuple[float, float, float, float]:
    xs, ys = zip(*points, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def moved(items: Iterable[Item], dx: float, dy: float) -> tuple[Item, ...]:
    return tuple(_shifted(item, dx, dy) for item in items)


def _shifted(item: Item, dx: float, dy: float) -> Item:
    match item:
        case Circle(centre=(x, y)):
            return replace(item, centre=(x + dx, y + dy))
        case Box(corner=(x, y)):
            return replace(item, corner=(x + dx, y + dy))
        case Line(points=points):
            return replace(item, points=tuple((x + dx, y + dy) for x, y in points))
        case Label(at=(x, y)):
            return replace(item, at=(x + dx, y + dy))
        case _:
            assert_never(item)


def bezier(points: tuple[Point, ...], t: float) -> Point:
    weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
    xs, ys = zip(*points, strict=True)
    return sum(map(mul, weights, xs)), sum(map(mul, weights, ys))


HEAD = 0.17


def head(line: Line) -> tuple[Point, Point, Point]:
    if line.curved:
        x0, y0 = line.at(0.9)
    else:
        x0, y0 = line.points[-2]
    x1, y1 = line.points[-1]
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
    _, (ax, ay), (bx, by) = head(line)
    return (*line.points[:-1], ((ax + bx) / 2, (ay + by) / 2))


RADIUS = 0.31
ROUND = 0.2

SIGNS: dict[Color, tuple[tuple[Point, ...], ...]] = {
    "good": (((-0.5, 0.0), (-0.15, 0.4), (0.5, -0.4)),),
    "bad": (((-0.4, -0.4), (0.4, 0.4)), ((-0.4, 0.4), (0.4, -0.4))),
    "end": (((-0.35, -0.35), (0.35, -0.35), (0.35, 0.35), (-0.35, 0.35), (-0.35, -0.35)),),
}
"""Strokes of a sign, around (0, 0), one centimetre wide at most."""
ROLES: dict[str, Color] = {"good": "good", "bad": "bad", "end": "end"}
HIGHLIGHTS: dict[str, Color] = {**ROLES, "first": "accent", "second": "second"}
"""Colours of highlights: of roles, which have signs, and of all."""
KEY = 0.36  # side of a square in the key to a figure
WORD = 0.26  # height of the letters beside it


def shape(x: float, y: float, half: float, radius: float, fill: Color, shade: float = 1.0) -> Circle | Box:
    if half <= radius + 0.02:
        return Circle((x, y), radius, fill, shade=shade)
    return Box((x - half, y - radius), 2 * half, 2 * radius, fill, round=ROUND, shade=shade)


def marked(item: Circle | Box, is_written: bool = False, corner: tuple[int, int] = (1, -1)) -> Iterator[Line]:
    """Yield the sign of a good, bad or terminal state: a tick, a cross, or a square.

    It is at the top of a round shape, and in the middle of a cell, or in a corner where something is written in it.
    """
    if item.fill not in SIGNS:
        return
    left, upper, right, lower = _extent(item)
    x = (left + right) / 2
    y = (upper + lower) / 2
    half = (right - left) / 2
    top = (lower - upper) / 2
    if isinstance(item, Circle) or item.round:
        yield from sign(item.fill, (x, y - 0.7 * top), 0.42 * top)
    elif is_written:
        side = 2 * min(half, top)
        at = (x + corner[0] * (half - 0.17 * side), y + corner[1] * (top - 0.17 * side))
        yield from sign(item.fill, at, 0.22 * side)
    else:
        yield from sign(item.fill, (x, y), 0.8 * min(half, top))


def sign(role: Color, at: Point, size: float) -> Iterator[Line]:
    for stroke in SIGNS[role]:
        yield Line(tuple((at[0] + size * x, at[1] + size * y) for x, y in stroke), width=0.035)


def keyed(scene: Scene) -> Scene:
    """Return the scene with a key of its roles below it, on its left; as it is without any."""
    shown = {item.fill for item in scene.items if isinstance(item, Circle | Box)}
    key: list[Item] = []
    x = 0.0
    y = scene.height + KEY
    for role in ROLES.values():
        if role in shown:
            swatch = Box((x, y - KEY / 2), KEY, KEY, role, "muted")
            word = Label((x + KEY + 0.1, y), m.Words(role), WORD, "start", "muted")
            key += [swatch, *marked(swatch), word]
            x += KEY + 0.1 + text_width(word.text, WORD) + 0.3
    if key:
        return scene.extended(key)
    return scene


def signed(value: float) -> m.Math:
    return m.Num(number(value, 4))


def equal(name: str, value: float) -> m.Math:
    return m.equal(m.Ident(name), signed(value))


def chance(p: float) -> m.Math:
    """Return a probability as per cent where that is short, else as a fraction or three digits."""
    if p >= 0.01 and abs(100 * p - round(100 * p)) < 1e-9:
        return m.Num(f"{round(100 * p)}%")
    ratio = small_fraction(p, 99)
    if ratio is not None:
        return m.Num(f"{ratio.numerator}/{ratio.denominator}")
    return m.Num(f"{p:.3g}")
