"""Where the labels of a graph go: over no other label, vertex or arrow head, and over few lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from taskspec.figures.marks import RADIUS, beside_line
from taskspec.figures.route import LOOP_OUT, Spot, descend, flattened, sampled
from taskspec.figures.scene import BROAD, Label, Line, Point, bezier, head, text_width
from taskspec.printers import tree as m

ARROW, STATE = 0.25, 0.28
"""Heights of letters beside arrows and states."""
PAPER, MUCH = 0.05, 0.35
"""How far the paper behind a label reaches beyond its letters, and which part of its own arrow it may hide."""
APART = 0.06
"""Less room than this between labels, in centimetres, makes one of two."""
OVERLAP, COVER, FAR = 20.0, 1.0, 0.02
"""What it costs to lie over a label, vertex or arrow head, over a line, and further down the list."""


@dataclass(frozen=True, slots=True)
class Placement:
    labels: tuple[Label, ...]
    overlaps: int
    covered: int


def box(label: Label) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of a label's letters."""
    (x, y), w = label.at, text_width(label.text, label.size)
    left = {"start": x, "middle": x - w / 2, "end": x - w}[label.anchor]
    return left, y - 0.5 * label.size, left + w, y + 0.5 * label.size


def placed(
    options: Sequence[Sequence[Label]], own: Sequence[int], lines: Sequence[Line], spots: Sequence[Spot]
) -> Placement:
    """One place for every label.

    Args:
        options: places by label, the usual one first.
        own: the indices in `lines` of the arrows that the first labels belong to.
        lines: the arrows.
        spots: the vertices.
    """
    if not options:
        return Placement((), 0, 0)
    flat, groups = flattened(options)
    of = np.array([i for i, g in enumerate(groups) for _ in g])
    boxes = np.array([box(label) for label in flat])
    centre, half = (boxes[:, 2:] + boxes[:, :2]) / 2, (boxes[:, 2:] - boxes[:, :2]) / 2
    broad = half * (BROAD, 1.0)
    gap = np.abs(centre[:, None] - centre[None]) - broad[:, None] - broad[None]
    pair = (gap < APART).all(2) & (of[:, None] != of[None])
    shapes = np.array(_shapes(lines, spots))
    gap = np.maximum(np.abs(centre[:, None] - shapes[None, :, :2]) - half[:, None] - shapes[None, :, 2:4], 0.0)
    hard = (np.hypot(gap[..., 0], gap[..., 1]) < shapes[:, 4]).sum(1)
    arrow = np.array([own[i] if i < len(own) else -1 for i in of])
    others = np.arange(len(lines)) != arrow[:, None]

    def result(chosen: list[int], covered: np.ndarray) -> Placement:
        overlaps = int(hard[chosen].sum() + np.triu(pair[np.ix_(chosen, chosen)], 1).sum())
        return Placement(tuple(flat[i] for i in chosen), overlaps, int(covered[chosen].sum()))

    usual = result([g.start for g in groups], ((_hidden(centre, half, lines) > 0) & others).sum(1))
    if usual.overlaps == usual.covered == 0:
        return usual
    hidden = _hidden(centre, half + np.array([0.0, PAPER]), lines)
    covered = ((hidden > 0) & others).sum(1)
    alone = OVERLAP * hard + COVER * (covered + ((hidden > MUCH) & ~others).any(1))
    alone += FAR * np.concatenate([np.arange(len(g)) for g in groups])
    return result(descend(groups, alone, OVERLAP * pair), covered)


def _shapes(lines: Sequence[Line], spots: Sequence[Spot]) -> list[tuple[float, float, float, float, float]]:
    """Vertices and arrow heads as a rectangle (its centre, half its sides) and how far the shape reaches beyond it."""
    found = [(*s.at, *s.core) for s in spots]
    for line in lines:
        if line.arrow:
            (x, y), (ax, ay), (bx, by) = head(line)
            found.append(((2 * x + ax + bx) / 4, (2 * y + ay + by) / 4, 0.0, 0.0, 0.06))
    return found


def _hidden(centre: np.ndarray, half: np.ndarray, lines: Sequence[Line]) -> np.ndarray:
    """Which part of each line (columns) labels (rows) lie over, by points along it."""
    if not lines:
        return np.zeros((len(centre), 0))
    coarse = np.array([sampled(line) for line in lines])
    paths = np.concatenate([coarse, (coarse[:, 1:] + coarse[:, :-1]) / 2], axis=1)
    off = np.abs(centre[:, None, None] - paths[None]) - half[:, None, None]
    return np.asarray((off < 0).all(3).mean(2))


def along(line: Line, text: m.Math) -> list[Label]:
    """Places of an arrow's label: above its middle, then on either side of it and further along."""

    def label(at: Point) -> Label:
        return Label(at, text, ARROW, color="muted", halo=True)

    found = [label(beside_line(line))]
    w, h = text_width(text, ARROW) / 2, ARROW / 2
    for t in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8):
        x, y, nx, ny = _normal(line, t)
        off = abs(nx) * w + abs(ny) * h + 0.06
        found += [label((x + nx * off, y + ny * off)), label((x - nx * off, y - ny * off)), label((x, y))]
    return found


def _normal(line: Line, t: float) -> tuple[float, float, float, float]:
    """A point of a line and the unit normal there."""

    def at(t: float) -> Point:
        if line.curved:
            return bezier(line.points, t)
        (x0, y0), (x1, y1) = line.points[0], line.points[-1]
        return x0 + (x1 - x0) * t, y0 + (y1 - y0) * t

    (x, y), (x0, y0), (x1, y1) = at(t), at(t - 0.01), at(t + 0.01)
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    return x, y, (y1 - y0) / length, -(x1 - x0) / length


def at_loop(line: Line, text: m.Math, v: Spot) -> list[Label]:
    """Places of a loop's label: outside it, then along it."""
    (x0, y0), (x1, y1) = line.points[1], line.points[2]
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    ux, uy = x - v.at[0], y - v.at[1]
    length = math.hypot(ux, uy)
    ux, uy = ux / length, uy / length
    w = text_width(text, ARROW) / 2
    outside = (x + ux * (w - 0.08), y + uy * 0.02)
    return [Label(outside, text, ARROW, color="muted", halo=True), *along(line, text)[1:]]


def beside(v: Spot, text: m.Math, row: int, looped: bool) -> list[Label]:
    """Places of a word on a state: below it, in the last column on its right; then all around."""
    (x, y), down = v.at, 0.4 * row
    side, above = v.half + v.rim + 0.1, RADIUS + v.rim + 0.26
    right = v.half + 0.16 + (LOOP_OUT - 0.2 if looped else 0.0)
    usual = (
        Label((x + right, y + down), text, STATE, "start")
        if v.last
        else Label((x, y + RADIUS + 0.26 + down), text, STATE)
    )
    corner = side - 0.12
    return [usual,
            Label((x, y + above + down), text, STATE), Label((x, y - above - down), text, STATE),
            Label((x + side, y + down), text, STATE, "start"), Label((x - side, y + down), text, STATE, "end"),
            *(Label((x + sx * corner, y + sy * (RADIUS + down)), text, STATE, anchor) for sy in (1, -1)
              for sx, anchor in _SIDES),
            Label((x + side + LOOP_OUT, y + down), text, STATE, "start")]  # fmt: skip


_SIDES: tuple[tuple[int, Literal["start", "end"]], ...] = ((1, "start"), (-1, "end"))
