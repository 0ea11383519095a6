"""Small parts of figures: shapes of states, signs and their key, numbers on labels, where arrows touch and labels go."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from taskspec.figures.scene import (
    Box,
    Circle,
    Color,
    Item,
    Label,
    Line,
    Paint,
    Point,
    Scene,
    bezier,
    extended,
    text_width,
)
from taskspec.printers import tree as m

RADIUS = 0.31
ROUND = 0.2
HATCH = 0.12
RIM = 0.03
"""Centimetres between two lines of a hatching, and between these and the outline."""

SIGNS: dict[Paint, tuple[tuple[Point, ...], ...]] = {
    "good": (((-0.5, 0.0), (-0.15, 0.4), (0.5, -0.4)),),
    "bad": (((-0.4, -0.4), (0.4, 0.4)), ((-0.4, 0.4), (0.4, -0.4))),
    "end": (((-0.35, -0.35), (0.35, -0.35), (0.35, 0.35), (-0.35, 0.35), (-0.35, -0.35)),),
}
"""Strokes of a sign, around (0, 0), one centimetre wide at most."""
KEY = 0.36
WORD = 0.26
"""The side of a square in the key to a figure, and the height of the letters beside it."""


def shape(x: float, y: float, half: float, radius: float, fill: Color, shade: float) -> Circle | Box:
    if half <= radius + 0.02:
        return Circle((x, y), radius, fill, shade=shade)
    return Box((x - half, y - radius), 2 * half, 2 * radius, fill, round=ROUND, shade=shade)


def hatched(item: Circle | Box, clear: float = 0.0) -> Iterator[Line]:
    """Yield diagonal lines within a shape, which tell it apart without its colour; none within `clear` of its centre."""
    if isinstance(item, Circle):
        (x, y), rx, ry = item.centre, item.radius - RIM, item.radius - RIM
    else:
        (x, y), rx, ry = _centre(item), item.width / 2, item.height / 2
    count = int((rx + ry) / math.sqrt(2) / HATCH)
    for off in (i * HATCH for i in range(-count, count + 1)):  # distances from the centre
        rise = off * math.sqrt(2)
        middle = off / math.sqrt(2)
        if isinstance(item, Circle):
            half = math.sqrt(max(0.0, rx * rx - off * off) / 2)
            low = middle - half
            high = middle + half
        else:
            inset = RIM + item.round * 0.3
            low = max(-rx + inset, rise - ry + inset)
            high = min(rx - inset, rise + ry - inset)
        free = math.sqrt(max(0.0, clear * clear - off * off) / 2)
        for start, end in ((low, middle - free), (middle + free, high)) if free else ((low, high),):
            if end - start > 0.04:
                yield Line(((x + start, y + rise - start), (x + end, y + rise - end)), color="paper", width=0.03)


def marked(item: Circle | Box, clear: float = 0.0, corner: tuple[int, int] = (1, -1)) -> Iterator[Line]:
    """Yield the sign of a good, bad or terminal state: a tick, a cross on hatching, or a square.

    The mark is at the top of what is round, and in the middle of a cell, or in a corner, its upper right one if no
    other is named, where something is written within `clear` of the middle.
    """
    if item.fill not in SIGNS:
        return
    if item.fill == "bad":
        yield from hatched(item, clear or 0.28 * _height(item))
    if isinstance(item, Circle) or item.round:
        (x, y), top = _centre(item), _height(item) / 2
        yield from sign(item.fill, (x, y - 0.7 * top), 0.42 * top)
    else:
        (x, y), side = _centre(item), min(item.width, item.height)
        dx, dy = ((d / 2 - 0.17 * side) if clear else 0.0 for d in (item.width, item.height))
        yield from sign(item.fill, (x + corner[0] * dx, y + corner[1] * dy), (0.22 if clear else 0.4) * side)


def _height(item: Circle | Box) -> float:
    return 2 * item.radius if isinstance(item, Circle) else item.height


def _centre(item: Circle | Box) -> Point:
    if isinstance(item, Circle):
        return item.centre
    return item.corner[0] + item.width / 2, item.corner[1] + item.height / 2


def sign(role: Paint, at: Point, size: float) -> Iterator[Line]:
    """Yield the sign of a role."""
    for stroke in SIGNS[role]:
        yield Line(tuple((at[0] + size * x, at[1] + size * y) for x, y in stroke), width=0.035)


def keyed(scene: Scene) -> Scene:
    """Return the scene with a key of its roles below it, on its left; as it is without any."""
    shown = {item.fill for item in scene.items if isinstance(item, Circle | Box)}
    key = list[Item]()
    x = 0.0
    y = scene.height + KEY
    for role in SIGNS:
        if role in shown:
            swatch = Box((x, y - KEY / 2), KEY, KEY, role, "muted")
            word = Label((x + KEY + 0.1, y), m.Words(role), WORD, "start", "muted")
            key += [swatch, *marked(swatch), word]
            x += KEY + 0.1 + text_width(word.text, WORD) + 0.3
    return extended(scene, key) if key else scene


def number(value: object) -> m.Math:
    return m.Num(str(value).replace("-", "−"))


def signed(value: float) -> m.Math:
    return m.Num(decimal(value))


def decimal(value: float) -> str:
    return f"{value:.4g}".replace("-", "−")


def chance(p: float) -> m.Math:
    """Return a probability as per cent where that is short, else as a fraction or three digits."""
    if p >= 0.01 and abs(100 * p - round(100 * p)) < 1e-9:
        return m.Num(f"{round(100 * p)}%")
    ratio = Fraction(p).limit_denominator(99)
    if abs(float(ratio) - p) < 1e-12:
        return m.Num(f"{ratio.numerator}/{ratio.denominator}")
    return m.Num(f"{p:.3g}")


def outline(centre: Point, towards: Point, half: float, radius: float) -> Point:
    """Return where the line from the centre of a `shape` to a point outside leaves it."""
    dx = towards[0] - centre[0]
    dy = towards[1] - centre[1]
    length = math.hypot(dx, dy) or 1.0
    ux = dx / length
    uy = dy / length
    if half <= radius + 0.02:
        return centre[0] + ux * radius, centre[1] + uy * radius
    inside = 0.0
    outside = half + radius
    for _ in range(40):
        t = (inside + outside) / 2
        qx = abs(ux) * t - (half - ROUND)
        qy = abs(uy) * t - (radius - ROUND)
        beyond = math.hypot(max(qx, 0.0), max(qy, 0.0)) + min(max(qx, qy), 0.0) > ROUND
        inside, outside = (inside, t) if beyond else (t, outside)
    return centre[0] + ux * inside, centre[1] + uy * inside


def near(a: Point, b: Point, p: Point) -> bool:
    """Return whether a vertex is in the way of a straight arrow."""
    dx = b[0] - a[0]
    dy = b[1] - a[1]
    t = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / ((dx * dx + dy * dy) or 1.0)
    if not 0.05 < t < 0.95:
        return False
    return math.hypot(a[0] + t * dx - p[0], a[1] + t * dy - p[1]) < RADIUS + 0.05


def beside_line(line: Line) -> Point:
    """Return the place of an arrow's label, above its middle."""
    (x0, y0), (x1, y1) = line.points[0], line.points[-1]
    mx, my = bezier(line.points, 0.5) if line.curved else ((x0 + x1) / 2, (y0 + y1) / 2)
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    nx = (y1 - y0) / length
    ny = -(x1 - x0) / length
    if ny > 0 and not line.curved:
        nx = -nx
        ny = -ny
    off = 0.18
    return mx + nx * off, my + ny * off
