"""The lines of a graph's arrows, and the places of its labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, chain, pairwise
from typing import TypeVar

import numpy as np

from taskspec.show.figures.shapes import BROAD, RADIUS, ROUND, Anchor, Label, Line, Point, head, text_width
from taskspec.show.printers import tree as m

T = TypeVar("T")
BENDS = (0.0, 0.32, -0.32, 0.75, -0.75, 1.2, -1.2)
PIECES = 10  # straight pieces by which curves are compared
TOUCH = 0.09  # arrows nearer than this, in centimetres, cannot be told apart
MARGIN = 0.06  # room between an arrow and a vertex that it passes, in centimetres
CHUNK = 2000  # pairs of ways compared at once, which bounds the memory
OVER = 5.0
BEND = 0.03  # what passing over a vertex and another way than the first cost, in crossings
LOOP_OUT = 0.62
LOOP_WIDE = 0.42


@dataclass(frozen=True, slots=True)
class Spot:
    """A vertex where it lies: half its width, half its height, and the room that a second rim takes."""

    at: Point
    half: float
    radius: float
    rim: float = 0.0
    last: bool = False  # in the last column

    @property
    def is_round(self) -> bool:
        return self.half <= self.radius + 0.02

    @property
    def core(self) -> tuple[float, float, float]:
        """Half the sides of the rectangle inside the shape, and how far the shape reaches beyond it everywhere."""
        if self.is_round:
            return 0.0, 0.0, self.radius + self.rim
        return self.half - ROUND, self.radius - ROUND, ROUND + self.rim

    def touched(self, towards: Point, gap: float = 0.0) -> Point:
        """Return where an arrow to or from a point meets the outline."""
        x, y = self.at
        dx = towards[0] - x
        dy = towards[1] - y
        length = math.hypot(dx, dy) or 1.0
        ux = dx / length
        uy = dy / length
        if self.is_round:
            return x + ux * (self.radius + gap), y + uy * (self.radius + gap)
        inside = 0.0
        outside = self.half + self.radius + 2 * gap
        for _ in range(40):  # bisection
            t = (inside + outside) / 2
            qx = abs(ux) * t - (self.half + gap - ROUND)
            qy = abs(uy) * t - (self.radius + gap - ROUND)
            if math.hypot(max(qx, 0.0), max(qy, 0.0)) + min(max(qx, qy), 0.0) > ROUND:
                outside = t
            else:
                inside = t
        return x + ux * inside, y + uy * inside


def ways(a: Spot, b: Spot, both: bool, arrow: bool) -> list[Line]:
    """Return lines from one vertex to another, the usual one first, which bends where another arrow returns."""
    bends = list(BENDS)
    if both:
        bends[:2] = [0.32, 0.0]
    return [_bent(a, b, bend, arrow) for bend in bends]


def _bent(a: Spot, b: Spot, bend: float, arrow: bool) -> Line:
    dx = b.at[0] - a.at[0]
    dy = b.at[1] - a.at[1]
    length = math.hypot(dx, dy) or 1.0
    nx = dy / length * bend
    ny = -dx / length * bend

    def between(p: Point, q: Point) -> tuple[Point, Point]:
        ex = q[0] - p[0]
        ey = q[1] - p[1]
        return (p[0] + ex * 0.3 + nx, p[1] + ey * 0.3 + ny), (p[0] + ex * 0.7 + nx, p[1] + ey * 0.7 + ny)

    c1, c2 = between(a.at, b.at)
    start = a.touched(c1)
    end = b.touched(c2, 0.02 + b.rim)
    if not bend:
        return Line((start, end), arrow=arrow)
    if not (a.is_round and b.is_round):  # wide boxes reach as far as the points that bend the arrow
        c1, c2 = between(start, end)
    return Line((start, c1, c2, end), arrow=arrow, curved=True)


def loops(v: Spot) -> list[Line]:
    """Return loops above, below, right and left of a vertex; in the last column, the one on the right first."""
    x, y = v.at
    d = 0.2
    inset = 0.85 if v.is_round else 1.0
    curves = []
    for sign in (1.0, -1.0):
        far = x + sign * (v.half + LOOP_OUT)
        foot = x + sign * v.half * inset
        curves.append(((foot, y - d), (far, y - LOOP_WIDE), (far, y + LOOP_WIDE), (foot, y + d)))
    for sign in (-1.0, 1.0):
        far = y + sign * (v.radius + LOOP_OUT)
        foot = y + sign * v.radius * inset
        curves.append(((x - d, foot), (x - LOOP_WIDE, far), (x + LOOP_WIDE, far), (x + d, foot)))
    right, left, above, below = (Line(points, arrow=True, curved=True) for points in curves)
    if v.last:
        return [right, above, below, left]
    return [above, below, right, left]


def stubs(v: Spot) -> list[Line]:
    x, y = v.at
    lines = []
    for dx, dy in ((-1, 0), (0, -1), (0, 1), (1, 0)):
        foot = (x + dx * v.half, y + dy * v.radius)
        tail = (x + dx * (v.half + 0.55), y + dy * (v.radius + 0.55))
        lines.append(Line((tail, foot), arrow=True, color="muted"))
    return lines


def routed(
    options: Sequence[Sequence[Line]], ends: Sequence[tuple[int, int]], spots: Sequence[Spot]
) -> tuple[list[Line], int, int]:
    """Return a line for every arrow, how often they cross, and how many pass over a vertex or along one another."""
    flat, groups, of, place = _flattened(options)
    paths = np.array(list(map(sampled, flat)))
    crossings, close = _meetings(paths, of)
    over = _over(paths, [ends[i] for i in of], spots)
    chosen = _descend(groups, OVER * over + BEND * place, crossings + OVER * close)
    inside = np.ix_(chosen, chosen)
    crossed = int(np.triu(crossings[inside], 1).sum())
    faults = int(over[chosen].sum() + np.triu(close[inside], 1).sum())
    return [flat[i] for i in chosen], crossed, faults


def _flattened(options: Sequence[Sequence[T]]) -> tuple[list[T], list[range], np.ndarray, np.ndarray]:
    flat = list(chain.from_iterable(options))
    ends = [0, *accumulate(map(len, options))]
    groups = [range(a, b) for a, b in pairwise(ends)]
    of = np.repeat(np.arange(len(groups)), list(map(len, groups)))
    return flat, groups, of, np.arange(len(flat)) - np.array(ends)[of]


def _descend(groups: Sequence[range], alone: np.ndarray, pair: np.ndarray) -> list[int]:
    """Choose one option of each group by coordinate descent from the first of each."""
    chosen = np.array([g.start for g in groups], dtype=np.int64)
    for _ in range(12):
        before = chosen.copy()
        for i, g in enumerate(groups):
            others = np.delete(chosen, i)
            chosen[i] = g.start + int(np.argmin(alone[g.start : g.stop] + pair[g.start : g.stop][:, others].sum(1)))
        if (before == chosen).all():
            break
    return list(map(int, chosen))


def sampled(line: Line) -> list[Point]:
    """Return points along a line, PIECES + 1 of them."""
    return [line.at(i / PIECES) for i in range(PIECES + 1)]


def _meetings(paths: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return, for every two paths (n, points, 2) of different groups, how often they cross and whether they overlap."""
    n = len(paths)
    low = paths.min(1) - TOUCH
    high = paths.max(1) + TOUCH
    apart = (low[:, None] > high[None]) | (low[None] > high[:, None])
    first, second = np.nonzero(np.triu(~apart.any(2) & (of[:, None] != of[None])))
    crossings = np.zeros((n, n), dtype=np.int64)
    close = np.zeros((n, n), dtype=bool)
    for k in range(0, len(first), CHUNK):
        i = first[k : k + CHUNK]
        j = second[k : k + CHUNK]
        crossings[i, j] = _crossed(paths[i], paths[j])
        close[i, j] = _runs_along(paths[i], paths[j]) | _runs_along(paths[j], paths[i])
    return crossings + crossings.T, close | close.T


def _crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    p = a[:, :-1, None]
    d = np.diff(a, axis=1)[:, :, None]
    q = b[:, None, :-1]
    e = np.diff(b, axis=1)[:, None]
    x = q[..., 0] - p[..., 0]
    y = q[..., 1] - p[..., 1]
    turn = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    turn = np.where(np.abs(turn) < 1e-12, np.nan, turn)  # parallel pieces do not cross
    s = (x * e[..., 1] - y * e[..., 0]) / turn
    t = (x * d[..., 1] - y * d[..., 0]) / turn
    return np.asarray(((s > 0) & (s <= 1) & (t > 0) & (t <= 1)).sum((1, 2)))


def _runs_along(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    d = np.diff(other, axis=1)[:, None]
    to = one[:, 3 : PIECES - 2, None] - other[:, None, :-1]
    u = np.clip((to * d).sum(-1) / np.maximum((d * d).sum(-1), 1e-12), 0, 1)
    off = ((to - u[..., None] * d) ** 2).sum(-1)
    return np.asarray((off.min(2) < TOUCH**2).sum(1) >= 2)


def _over(paths: np.ndarray, ends: Sequence[tuple[int, int]], spots: Sequence[Spot]) -> np.ndarray:
    at = np.array([s.at for s in spots])
    core = np.array([s.core for s in spots])
    parts = np.arange(4)[:, None, None, None] / 4
    fine = paths[None, :, :-1] * (1 - parts) + paths[None, :, 1:] * parts
    off = np.abs(np.moveaxis(fine, 0, 1).reshape(len(paths), -1, 1, 2) - at)
    off = np.maximum(off - core[:, :2], 0.0)
    hit = (np.hypot(off[..., 0], off[..., 1]) < core[:, 2] + MARGIN).any(1)
    for i, own in enumerate(ends):
        hit[i, list(own)] = False
    return np.asarray(hit.sum(1))


# Places of labels.

ARROW = 0.25
STATE = 0.28  # heights of letters beside arrows and states
PAPER = 0.05
MUCH = 0.35  # how far the paper behind a label reaches beyond its letters, and which part of its own arrow it may hide
APART = 0.06  # less room than this between labels, in centimetres, makes one of two
OVERLAP = 20.0
COVER = 1.0
FAR = 0.02  # what it costs to lie over a label, vertex or arrow head, over a line, and further down the list


def box(label: Label) -> tuple[float, float, float, float]:
    """Return left, top, right, bottom of a label's letters."""
    x, y = label.at
    w = text_width(label.text, label.size)
    left = {"start": x, "middle": x - w / 2, "end": x - w}[label.anchor]
    return left, y - 0.5 * label.size, left + w, y + 0.5 * label.size


def placed(
    options: Sequence[Sequence[Label]], own: Sequence[int], lines: Sequence[Line], spots: Sequence[Spot]
) -> tuple[list[Label], int, int]:
    """Return a place for every label, how many overlap, and how many lie over an arrow that is not their own.

    The first labels belong to the arrows whose indices in `lines` are `own`.
    """
    if not options:
        return [], 0, 0
    flat, groups, of, place = _flattened(options)
    boxes = np.array(list(map(box, flat)))
    centre = (boxes[:, 2:] + boxes[:, :2]) / 2
    half = (boxes[:, 2:] - boxes[:, :2]) / 2
    broad = half * (BROAD, 1.0)
    gap = np.abs(centre[:, None] - centre[None]) - broad[:, None] - broad[None]
    pair = (gap < APART).all(2) & (of[:, None] != of[None])
    shapes = np.array(_shapes(lines, spots))
    gap = np.maximum(np.abs(centre[:, None] - shapes[None, :, :2]) - half[:, None] - shapes[None, :, 2:4], 0.0)
    hard = (np.hypot(gap[..., 0], gap[..., 1]) < shapes[:, 4]).sum(1)
    arrow = np.array([*own, *[-1] * (len(options) - len(own))])[of]
    others = np.arange(len(lines)) != arrow[:, None]

    hidden = _hidden(centre, half + np.array([0.0, PAPER]), lines)
    covered = ((hidden > 0) & others).sum(1)
    alone = OVERLAP * hard + COVER * (covered + ((hidden > MUCH) & ~others).any(1)) + FAR * place
    chosen = _descend(groups, alone, OVERLAP * pair)
    overlaps = int(hard[chosen].sum() + np.triu(pair[np.ix_(chosen, chosen)], 1).sum())
    return [flat[i] for i in chosen], overlaps, int(covered[chosen].sum())


def _shapes(lines: Sequence[Line], spots: Sequence[Spot]) -> list[tuple[float, float, float, float, float]]:
    shapes = [(*s.at, *s.core) for s in spots]
    for line in lines:
        if line.arrow:
            (x, y), (ax, ay), (bx, by) = head(line)
            shapes.append(((2 * x + ax + bx) / 4, (2 * y + ay + by) / 4, 0.0, 0.0, 0.06))
    return shapes


def _hidden(centre: np.ndarray, half: np.ndarray, lines: Sequence[Line]) -> np.ndarray:
    coarse = np.array(list(map(sampled, lines))).reshape(-1, PIECES + 1, 2)
    paths = np.concatenate([coarse, (coarse[:, 1:] + coarse[:, :-1]) / 2], axis=1)
    off = np.abs(centre[:, None, None] - paths[None]) - half[:, None, None]
    return np.asarray((off < 0).all(3).mean(2))


def along(line: Line, text: m.Math) -> list[Label]:
    """Return places of an arrow's label: above its middle, then on either side of it and further along."""
    (x0, y0), *_, (x1, y1) = line.points
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    side = 1.0 if line.curved or x1 >= x0 else -1.0
    x, y = line.at(0.5)
    points = [(x + side * (y1 - y0) / length * 0.18, y - side * (x1 - x0) / length * 0.18)]
    w = text_width(text, ARROW) / 2
    h = ARROW / 2
    for t in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8):
        x, y = line.at(t)
        (x0, y0), (x1, y1) = line.at(t - 0.01), line.at(t + 0.01)
        length = math.hypot(x1 - x0, y1 - y0) or 1.0
        nx = (y1 - y0) / length
        ny = -(x1 - x0) / length
        off = abs(nx) * w + abs(ny) * h + 0.06
        points += [(x + nx * off, y + ny * off), (x - nx * off, y - ny * off), (x, y)]
    return [Label(point, text, ARROW, color="muted", halo=True) for point in points]


def at_loop(line: Line, text: m.Math, v: Spot) -> list[Label]:
    _, (x0, y0), (x1, y1), _ = line.points
    x = (x0 + x1) / 2
    y = (y0 + y1) / 2
    length = math.hypot(x - v.at[0], y - v.at[1])
    ux = (x - v.at[0]) / length
    uy = (y - v.at[1]) / length
    w = text_width(text, ARROW) / 2
    outside = (x + ux * (w - 0.08), y + uy * 0.02)
    return [Label(outside, text, ARROW, color="muted", halo=True), *along(line, text)[1:]]


def beside(v: Spot, text: m.Math, row: int, looped: bool) -> list[Label]:
    """Return places of a word on a state: below it, in the last column on its right; then all around."""
    x, y = v.at
    down = 0.4 * row
    side = v.half + v.rim + 0.1
    corner = side - 0.12
    above = RADIUS + v.rim + 0.26
    places: list[tuple[float, float, Anchor]] = [
        (x, y + RADIUS + 0.26 + down, "middle"),
        (x, y + above + down, "middle"),
        (x, y - above - down, "middle"),
        (x + side, y + down, "start"),
        (x - side, y + down, "end"),
    ]
    for sy in (1, -1):
        places += [(x + corner, y + sy * (RADIUS + down), "start"), (x - corner, y + sy * (RADIUS + down), "end")]
    places.append((x + side + LOOP_OUT, y + down, "start"))
    if v.last:
        right = v.half + 0.16 + (LOOP_OUT - 0.2) * looped
        places[0] = (x + right, y + down, "start")
    return [Label((px, py), text, STATE, anchor) for px, py, anchor in places]
