"""Small parts of figures: shapes of states, signs of good, bad and terminal ones with their key, numbers on labels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from taskspec.base.display import number
from taskspec.figures.scene import Box, Circle, Color, Item, Label, Line, Paint, Point, Scene, text_width
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
ROLES: dict[str, Color] = {"good": "good", "bad": "bad", "end": "end"}
HIGHLIGHTS: dict[str, Color] = {**ROLES, "first": "accent", "second": "second"}
"""Colours of highlights: of roles, which have signs, and of all."""
KEY = 0.36
WORD = 0.26
"""The side of a square in the key to a figure, and the height of the letters beside it."""


def shape(x: float, y: float, half: float, radius: float, fill: Color, shade: float = 1.0) -> Circle | Box:
    if half <= radius + 0.02:
        return Circle((x, y), radius, fill, shade=shade)
    return Box((x - half, y - radius), 2 * half, 2 * radius, fill, round=ROUND, shade=shade)


def _sides(item: Circle | Box) -> tuple[float, float, float, float]:
    """Return the centre of a shape, and half its width and its height."""
    if isinstance(item, Circle):
        return *item.centre, item.radius, item.radius
    return item.corner[0] + item.width / 2, item.corner[1] + item.height / 2, item.width / 2, item.height / 2


def hatched(item: Circle | Box, clear: float = 0.0) -> Iterator[Line]:
    """Yield diagonal lines within a shape, which tell it apart without its colour; none within `clear` of its centre."""
    x, y, rx, ry = _sides(item)
    if isinstance(item, Circle):
        rx -= RIM
        ry -= RIM
    count = int((rx + ry) / math.sqrt(2) / HATCH)
    for i in range(-count, count + 1):
        off = i * HATCH  # distance from the centre
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
    x, y, half, top = _sides(item)
    if item.fill == "bad":
        yield from hatched(item, clear or 0.56 * top)
    if isinstance(item, Circle) or item.round:
        yield from sign(item.fill, (x, y - 0.7 * top), 0.42 * top)
    elif clear:
        side = 2 * min(half, top)
        at = (x + corner[0] * (half - 0.17 * side), y + corner[1] * (top - 0.17 * side))
        yield from sign(item.fill, at, 0.22 * side)
    else:
        yield from sign(item.fill, (x, y), 0.8 * min(half, top))


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
    for role in ROLES.values():
        if role in shown:
            swatch = Box((x, y - KEY / 2), KEY, KEY, role, "muted")
            word = Label((x + KEY + 0.1, y), m.Words(role), WORD, "start", "muted")
            key += [swatch, *marked(swatch), word]
            x += KEY + 0.1 + text_width(word.text, WORD) + 0.3
    return scene.extended(key) if key else scene


def signed(value: float) -> m.Math:
    return m.Num(number(value, 4))


def equal(name: str, value: float) -> m.Math:
    """Return `V = 1.5`."""
    return m.Row((m.Ident(name), m.Sym("="), signed(value)))


def chance(p: float) -> m.Math:
    """Return a probability as per cent where that is short, else as a fraction or three digits."""
    if p >= 0.01 and abs(100 * p - round(100 * p)) < 1e-9:
        return m.Num(f"{round(100 * p)}%")
    ratio = Fraction(p).limit_denominator(99)
    if abs(float(ratio) - p) < 1e-12:
        return m.Num(f"{ratio.numerator}/{ratio.denominator}")
    return m.Num(f"{p:.3g}")
