"""Scene -> pixels and PDF, through matplotlib, which brings its own fonts."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.appendix.extras import need
from taskspec.appendix.figures.scene import Box, Circle, Item, Label, Line, Scene, head, shaft
from taskspec.appendix.figures.svg import COLORS
from taskspec.printers import tree as m
from taskspec.printers.plain import plain

INCH = 2.54
FONTS = ["DejaVu Serif", "DejaVu Sans"]  # both come with matplotlib; the second has the signs that the first lacks
DPI = 200


def save(scene: Scene, path: Path, kind: str) -> None:
    """Write a PNG or PDF file; the same scene gives the same bytes."""
    figure = _figure(scene)
    metadata: dict[str, Any] = {"CreationDate": None} if kind == "pdf" else {"Software": None}
    with _quiet():
        figure.savefig(path, format=kind, dpi=DPI, metadata=metadata)


def pixels(scene: Scene, dpi: int = 100) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """The picture as an array (height, width, 3) of uint8."""
    agg = need("matplotlib.backends.backend_agg", "figures")
    figure = _figure(scene)
    figure.set_dpi(dpi)
    canvas = agg.FigureCanvasAgg(figure)
    with _quiet():
        canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


@contextmanager
def _quiet() -> Iterator[None]:
    """Without warnings about letters that no font has; they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        yield


def _figure(scene: Scene) -> Any:
    module, backend = need("matplotlib.figure", "figures"), need("matplotlib.backends.backend_agg", "figures")
    figure = module.Figure(figsize=(scene.width / INCH, scene.height / INCH))
    backend.FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, scene.width)
    axes.set_ylim(scene.height, 0)
    axes.axis("off")
    for order, item in enumerate(scene.items):
        _draw(axes, item, order)
    return figure


def _draw(axes: Any, item: Item, order: int) -> None:
    patches, paths = need("matplotlib.patches", "figures"), need("matplotlib.path", "figures")
    points = 72 / INCH  # a centimetre in points
    match item:
        case Circle(centre=centre, radius=r):
            axes.add_patch(patches.Circle(centre, r, zorder=order, **_paint(item)))
        case Box(corner=(x, y), width=w, height=h, round=corner):
            style = f"round,pad=0,rounding_size={corner}" if corner else "square,pad=0"
            axes.add_patch(patches.FancyBboxPatch((x, y), w, h, boxstyle=style, zorder=order, **_paint(item)))
        case Line():
            codes = [1, 4, 4, 4] if item.curved else [1] + [2] * (len(item.points) - 1)
            path = paths.Path(shaft(item), codes)
            dashes: Any = (0, (3, 2)) if item.dashed else "solid"
            axes.add_patch(patches.PathPatch(path, fill=False, edgecolor=COLORS[item.color], zorder=order,
                                             linewidth=item.width * points, linestyle=dashes))  # fmt: skip
            if item.arrow:
                axes.add_patch(patches.Polygon(head(item), facecolor=COLORS[item.color], edgecolor="none", zorder=order))
        case Label(at=(x, y), anchor=anchor):
            side = {"start": "left", "middle": "center", "end": "right"}[anchor]
            axes.text(x, y, mathtext(item.text), fontsize=item.size * points * 0.95, ha=side, va="center_baseline",
                      color=COLORS[item.color], zorder=order, family=FONTS, math_fontfamily="cm")  # fmt: skip


def _paint(item: Circle | Box) -> dict[str, Any]:
    matplotlib = need("matplotlib.colors", "figures")
    face = "none" if item.fill is None else matplotlib.to_rgba(COLORS[item.fill], item.shade)
    edge = "none" if item.line is None else COLORS[item.line]
    return {"facecolor": face, "edgecolor": edge, "linewidth": 0.9}


def mathtext(tree: m.Math) -> str:
    """A label in the notation that matplotlib draws: letters and scripts as mathematics, the rest as text."""
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
    return text if text.isalnum() else r"\mathrm{?}"
