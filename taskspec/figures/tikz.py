"""Scenes as TikZ, for papers: the colours of roles are named, so that a paper may redefine them."""

from __future__ import annotations

from typing import assert_never

from taskspec.figures import scene as sc
from taskspec.figures.scene import Area, Box, Circle, Item, Label, Line
from taskspec.printers.markup import latex


def tikz(scene: sc.Scene, scale: float = 1.0) -> str:
    """Return a `tikzpicture`; the names of its colours are those of `colors`."""
    body = "\n".join(f"  {_item(item)}" for item in scene.items)
    options = f"x={scale:g}cm, y=-{scale:g}cm, line width=0.7pt, line join=round"
    return f"\\begin{{tikzpicture}}[{options}]\n{body}\n\\end{{tikzpicture}}"


def colors() -> str:
    """Return definitions of the named colours."""
    return "\n".join(rf"\definecolor{{task{role}}}{{HTML}}{{{code[1:].upper()}}}" for role, code in sc.COLORS.items())


def _n(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _point(p: sc.Point) -> str:
    return f"({_n(p[0])}, {_n(p[1])})"


def _item(item: Item) -> str:
    match item:
        case Circle(centre=centre, radius=r):
            return rf"\path[{_paint(item)}] {_point(centre)} circle [radius={_n(r)}];"
        case Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = f", rounded corners={_n(corner * 28)}pt" if corner else ""
            corners = f"{_point((x, y))} rectangle {_point((x + w, y + h))}"
            return rf"\path[{_paint(item)}{rounded}] {corners};"
        case Area(points=points):
            return rf"\path[{_paint(item)}] {' -- '.join(map(_point, points))} -- cycle;"
        case Line():
            return _line(item)
        case Label(at=at, text=text, color=color):
            anchor = {"start": "west", "end": "east", "middle": "center"}[item.anchor]
            halo = ", fill=taskpaper" if item.halo else ""
            turned = f", rotate={item.angle:g}" if item.angle else ""
            size = r"\footnotesize" if item.size < 0.34 else r"\small"
            options = f"anchor={anchor}, inner sep=1pt, text={_color(color)}, font={size}{halo}{turned}"
            return rf"\node[{options}] at {_point(at)} {{${latex(text)}$}};"
        case _:
            assert_never(item)


def _color(paint: sc.Paint) -> str:
    """Return the name of a role's colour, or a colour by its parts."""
    if not paint.startswith("#"):
        return f"task{paint}"
    red, green, blue = bytes.fromhex(paint[1:])
    return f"{{rgb,255:red,{red};green,{green};blue,{blue}}}"


def _paint(item: Circle | Box | Area) -> str:
    parts = []
    if item.fill:
        strength = f"!{round(100 * item.shade)}!taskpaper" if item.shade < 1 else ""
        parts.append(f"fill={_color(item.fill)}{strength}")
    if item.line:
        parts.append(f"draw={_color(item.line)}")
    return ", ".join(parts)


def _line(line: Line) -> str:
    points = sc.shaft(line)
    dash = "" if line.dash == "solid" else f", {line.dash.replace('dashdot', 'dash dot')}"
    thick = f", line width={_n(line.width * 23)}pt"
    if line.curved:
        a, b, c, d = points
        path = f"{_point(a)} .. controls {_point(b)} and {_point(c)} .. {_point(d)}"
    else:
        path = " -- ".join(map(_point, points))
    out = rf"\draw[{_color(line.color)}{dash}{thick}] {path};"
    if line.arrow:
        out += rf" \fill[{_color(line.color)}] {' -- '.join(map(_point, sc.head(line)))} -- cycle;"
    return out
