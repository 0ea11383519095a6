"""Charts as scenes: axes, ticks, lines, bands, marks and legends; lengths in centimetres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from taskspec.base.display import number
from taskspec.language.printers import tree as m
from taskspec.show.figures import shapes as sc

SMALL = 0.25
FONT = 0.28  # sizes of letters
EDGE = sc.Hex("#9aa3ad")
GRID = sc.Hex("#e7eaed")
RULE = sc.Hex("#4a545e")
# Colours of Okabe and Ito, which people with any colour vision can tell apart.
BLUE = sc.Hex("#0072B2")
VERMILION = sc.Hex("#D55E00")
GREEN = sc.Hex("#009E73")
PURPLE = sc.Hex("#CC79A7")
ORANGE = sc.Hex("#E69F00")
SKY = sc.Hex("#56B4E9")
YELLOW = sc.Hex("#F0E442")
CIVIDIS = (
    "#00204D", "#00336F", "#39486B", "#575C6D", "#707173", "#8A8779", "#A69D75", "#C4B56C", "#E4CF5B", "#FFEA46",
)  # fmt: skip
"""The colour map of Nuñez, Anderton and Renslow (2018), at equal distances."""
Shape = Literal["circle", "square", "diamond", "up", "down"]
SHAPES: tuple[Shape, ...] = ("circle", "square", "diamond", "up", "down")
CORNERS: dict[Shape, tuple[sc.Point, ...]] = {
    "square": ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)),
    "diamond": ((0.0, -1.35), (1.35, 0.0), (0.0, 1.35), (-1.35, 0.0)),
    "up": ((0.0, -1.2), (1.2, 0.9), (-1.2, 0.9), (0.0, -1.2)),
    "down": ((0.0, 1.2), (1.2, -0.9), (-1.2, -0.9), (0.0, 1.2)),
}
TICK = 0.1  # the length of a tick
GAP = 0.15
SHORT = 4  # characters
SYMBOL = 0.3
TICKS = 0.25  # of axes that are arrows: their distance from the plane, and the sizes of symbols and numbers
Rgb = tuple[int, int, int]


def nice_ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return multiples of 1, 2, 2.5 or 5 times a power of ten within a range, at most `most` of them if there are two."""
    width = high - low
    if not 0 < width < math.inf:
        return [low]
    unit = 10.0 ** math.floor(math.log10(width / most))
    for step in (factor * unit for factor in (1, 2, 2.5, 5, 10, 20)):
        first = math.ceil(low / step - 1e-9)
        last = math.floor(high / step + 1e-9)
        if last - first < most:
            return [i * step for i in range(first, last + 1)]
    return [low, high]


def log_ticks(low: float, high: float) -> list[float]:
    """Return powers of ten within a range of positive numbers, and their doubles and fives if there are few powers."""
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    factors = (1,) if len(exponents) > 3 else (1, 2, 5)
    every = -(-len(exponents) // 7)
    ticks = [factor * 10.0**e for e in exponents[::every] for factor in factors]
    return [tick for tick in ticks if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)] or [low, high]


def blend(colors: Sequence[str | Rgb], share: float) -> Rgb:
    """Return the colour at `share` in [0, 1] of the way through colours at equal distances."""
    stops = [bytes.fromhex(c[1:]) if isinstance(c, str) else c for c in colors]
    place = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    i = min(int(place), len(stops) - 2)
    red, green, blue = (round(a + (b - a) * (place - i)) for a, b in zip(stops[i], stops[i + 1], strict=True))
    return red, green, blue


def hexadecimal(color: Rgb) -> sc.Hex:
    return sc.Hex("#{:02x}{:02x}{:02x}".format(*color))


def ink(background: Rgb) -> sc.Hex:
    """Return black or white, whichever has more contrast to a background, as defined by WCAG 2."""
    shares = [c / 255 for c in background]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return sc.Hex("#ffffff" if luminance < 0.1791 else "#000000")


@dataclass(frozen=True)
class Scale:
    """A range of numbers, with ticks as (value, label)."""

    low: float
    high: float
    ticks: tuple[tuple[float, str], ...] = ()
    label: str = ""
    log: bool = False
    angle: float = 0.0  # of the labels

    def share(self, value: float) -> float:
        """Return how far a value is along the axis: 0 at `low`, 1 at `high`."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / ((self.high - self.low) or 1.0)


def axis(values: Iterable[float], label: str = "", log: bool = False, most: int = 6, margin: float = 0.05) -> Scale:
    """Return an axis that has room for values, with ticks at round numbers."""
    known = [v for v in values if math.isfinite(v) and (v > 0 or not log)] or [1.0]
    low = min(known)
    high = max(known)
    if log:
        factor = (high / low) ** margin if high > low else 2.0
        low /= factor
        high *= factor
        ticks = log_ticks(low, high)
    else:
        if high > low:
            room = (high - low) * margin
        else:
            room = max(abs(low) * margin, 0.5)
        low -= room
        high += room
        ticks = nice_ticks(low, high, most)
    return Scale(low, high, tuple((tick, number(tick)) for tick in ticks), label, log)


@dataclass(frozen=True)
class Axes:
    """A rectangle between two axes, by its upper left corner; y points upwards."""

    left: float
    top: float
    width: float
    height: float
    x: Scale
    y: Scale

    @property
    def right(self) -> float:
        return self.left + self.width

    @property
    def bottom(self) -> float:
        return self.top + self.height

    def at(self, x: float, y: float) -> sc.Point:
        """Return the place of a point in the scene."""
        return self.left + self.width * self.x.share(x), self.bottom - self.height * self.y.share(y)

    def has(self, x: float, y: float) -> bool:
        """Return whether a point can be drawn: its coordinates are finite, and positive on logarithmic axes."""
        return all(math.isfinite(v) and (v > 0 or not a.log) for v, a in ((x, self.x), (y, self.y)))


def words(text: str, at: sc.Point, size: float = FONT, anchor: sc.Anchor = "middle", color: sc.Paint = "ink", angle: float = 0.0,
          bold: bool = False) -> Iterator[sc.Label]:  # fmt: skip
    """Yield a label for each line of a text, around a point."""
    lines = text.split("\n")
    sin = math.sin(math.radians(angle))
    cos = math.cos(math.radians(angle))
    for i, line in enumerate(lines):
        down = 1.25 * size * (i - (len(lines) - 1) / 2)
        place = (at[0] + down * sin, at[1] + down * cos)
        yield sc.Label(place, m.Words(line), size, anchor, color, angle=angle, bold=bold)


def breadth(text: str, size: float = FONT) -> float:
    return max(sc.BROAD * sc.text_width(m.Words(line), size) for line in text.split("\n"))


def frame(plot: Axes, grid: bool = False, size: float = SMALL) -> Iterator[sc.Item]:
    """Yield the axes below and on the left, with their ticks and labels, and lines at the ticks if there is a grid."""
    for x, text in plot.x.ticks:
        place = plot.left + plot.width * plot.x.share(x)
        if grid:
            yield sc.Line(((place, plot.top), (place, plot.bottom)), color=GRID, width=0.015)
        yield sc.Line(((place, plot.bottom), (place, plot.bottom + TICK)), color=EDGE, width=0.02)
        below = plot.bottom + TICK + 0.2 + 0.6 * size * text.count("\n")
        anchor: sc.Anchor = "end" if plot.x.angle else "middle"
        yield from words(text, (place, below), size, anchor, angle=plot.x.angle)
    for y, text in plot.y.ticks:
        height = plot.bottom - plot.height * plot.y.share(y)
        if grid:
            yield sc.Line(((plot.left, height), (plot.right, height)), color=GRID, width=0.015)
        yield sc.Line(((plot.left - TICK, height), (plot.left, height)), color=EDGE, width=0.02)
        yield from words(text, (plot.left - TICK - 0.08, height), size, "end")
    yield sc.Line(((plot.left, plot.top), (plot.left, plot.bottom), (plot.right, plot.bottom)), color=EDGE, width=0.02)
    if plot.x.label:
        yield from words(plot.x.label, (plot.left + plot.width / 2, plot.bottom + below_axis(plot.x, size) + 0.1), size)
    if plot.y.label:
        widest = max((breadth(text, size) for _, text in plot.y.ticks), default=0.0)
        middle = (plot.left - TICK - widest - 0.3, plot.top + plot.height / 2)
        yield from words(plot.y.label, middle, size, angle=90)


def arrow_axes(plot: Axes, symbols: Sequence[m.Math]) -> Iterator[sc.Item]:
    """Yield axes as arrows with the numbers at their ends, and fine lines through zero, as figures of tasks have them."""
    if plot.x.low < 0 < plot.x.high:
        yield upright(plot, 0.0, "faint", "solid", 0.02)
    if plot.y.low < 0 < plot.y.high:
        yield level(plot, 0.0, "faint", "solid", 0.02)
    left = plot.left - GAP
    below = plot.bottom + GAP
    yield sc.Line(((left, below), (plot.right + GAP, below)), arrow=True, color="muted", width=0.02)
    yield sc.Line(((left, below), (left, plot.top - GAP)), arrow=True, color="muted", width=0.02)
    ends = ((plot.right + GAP + 0.22, below), (left, plot.top - GAP - 0.25))
    for symbol, place in zip(symbols, ends, strict=False):
        yield sc.Label(place, symbol, SYMBOL)
    for x in _round_ends(plot.x):
        yield sc.Label((plot.at(x, plot.y.low)[0], below + 0.25), sc.signed(x), TICKS, color="muted")
    for y in _round_ends(plot.y):
        yield sc.Label((left - 0.1, plot.at(plot.x.low, y)[1]), sc.signed(y), TICKS, "end", color="muted")


def _round_ends(axis: Scale) -> list[float]:
    """Return the ends of an axis if they are short to write, else round numbers near them."""
    ends = [axis.low, axis.high]
    if max(len(f"{end:.6g}") for end in ends) <= SHORT:
        return ends
    ticks = nice_ticks(axis.low, axis.high)
    return [ticks[0], ticks[-1]]


def below_axis(axis: Scale, size: float = SMALL) -> float:
    """Return how far the tick labels of an axis reach below it."""
    sin = math.sin(math.radians(axis.angle))
    lines = max((text.count("\n") + 1 for _, text in axis.ticks), default=1)
    longest = max((breadth(text, size) for _, text in axis.ticks), default=0.0)
    return TICK + 0.2 + 1.25 * size * lines + longest * sin


def polyline(plot: Axes, xs: Sequence[float], ys: Sequence[float], color: sc.Paint, width: float = 0.05,
             dash: sc.Dash = "solid", shade: float = 1.0) -> Iterator[sc.Line]:  # fmt: skip
    """Yield a line through points, broken where one cannot be drawn."""
    run: list[sc.Point] = []
    for x, y in (*zip(xs, ys, strict=True), (math.nan, math.nan)):
        if plot.has(x, y):
            run.append(plot.at(x, y))
            continue
        if len(run) > 1:
            yield sc.Line(tuple(run), color=color, width=width, dash=dash, shade=shade)
        run = []


def level(plot: Axes, y: float, color: sc.Paint = RULE, dash: sc.Dash = "dashed", width: float = 0.03) -> sc.Line:
    return sc.Line((plot.at(plot.x.low, y), plot.at(plot.x.high, y)), color=color, width=width, dash=dash)


def upright(plot: Axes, x: float, color: sc.Paint = RULE, dash: sc.Dash = "dashed", width: float = 0.03) -> sc.Line:
    return sc.Line((plot.at(x, plot.y.low), plot.at(x, plot.y.high)), color=color, width=width, dash=dash)


def band(
    plot: Axes, xs: Sequence[float], lows: Sequence[float], highs: Sequence[float], color: sc.Paint
) -> Iterator[sc.Area]:
    """Yield the area between two curves, where both can be drawn."""
    there = []
    back = []
    for x, low, high in zip(xs, lows, highs, strict=True):
        if plot.has(x, low) and plot.has(x, high):
            there.append(plot.at(x, high))
            back.append(plot.at(x, low))
    if len(there) > 1:
        yield sc.Area((*there, *reversed(back)), color, shade=0.2)


def error_bar(plot: Axes, x: float, low: float, high: float, color: sc.Paint) -> Iterator[sc.Line]:
    """Yield an interval as an upright line with caps; a part of it that a logarithmic axis lacks is cut off."""
    low = max(low, plot.y.low)
    if not (plot.has(x, low) and plot.has(x, high) and high > low):
        return
    place, bottom = plot.at(x, low)
    _, top = plot.at(x, high)
    yield sc.Line(((place, bottom), (place, top)), color=color)
    for y in (bottom, top):
        yield sc.Line(((place - 0.07, y), (place + 0.07, y)), color=color)


def mark(at: sc.Point, shape: Shape, color: sc.Paint, size: float = 0.075, filled: bool = False) -> sc.Circle | sc.Area:
    fill: sc.Paint = color if filled else "paper"
    if shape == "circle":
        return sc.Circle(at, size, fill, color)
    return sc.Area(tuple((at[0] + size * dx, at[1] + size * dy) for dx, dy in CORNERS[shape]), fill, color)


def color_bar(plot: Axes, colors: Sequence[str]) -> Iterator[sc.Item]:
    """Yield a bar of colours beside a heat map, with the ticks of the plot's y axis on its right."""
    steps = 60
    height = plot.height / steps
    for i in range(steps):
        color = hexadecimal(blend(colors, (i + 0.5) / steps))
        yield sc.Box((plot.left, plot.bottom - (i + 1) * height), plot.width, height + 0.01, color, None)
    for value, text in plot.y.ticks:
        y = plot.bottom - plot.height * plot.y.share(value)
        yield sc.Line(((plot.right, y), (plot.right + TICK, y)), color=EDGE, width=0.02)
        yield from words(text, (plot.right + TICK + 0.08, y), SMALL, "start")


@dataclass(frozen=True)
class LegendEntry:
    """A line of a legend: a stroke, a mark, or both."""

    text: str
    color: sc.Paint
    dash: sc.Dash | None = "solid"
    shape: Shape | None = None
    filled: bool = False
    width: float = 0.05


def legend(
    entries: Sequence[LegendEntry], left: float, top: float, room: float, size: float = SMALL
) -> Iterator[sc.Item]:
    """Yield entries in rows, each as long as there is room."""
    x = left
    y = top + size / 2
    for entry in entries:
        needed = 0.8 + breadth(entry.text, size) + 0.25
        if x > left and x + needed > left + room:
            x = left
            y = y + 1.5 * size
        if entry.dash is not None:
            yield sc.Line(((x, y), (x + 0.65, y)), color=entry.color, width=entry.width, dash=entry.dash)
        if entry.shape is not None:
            yield mark((x + 0.325, y), entry.shape, entry.color, filled=entry.filled)
        yield from words(entry.text, (x + 0.8, y), size, "start")
        x += needed


def chart(items: Iterable[sc.Item], alt: str, margin: float = 0.2) -> sc.Scene:
    return replace(sc.fitted(items, alt, margin=margin), font="sans")
