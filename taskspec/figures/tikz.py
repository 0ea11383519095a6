"""Scene -> TikZ, for papers: the colours are named, so that a paper may redefine them."""

from __future__ import annotations

from typing import assert_never

from taskspec.figures.scene import Box, Circle, Color, Item, Label, Line, Point, Scene, head, shaft
from taskspec.figures.svg import COLORS
from taskspec.printers.latex import latex


def tikz(scene: Scene, scale: float = 1.0) -> str:
    """A `tikzpicture`; the colours it uses are those of `colors`."""
    body = "\n".join(f"  {_item(item)}" for item in scene.items)
    options = f"x={scale:g}cm, y=-{scale:g}cm, line width=0.7pt, line join=round"
    return f"\\begin{{tikzpicture}}[{options}]\n{body}\n\\end{{tikzpicture}}"


def colors() -> str:
    """Definitions of the named colours."""
    return "\n".join(rf"\definecolor{{task{role}}}{{HTML}}{{{code[1:].upper()}}}" for role, code in COLORS.items())


def _n(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _point(p: Point) -> str:
    return f"({_n(p[0])}, {_n(p[1])})"


def _item(item: Item) -> str:
    match item:
        case Circle(centre=centre, radius=r):
            return rf"\path[{_paint(item.fill, item.line, item.shade)}] {_point(centre)} circle [radius={_n(r)}];"
        case Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = f", rounded corners={_n(corner * 28)}pt" if corner else ""
            corners = f"{_point((x, y))} rectangle {_point((x + w, y + h))}"
            return rf"\path[{_paint(item.fill, item.line, item.shade)}{rounded}] {corners};"
        case Line():
            return _line(item)
        case Label(at=at, text=text, color=color):
            anchor = {"start": "west", "end": "east", "middle": "center"}[item.anchor]
            halo = ", fill=taskpaper" if item.halo else ""
            size = r"\footnotesize" if item.size < 0.34 else r"\small"
            options = f"anchor={anchor}, inner sep=1pt, text=task{color}, font={size}{halo}"
            return rf"\node[{options}] at {_point(at)} {{${latex(text)}$}};"
        case _:
            assert_never(item)


def _paint(fill: Color | None, line: Color | None, shade: float) -> str:
    parts = []
    if fill:
        strength = f"!{round(100 * shade)}!taskpaper" if shade < 1 else ""
        parts.append(f"fill=task{fill}{strength}")
    if line:
        parts.append(f"draw=task{line}")
    return ", ".join(parts)


def _line(line: Line) -> str:
    points = shaft(line)
    dash = ", dashed" if line.dashed else ""
    thick = f", line width={_n(line.width * 23)}pt"
    if line.curved:
        a, b, c, d = points
        path = f"{_point(a)} .. controls {_point(b)} and {_point(c)} .. {_point(d)}"
    else:
        path = " -- ".join(map(_point, points))
    out = rf"\draw[task{line.color}{dash}{thick}] {path};"
    if line.arrow:
        out += rf" \fill[task{line.color}] {' -- '.join(map(_point, head(line)))} -- cycle;"
    return out
