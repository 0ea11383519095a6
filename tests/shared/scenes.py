"""Shapes of figures by kind and looks, and whether a figure can be read, with the letters of a real font."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from taskspec.show.figures.raster import FONTS, mathtext
from taskspec.show.figures.shapes import Box, Circle, Item, Label, Line, Scene
from taskspec.show.printers.text import plain

FONT = FontProperties(family=FONTS)
Array = np.ndarray[Any, Any]
Frame = tuple[float, float, float, float]
Shape = TypeVar("Shape", bound=Item)


def boxes(found: Scene, **looks: object) -> list[Box]:
    return _chosen(found, Box, looks)


def circles(found: Scene, **looks: object) -> list[Circle]:
    return _chosen(found, Circle, looks)


def lines(found: Scene, **looks: object) -> list[Line]:
    return _chosen(found, Line, looks)


def labels(found: Scene, **looks: object) -> list[Label]:
    return _chosen(found, Label, looks)


def _chosen(found: Scene, kind: type[Shape], looks: dict[str, object]) -> list[Shape]:
    """Shapes of one kind, from back to front, whose attributes have these values."""
    chosen = []
    for item in found.items:
        if isinstance(item, kind) and all(getattr(item, name) == look for name, look in looks.items()):
            chosen.append(item)
    return chosen


def words(found: Scene) -> list[str]:
    return [plain(label.text).strip() for label in labels(found)]


def told(found: Scene) -> str:
    return " ".join(words(found))


def places(shapes: Sequence[Item]) -> Array:
    """(shape, 2): centres of circles, upper left corners of boxes, places of labels; (line, point, 2) for lines."""
    found = []
    for item in shapes:
        match item:
            case Label(at=place) | Circle(centre=place) | Box(corner=place) | Line(points=place):
                found.append(place)
    return np.array(found)


@cache
def letters(label: Label) -> Frame:
    """Left, top, right, bottom of the ink of a label, in centimetres."""
    (x, y) = label.at
    path = TextPath((0, 0), mathtext(label.text), size=label.size, prop=FONT).get_extents()
    left = {"start": x, "middle": x - path.width / 2, "end": x - path.width}[label.anchor]
    base = y + 0.34 * label.size
    return left, base - path.y1, left + path.width, base - path.y0


def extent(item: Item) -> Frame:
    match item:
        case Label():
            return letters(item)
        case Circle(centre=(x, y), radius=r):
            return x - r, y - r, x + r, y + r
        case Box(corner=(x, y), width=w, height=h):
            return x, y, x + w, y + h
        case Line(points=points):
            xs, ys = np.transpose((points[0], points[-1]) if item.curved else points)
            return xs.min(), ys.min(), xs.max(), ys.max()


def overlapping(found: Scene) -> list[tuple[str, str]]:
    """Labels whose letters lie over one another."""
    pairs = []
    for one, other in combinations(labels(found), 2):
        left, top, right, bottom = letters(one)
        x0, y0, x1, y1 = letters(other)
        if left < x1 and x0 < right and top < y1 and y0 < bottom:
            pairs.append((plain(one.text), plain(other.text)))
    return pairs


def outside(found: Scene) -> list[Item]:
    """What leaves the frame."""
    beyond = []
    for item in found.items:
        left, top, right, bottom = extent(item)
        if min(left, top) < -1e-6 or right > found.width + 1e-6 or bottom > found.height + 1e-6:
            beyond.append(item)
    return beyond


def legible(found: Scene | None) -> Scene:
    """A scene, in which no words overlap and nothing leaves the frame."""
    assert found is not None
    assert overlapping(found) == outside(found) == []
    return found
