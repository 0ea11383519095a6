"""Which way the arrows of a graph take: straight, bent, or as a loop, so that few cross and none passes over a vertex."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from taskspec.appendix.figures.marks import near, outline
from taskspec.appendix.figures.scene import Line, Point, bezier

BENDS = (0.0, 0.32, -0.32, 0.75, -0.75, 1.2, -1.2)
PIECES = 10
"""Straight pieces by which curves are compared."""
TOUCH = 0.09
"""Arrows nearer than this, in centimetres, cannot be told apart."""
OVER, BEND = 5.0, 0.03
"""What passing over a vertex and another way than the first cost, in crossings."""


@dataclass(frozen=True, slots=True)
class Spot:
    """A vertex where it lies: half its width, half its height, and the room that a second rim takes."""

    at: Point
    half: float
    radius: float
    rim: float = 0.0
    last: bool = field(default=False)

    def touched(self, towards: Point, gap: float = 0.0) -> Point:
        """Where an arrow to or from a point meets the outline."""
        return outline(self.at, towards, self.half + gap, self.radius + gap)


@dataclass(frozen=True, slots=True)
class Routed:
    lines: tuple[Line, ...]
    crossings: int
    over: int  # pairs of an arrow and a vertex that it passes over, or of arrows that run into one


def ways(a: Spot, b: Spot, both: bool, others: Sequence[Spot], arrow: bool, stretch: float) -> list[Line]:
    """Ways from one vertex to another, the usual one first: bent where an arrow comes back or a vertex is in the way."""
    blocked = any(near(a.at, b.at, o.at) for o in others)
    usual = 0.32 if both else 0.75 if blocked else 0.0
    return [_bent(a, b, bend, arrow) for bend in dict.fromkeys((usual, *(stretch * x for x in BENDS)))]


def _bent(a: Spot, b: Spot, bend: float, arrow: bool) -> Line:
    dx, dy = b.at[0] - a.at[0], b.at[1] - a.at[1]
    length = math.hypot(dx, dy) or 1.0
    nx, ny = dy / length * bend, -dx / length * bend

    def between(p: Point, q: Point) -> tuple[Point, Point]:
        ex, ey = q[0] - p[0], q[1] - p[1]
        return (p[0] + ex * 0.3 + nx, p[1] + ey * 0.3 + ny), (p[0] + ex * 0.7 + nx, p[1] + ey * 0.7 + ny)

    c1, c2 = between(a.at, b.at)
    start, end = a.touched(c1), b.touched(c2, 0.02 + b.rim)
    if not bend:
        return Line((start, end), arrow=arrow)
    if max(a.half - a.radius, b.half - b.radius) > 0.02:  # wide boxes reach as far as the points that bend the arrow
        c1, c2 = between(start, end)
    return Line((start, c1, c2, end), arrow=arrow, curved=True)


LOOP_OUT, LOOP_WIDE = 0.62, 0.42


def loops(v: Spot) -> list[Line]:
    """Loops above, below, right and left of a vertex; in the last column, the one on the right first."""
    (x, y), d, out, wide = v.at, 0.2, LOOP_OUT, LOOP_WIDE
    found = []
    for sign in (1.0, -1.0):
        r = v.half * 0.85 if v.half - v.radius <= 0.02 else v.half
        far, foot = x + sign * (v.half + out), x + sign * r
        found.append(((foot, y - d), (far, y - wide), (far, y + wide), (foot, y + d)))
    for sign in (-1.0, 1.0):
        far, foot = y + sign * (v.radius + out), y + sign * v.radius * (0.85 if v.half - v.radius <= 0.02 else 1.0)
        found.append(((x - d, foot), (x - wide, far), (x + wide, far), (x + d, foot)))
    right, left, above, below = found
    order = (right, above, below, left) if v.last else (above, below, right, left)
    return [Line(points, arrow=True, curved=True) for points in order]


def routed(options: Sequence[Sequence[Line]], ends: Sequence[tuple[int, int]], fixed: Sequence[Line],
           spots: Sequence[Spot]) -> Routed:  # fmt: skip
    """One way for every arrow.

    Args:
        options: ways by arrow, the usual one first.
        ends: the indices in `spots` of each arrow's ends.
        fixed: lines that are there anyway.
        spots: the vertices.
    """
    flat = [line for found in options for line in found] + list(fixed)
    groups, first = [], 0
    for found in options:
        groups.append(range(first, first + len(found)))
        first += len(found)
    paths = np.array([sampled(line) for line in flat]).reshape(len(flat), PIECES + 1, 2)
    crossings, along = _meetings(paths)
    owner = np.array([i for i, g in enumerate(groups) for _ in g] + [-1] * len(fixed), dtype=np.int64)
    over = _over(paths[:first], [ends[i] for i in owner[:first]], spots)
    preference = np.concatenate([BEND * np.arange(len(g)) for g in groups] or [np.zeros(0)])
    pair = (crossings + OVER * along).astype(float)
    alone = OVER * over + preference + pair[:first, first:].sum(1)
    chosen = descend(groups, alone, pair[:first, :first])
    kept = [*chosen, *range(first, len(flat))]
    inside = np.ix_(kept, kept)
    total = np.triu(crossings[inside], 1).sum()
    return Routed(tuple(flat[i] for i in chosen), int(total), int(over[chosen].sum() + np.triu(along[inside], 1).sum()))


def descend(groups: Sequence[range], alone: np.ndarray, pair: np.ndarray) -> list[int]:
    """One option of each group: the first of each, then the best given the others, group by group, while that helps.

    Args:
        groups: indices of options by group.
        alone: cost of each option, (options,).
        pair: cost of two options together, (options, options), symmetric.
    """
    chosen = np.array([g.start for g in groups], dtype=np.int64)
    for _ in range(12):
        before = chosen.copy()
        for i, g in enumerate(groups):
            others = np.delete(chosen, i)
            chosen[i] = g.start + int(np.argmin(alone[g.start : g.stop] + pair[g.start : g.stop][:, others].sum(1)))
        if (before == chosen).all():
            break
    return [int(i) for i in chosen]


def sampled(line: Line) -> list[Point]:
    """Points along a line, PIECES + 1 of them."""
    if line.curved:
        return [bezier(line.points, i / PIECES) for i in range(PIECES + 1)]
    (x0, y0), (x1, y1) = line.points[0], line.points[-1]
    return [(x0 + (x1 - x0) * i / PIECES, y0 + (y1 - y0) * i / PIECES) for i in range(PIECES + 1)]


def _meetings(paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of every two paths (n, points, 2): how often they cross, and whether they run along one another."""
    n = len(paths)
    crossings, along = np.zeros((n, n), dtype=np.int64), np.zeros((n, n), dtype=bool)
    a, d = paths[:, :-1], np.diff(paths, axis=1)
    size = np.maximum((d * d).sum(2), 1e-12)
    middle = paths[:, 3 : PIECES - 2]
    for i in range(n):  # row by row, which bounds the memory
        p, e = a[i][:, None, None], d[i][:, None, None]
        to = a[None] - p  # (pieces of i, paths, pieces, 2)
        turn = e[..., 0] * d[None, ..., 1] - e[..., 1] * d[None, ..., 0]
        turn = np.where(np.abs(turn) < 1e-12, np.inf, turn)
        s = (to[..., 0] * d[None, ..., 1] - to[..., 1] * d[None, ..., 0]) / turn
        t = (to[..., 0] * e[..., 1] - to[..., 1] * e[..., 0]) / turn
        meet = (s > 0) & (s <= 1) & (t > 0) & (t <= 1) & np.isfinite(turn)
        crossings[i] = meet.sum((0, 2))
        q = middle[i][:, None, None] - a[None]
        u = np.clip((q * d[None]).sum(3) / size, 0, 1)
        off = q - u[..., None] * d[None]
        along[i] = ((off**2).sum(3).min(2) < TOUCH**2).sum(0) >= 2
    np.fill_diagonal(crossings, 0)
    np.fill_diagonal(along, val=False)
    return np.maximum(crossings, crossings.T), along | along.T


def _over(paths: np.ndarray, ends: Sequence[tuple[int, int]], spots: Sequence[Spot]) -> np.ndarray:
    """How many vertices each path (n, points, 2) passes over, besides its ends."""
    at = np.array([s.at for s in spots])
    core = np.array([(max(s.half - s.radius, 0.0), s.radius + s.rim + 0.06) for s in spots])
    parts = np.arange(4)[:, None, None, None] / 4
    fine = paths[None, :, :-1] * (1 - parts) + paths[None, :, 1:] * parts
    off = np.abs(np.moveaxis(fine, 0, 1).reshape(len(paths), -1, 1, 2) - at)
    dx = np.maximum(off[..., 0] - core[:, 0], 0.0)
    hit = (np.hypot(dx, off[..., 1]) < core[:, 1]).any(1)
    for i, own in enumerate(ends):
        hit[i, list(own)] = False
    return np.asarray(hit.sum(1))
