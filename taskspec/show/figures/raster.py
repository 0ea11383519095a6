"""Scenes as pixels and PDF, through matplotlib, which brings its own fonts."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any, assert_never

import numpy as np

from taskspec.base.extras import need
from taskspec.base.files import write_bytes
from taskspec.show.figures import chart
from taskspec.show.figures.shapes import COLORS, Box, Circle, Label, Line, Scene, head, shaft
from taskspec.show.printers import tree as m
from taskspec.show.printers.text import plain

INCH = 2.54
FONTS = ["DejaVu Serif", "DejaVu Sans"]  # both come with matplotlib; the second has the signs that the first lacks
DPI = 200
DASHES = (0, (3, 2))
TITLE = 0.2
LINE = 0.4  # room for words above a frame and for each line of them, in centimetres
LEAST_SCALE = 0.6
LARGEST_SCALE = 1.6
OVERLAP = 2.5  # centimetres that are seen on two pages, where a frame has no room for all


def save(scene: Scene, path: Path, kind: str) -> None:
    """Write a PNG or PDF file; the same scene gives the same bytes."""
    figure, axes = _canvas(scene.width, scene.height)
    axes.set_xlim(0, scene.width)
    axes.set_ylim(scene.height, 0)
    _draw(axes, scene, 1.0)
    picture = BytesIO()
    with chart.quiet():
        figure.savefig(picture, format=kind, dpi=DPI, metadata=chart.METADATA[kind])
    write_bytes(path, picture.getvalue())


def pixels(scene: Scene, size: tuple[int, int], title: str = "") -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return the picture as an array (height, width, 3) of uint8, as large as fits in the middle of `size` = (width, height).

    If its words would be too small to read, the part of it is shown that holds its focus.
    """
    width, height = np.multiply(size, INCH / DPI).tolist()
    room = height
    if title:
        room -= TITLE + LINE * len(title.split("\n"))
    scale = min(width / scene.width, room / scene.height, LARGEST_SCALE)
    x, y = scene.focus or (0.0, 0.0)
    if scene.focus is not None:
        scale = max(scale, LEAST_SCALE)
    figure, axes = _canvas(width, height)
    left = _first(width / scale, scene.width, x)
    top = _first(room / scale, scene.height, y) - (height - room) / scale
    axes.set_xlim(left, left + width / scale)
    axes.set_ylim(top + height / scale, top)
    _draw(axes, scene, scale)
    if title:
        place = {"transform": axes.transAxes, "ha": "left", "va": "top"}
        axes.text(0.02, 0.98, title, fontsize=9, family=FONTS, parse_math=False, **place)
    with chart.quiet():
        figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()


def _first(room: float, size: float, focus: float) -> float:
    """Return the start of the visible part of a length: all of it in the middle, or else the page with the focus."""
    if size <= room + 1e-9:
        return (size - room) / 2
    step = room - OVERLAP
    page = max(0.0, (focus - OVERLAP / 2) // step)
    return min(page * step, size - room)


def _canvas(width: float, height: float) -> tuple[Any, Any]:
    figure = need("matplotlib.figure", "figures").Figure(figsize=(width / INCH, height / INCH), dpi=DPI)
    need("matplotlib.backends.backend_agg", "figures").FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    return figure, axes


def _draw(axes: Any, scene: Scene, scale: float) -> None:
    patches = need("matplotlib.patches", "figures")
    points = 72 / INCH * scale  # a centimetre in points
    for order, item in enumerate(scene.items):
        match item:
            case Circle(centre=centre, radius=r):
                axes.add_patch(patches.Circle(centre, r, zorder=order, **_paint(item)))
            case Box(corner=(x, y), width=w, height=h, round=corner):
                style = "square,pad=0"
                if corner:
                    style = f"round,pad=0,rounding_size={corner}"
                axes.add_patch(patches.FancyBboxPatch((x, y), w, h, boxstyle=style, zorder=order, **_paint(item)))
            case Line():
                stroke: dict[str, Any] = {"edgecolor": COLORS[item.color], "linewidth": item.width * points}
                if item.is_dashed:
                    stroke["linestyle"] = DASHES
                axes.add_patch(patches.PathPatch(_path(item), fill=False, zorder=order, **stroke))
                if item.arrow:
                    tip = patches.Polygon(head(item), facecolor=COLORS[item.color], edgecolor="none", zorder=order)
                    axes.add_patch(tip)
            case Label(at=(x, y), anchor=anchor):
                side = {"start": "left", "middle": "center", "end": "right"}[anchor]
                halo = None
                if item.halo:
                    halo = {"facecolor": COLORS["paper"], "edgecolor": "none", "pad": 0.6}
                axes.text(x, y, mathtext(item.text), fontsize=item.size * points * 0.95, ha=side, va="center_baseline",
                          color=COLORS[item.color], zorder=order, family=FONTS, math_fontfamily="cm", bbox=halo)  # fmt: skip
            case _:
                assert_never(item)


def _path(line: Line) -> Any:
    kind = 2  # of the points after the first: ends of straight lines, or of a Bézier curve
    if line.curved:
        kind = 4
    return need("matplotlib.path", "figures").Path(shaft(line), [1] + [kind] * (len(line.points) - 1))


def _paint(item: Circle | Box) -> dict[str, Any]:
    colors = need("matplotlib.colors", "figures")
    face = "none"
    if item.fill is not None:
        face = colors.to_rgba(COLORS[item.fill], item.shade)
    edge = COLORS[item.line] if item.line is not None else "none"
    return {"facecolor": face, "edgecolor": edge, "linewidth": 0.9}


def mathtext(tree: m.Math) -> str:
    """Return a label in matplotlib's notation: letters and scripts as mathematics, the rest as text."""
    match tree:
        case m.Ident(text=text, style="italic") if text.isalpha():
            return f"${text}$"
        case m.Script(base=base, sub=sub, sup=None, primes=primes) if sub is not None:
            return f"${_inside(base)}_{{{_inside(sub)}}}{chr(39) * primes}$"
        case m.Row(items=items):
            return "".join(map(mathtext, items))
        case _:
            return plain(tree).replace("$", r"\$")


def _inside(tree: m.Math) -> str:
    text = plain(tree)
    if text.isalnum():
        return text
    return r"\mathrm{?}"
