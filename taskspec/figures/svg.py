"""Scene -> SVG. Colours are attributes that a page's style sheet may override by class."""

from __future__ import annotations

from html import escape
from typing import assert_never

from taskspec.base.display import ON_PAGES, visible
from taskspec.figures.scene import Box, Circle, Color, Item, Label, Line, Point, Scene, head, shaft
from taskspec.printers import tree as m
from taskspec.printers.text import plain

SCALE = 38.0
COLORS: dict[Color, str] = {
    "ink": "#1f2933", "muted": "#6b7785", "faint": "#c3cad2", "paper": "#ffffff", "good": "#b7e4bf", "bad": "#f3a6a0",
    "end": "#d5d9de", "accent": "#7aa7e0", "second": "#f2bd74",
}  # fmt: skip
_FONT = "'Latin Modern Math','STIX Two Math','Cambria Math','DejaVu Serif',serif"


def svg(scene: Scene, css: bool = False) -> str:
    """An SVG picture.

    Args:
        scene: what to draw.
        css: for a page whose style sheet gives the colours; otherwise they are fixed, on white.
    """
    w, h = _n(scene.width), _n(scene.height)
    body = "".join(_item(item) for item in scene.items)
    paper = "" if css else f'<rect width="{w}" height="{h}" fill="{COLORS["paper"]}"/>'
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" role="img" '
        f'class="figure" font-family="{escape(_FONT, quote=True)}"><title>{escape(scene.alt)}</title>{paper}{body}</svg>'
    )
    return visible(text, ON_PAGES)


def _n(value: float) -> str:
    return f"{value * SCALE:.1f}".removesuffix(".0")


def _point(p: Point) -> str:
    return f"{_n(p[0])},{_n(p[1])}"


def _item(item: Item) -> str:
    match item:
        case Circle(centre=(x, y), radius=r):
            return f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(r)}"{_paint(item.fill, item.line, item.shade)}/>'
        case Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = f' rx="{_n(corner)}"' if corner else ""
            place = f'x="{_n(x)}" y="{_n(y)}" width="{_n(w)}" height="{_n(h)}"'
            return f"<rect {place}{rounded}{_paint(item.fill, item.line, item.shade)}/>"
        case Line():
            return _line(item)
        case Label():
            return _label(item)
        case _:
            assert_never(item)


def _paint(fill: Color | None, line: Color | None, shade: float = 1.0) -> str:
    classes = " ".join(([f"fill-{fill}"] if fill else []) + ([f"line-{line}"] if line else []))
    inside = f' fill="{COLORS[fill]}"' if fill else ' fill="none"'
    faded = f' fill-opacity="{shade:.2f}"' if fill and shade < 1 else ""
    edge = f' stroke="{COLORS[line]}" stroke-width="{_n(0.032)}"' if line else ""
    return f' class="{classes}"{inside}{faded}{edge}'


def _line(line: Line) -> str:
    points = shaft(line)
    path = f"M{_point(points[0])} " + (
        f"C{' '.join(map(_point, points[1:]))}" if line.curved else " ".join(f"L{_point(p)}" for p in points[1:])
    )
    dash = f' stroke-dasharray="{_n(0.1)} {_n(0.08)}"' if line.dashed else ""
    color = f'class="line-{line.color}" stroke="{COLORS[line.color]}"'
    out = f'<path d="{path}" fill="none" {color} stroke-width="{_n(line.width)}" stroke-linejoin="round"{dash}/>'
    if line.arrow:
        tip = " ".join(map(_point, head(line)))
        out += f'<polygon points="{tip}" class="fill-{line.color}" fill="{COLORS[line.color]}"/>'
    return out


def _label(label: Label) -> str:
    x, y = label.at
    halo = f' stroke="{COLORS["paper"]}" stroke-width="{_n(0.12)}" paint-order="stroke" class="halo fill-{label.color}"'
    style = halo if label.halo else f' class="fill-{label.color}"'
    place = f'x="{_n(x)}" y="{_n(y + label.size * 0.34)}" font-size="{_n(label.size)}" text-anchor="{label.anchor}"'
    return f'<text {place} fill="{COLORS[label.color]}"{style}>{runs(label.text)}</text>'


def runs(tree: m.Math) -> str:
    """Mathematics as pieces of text: letters in italics, scripts smaller and shifted."""
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
