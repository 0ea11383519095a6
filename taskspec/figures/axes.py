"""Axes of plots: lines below and on the left, numbers at their ends, and a plane in which to draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from taskspec.figures.marks import signed
from taskspec.figures.scene import Item, Label, Line, Point
from taskspec.printers import tree as m

WIDTH, HEIGHT = 5.0, 3.0
GAP, LETTERS, TICKS = 0.15, 0.3, 0.25
Range = tuple[float, float]


def plane(xs: Range, ys: Range) -> Callable[[Point], Point]:
    """Where points of a rectangle, y upwards, lie in a scene."""
    sx, sy = WIDTH / (xs[1] - xs[0] or 1.0), HEIGHT / (ys[1] - ys[0] or 1.0)
    return lambda p: ((p[0] - xs[0]) * sx, (ys[1] - p[1]) * sy)


def axes(
    x0: float, x1: float, y0: float, y1: float, to: Callable[[Point], Point], symbols: Sequence[m.Math]
) -> Iterator[Item]:
    """Axes below and on the left, with the numbers at their ends, and fine lines through zero."""
    (left, bottom), (right, top) = to((x0, y0)), to((x1, y1))
    for axis, (low, high) in enumerate(((x0, x1), (y0, y1))):
        if low < 0 < high:
            x, y = to((0.0, 0.0))
            yield Line(((x, bottom), (x, top)) if axis == 0 else ((left, y), (right, y)), color="faint", width=0.02)
    corner = (left - GAP, bottom + GAP)
    yield Line((corner, (right + GAP, bottom + GAP)), arrow=True, color="muted", width=0.02)
    yield Line((corner, (left - GAP, top - GAP)), arrow=True, color="muted", width=0.02)
    for symbol, place in zip(
        symbols, ((right + GAP + 0.22, bottom + GAP), (left - GAP, top - GAP - 0.25)), strict=False
    ):
        yield Label(place, symbol, LETTERS)
    for x in (x0, x1):
        yield Label((to((x, y0))[0], bottom + GAP + 0.25), signed(x), TICKS, color="muted")
    for y in (y0, y1):
        yield Label((left - GAP - 0.1, to((x0, y))[1]), signed(y), TICKS, "end", color="muted")
