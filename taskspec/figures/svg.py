"""Scenes as SVG. Colours are attributes that a page's style sheet may override by class."""

from __future__ import annotations

from html import escape
from typing import assert_never

from taskspec.base.display import ON_PAGES, visible
from taskspec.figures import scene as sc
from taskspec.figures.scene import Area, Box, Circle, Item, Label, Line, hex_color
from taskspec.printers import tree as m
from taskspec.printers.text import plain

SCALE = 38.0  # pixels in a centimetre
_FONTS = {
    "serif": "'Latin Modern Math','STIX Two Math','Cambria Math','DejaVu Serif',serif",
    "sans": "'DejaVu Sans',Verdana,'Segoe UI',Helvetica,Arial,sans-serif",
}
_DASHES: dict[sc.Dash, tuple[float, ...]] = {
    "solid": (), "dashed": (0.1, 0.08), "dotted": (0.03, 0.06), "dashdot": (0.14, 0.06, 0.03, 0.06),
}  # fmt: skip
"""Lengths of strokes and gaps in centimetres."""


def svg(scene: sc.Scene, css: bool = False, kind: str = "figure") -> str:
    """Return an SVG picture."""
    width = _n(scene.width)
    height = _n(scene.height)
    body = "".join(_item(item) for item in scene.items)
    paper = "" if css else f'<rect width="{width}" height="{height}" fill="{hex_color("paper")}"/>'
    font = escape(_FONTS[scene.font])
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'class="{kind}" font-family="{font}"><title>{escape(scene.alt)}</title>{paper}{body}</svg>'
    )
    return visible(text, ON_PAGES)


def _n(value: float) -> str:
    return f"{value * SCALE:.1f}".removesuffix(".0")


def _point(p: sc.Point) -> str:
    return f"{_n(p[0])},{_n(p[1])}"


def _item(item: Item) -> str:
    match item:
        case Circle(centre=(x, y), radius=r):
            return f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(r)}"{_paint(item)}/>'
        case Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = f' rx="{_n(corner)}"' if corner else ""
            place = f'x="{_n(x)}" y="{_n(y)}" width="{_n(w)}" height="{_n(h)}"'
            return f"<rect {place}{rounded}{_paint(item)}/>"
        case Area(points=points):
            return f'<polygon points="{" ".join(map(_point, points))}"{_paint(item)}/>'
        case Line():
            return _line(item)
        case Label():
            return _label(item)
        case _:
            assert_never(item)


def _class(part: str, paint: sc.Paint) -> str:
    return "" if paint.startswith("#") else f"{part}-{paint}"


def _paint(item: Circle | Box | Area) -> str:
    classes = [_class(part, paint) for part, paint in (("fill", item.fill), ("line", item.line)) if paint is not None]
    inside = "none" if item.fill is None else hex_color(item.fill)
    faded = f' fill-opacity="{item.shade:.2f}"' if item.fill and item.shade < 1 else ""
    edge = f' stroke="{hex_color(item.line)}" stroke-width="{_n(0.032)}"' if item.line else ""
    return f' class="{" ".join(filter(None, classes))}" fill="{inside}"{faded}{edge}'


def _line(line: Line) -> str:
    first, *others = map(_point, sc.shaft(line))
    path = f"M{first} C{' '.join(others)}" if line.curved else f"M{first} {' '.join(f'L{p}' for p in others)}"
    dashes = " ".join(_n(length) for length in _DASHES[line.dash])
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    faded = f' stroke-opacity="{line.shade:.2f}"' if line.shade < 1 else ""
    color = f'class="{_class("line", line.color)}" stroke="{hex_color(line.color)}"'
    out = f'<path d="{path}" fill="none" {color} stroke-width="{_n(line.width)}" stroke-linejoin="round"{dash}{faded}/>'
    if line.arrow:
        tip = " ".join(map(_point, sc.head(line)))
        out += f'<polygon points="{tip}" class="{_class("fill", line.color)}" fill="{hex_color(line.color)}"/>'
    return out


def _label(label: Label) -> str:
    x, y = label.at
    fill = _class("fill", label.color)
    halo = f' stroke="{hex_color("paper")}" stroke-width="{_n(0.12)}" paint-order="stroke" class="halo {fill}"'
    style = halo if label.halo else f' class="{fill}"'
    turned = f' transform="rotate({-label.angle:g} {_n(x)} {_n(y)})"' if label.angle else ""
    weight = ' font-weight="bold"' if label.bold else ""
    place = f'x="{_n(x)}" y="{_n(y + label.size * 0.34)}" font-size="{_n(label.size)}" text-anchor="{label.anchor}"'
    return f'<text {place} fill="{hex_color(label.color)}"{style}{weight}{turned}>{runs(label.text)}</text>'


def runs(tree: m.Math) -> str:
    """Return mathematics as pieces of text: letters in italics, scripts smaller and shifted."""
    match tree:
        case m.Ident(text=text, style="italic"):
            return f'<tspan font-style="italic">{escape(text)}</tspan>'
        case m.Row(items=items):
            return "".join(runs(item) for item in items)
        case m.Fence(left=left, body=body, right=right):
            return escape(left) + runs(body) + escape(right)
        case m.Script(base=base, sub=sub, sup=sup, primes=primes):
            out = runs(base) + "′" * primes
            for part, dy in ((sub, 0.28), (sup, -0.35)):
                if part is not None:
                    out += f'<tspan dy="{dy}em" font-size="70%">{runs(part)}</tspan><tspan dy="{-dy * 0.7:.3f}em">\u200b</tspan>'
            return out
        case _:
            return escape(plain(tree))
