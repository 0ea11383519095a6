"""Which way the arrows of a graph take: straight, bent, or as a loop, so that few cross and none passes over a vertex."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TypeVar

import numpy as np

from taskspec.figures.marks import ROUND, near, outline
from taskspec.figures.scene import Line, Point, bezier

T = TypeVar("T")
BENDS = (0.0, 0.32, -0.32, 0.75, -0.75, 1.2, -1.2)
PIECES = 10
"""Straight pieces by which curves are compared."""
TOUCH = 0.09
"""Arrows nearer than this, in centimetres, cannot be told apart."""
MARGIN = 0.06
"""Room between an arrow and a vertex that it passes, in centimetres."""
CHUNK = 2000
"""Pairs of ways compared at once, which bounds the memory."""
OVER, BEND = 5.0, 0.03
"""What passing over a vertex and another way than the first cost, in crossings."""


@dataclass(frozen=True, slots=True)
class Spot:
    """A vertex where it lies: half its width, half its height, and the room that a second rim takes."""

    at: Point
    half: float
    radius: float
    rim: float = 0.0
    last: bool = False  # in the last column

    @property
    def core(self) -> tuple[float, float, float]:
        """Half the sides of the rectangle inside the shape, and how far the shape reaches beyond it everywhere."""
        if self.half <= self.radius + 0.02:
            return 0.0, 0.0, self.radius + self.rim
        return self.half - ROUND, self.radius - ROUND, ROUND + self.rim

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


def stubs(v: Spot) -> list[Line]:
    """Short arrows to a state in which episodes start: from the left, or from elsewhere."""
    (x, y), out = v.at, 0.55
    left = ((x - v.half - out, y), (x - v.half, y))
    above, below = (((x, y + s * (v.radius + out)), (x, y + s * v.radius)) for s in (-1, 1))
    right = ((x + v.half + out, y), (x + v.half, y))
    return [Line(points, arrow=True, color="muted") for points in (left, above, below, right)]


def routed(options: Sequence[Sequence[Line]], ends: Sequence[tuple[int, int]], spots: Sequence[Spot]) -> Routed:
    """One way for every arrow.

    Args:
        options: ways by arrow, the usual one first.
        ends: the indices in `spots` of each arrow's ends.
        spots: the vertices.
    """
    flat, groups = flattened(options)
    if not flat:
        return Routed((), 0, 0)
    paths = np.array([sampled(line) for line in flat])
    of = np.array([i for i, g in enumerate(groups) for _ in g])
    crossings, along = _meetings(paths, of)
    over = _over(paths, [ends[i] for i in of], spots)
    preference = np.concatenate([BEND * np.arange(len(g)) for g in groups])
    chosen = descend(groups, OVER * over + preference, crossings + OVER * along)
    inside = np.ix_(chosen, chosen)
    crossed, close = (int(np.triu(found[inside], 1).sum()) for found in (crossings, along))
    return Routed(tuple(flat[i] for i in chosen), crossed, int(over[chosen].sum()) + close)


def flattened(options: Sequence[Sequence[T]]) -> tuple[list[T], list[range]]:
    """All options in one list, and where those of each group are."""
    flat = [x for found in options for x in found]
    ends = list(accumulate(map(len, options)))
    return flat, [range(end - len(found), end) for end, found in zip(ends, options, strict=True)]


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


def _meetings(paths: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of every two paths (n, points, 2) of different groups: how often they cross, and whether they run along one another."""
    n = len(paths)
    low, high = paths.min(1) - TOUCH, paths.max(1) + TOUCH
    apart = (low[:, None] > high[None]) | (low[None] > high[:, None])
    first, second = np.nonzero(np.triu(~apart.any(2) & (of[:, None] != of[None])))
    crossings, along = np.zeros((n, n), dtype=np.int64), np.zeros((n, n), dtype=bool)
    for k in range(0, len(first), CHUNK):
        i, j = first[k : k + CHUNK], second[k : k + CHUNK]
        crossings[i, j] = _crossed(paths[i], paths[j])
        along[i, j] = _close(paths[i], paths[j])
    return crossings + crossings.T, along | along.T


def _crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How often the pieces of paths (pairs, points, 2) cross."""
    p, d, q, e = a[:, :-1, None], np.diff(a, axis=1)[:, :, None], b[:, None, :-1], np.diff(b, axis=1)[:, None]
    x, y = q[..., 0] - p[..., 0], q[..., 1] - p[..., 1]
    turn = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    turn = np.where(np.abs(turn) < 1e-12, np.nan, turn)  # parallel pieces do not cross
    s, t = (x * e[..., 1] - y * e[..., 0]) / turn, (x * d[..., 1] - y * d[..., 0]) / turn
    return np.asarray(((s > 0) & (s <= 1) & (t > 0) & (t <= 1)).sum((1, 2)))


def _close(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Whether the middle of one of two paths (pairs, points, 2) runs along the other."""
    found = np.zeros(len(a), dtype=bool)
    for one, other in ((a, b), (b, a)):
        p, d = other[:, None, :-1], np.diff(other, axis=1)[:, None]
        to = one[:, 3 : PIECES - 2, None] - p
        x, y, dx, dy = to[..., 0], to[..., 1], d[..., 0], d[..., 1]
        u = np.clip((x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0, 1)
        off = (x - u * dx) ** 2 + (y - u * dy) ** 2
        found |= (off.min(2) < TOUCH**2).sum(1) >= 2
    return found


def _over(paths: np.ndarray, ends: Sequence[tuple[int, int]], spots: Sequence[Spot]) -> np.ndarray:
    """How many vertices each path (n, points, 2) passes over, besides its ends."""
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
