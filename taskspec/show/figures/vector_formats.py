"""Scenes as SVG for pages and as TikZ for papers; a style sheet or a paper may redefine the colours of roles."""

from __future__ import annotations

from html import escape
from typing import assert_never

from taskspec.base.display import ON_PAGES, visible
from taskspec.show.figures import shapes as sc
from taskspec.show.printers import tree as m
from taskspec.show.printers.markup import latex
from taskspec.show.printers.text import plain

SCALE = 38.0  # pixels in a centimetre
_FONTS = "'Latin Modern Math','STIX Two Math','Cambria Math','DejaVu Serif',serif"
DASHES = (0.1, 0.08)
"""Lengths of strokes and gaps in centimetres."""


def svg(scene: sc.Scene, css: bool = False) -> str:
    """Return an SVG picture."""
    body = "".join(map(svg_item, scene.items))
    if not css:
        body = f'<rect width="{_px(scene.width)}" height="{_px(scene.height)}" fill="{sc.COLORS["paper"]}"/>{body}'
    return svg_document(scene, body)


def svg_document(scene: sc.Scene, body: str, kind: str = "figure") -> str:
    """Return elements as an SVG picture of the size of a scene, with its description."""
    width = _px(scene.width)
    height = _px(scene.height)
    font = escape(_FONTS)
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'class="{kind}" style="--own:{width}px" font-family="{font}"><title>{escape(scene.alt)}</title>{body}</svg>'
    )
    return visible(text, ON_PAGES)


def _px(value: float) -> str:
    return f"{value * SCALE:.1f}".removesuffix(".0")


def _svg_point(p: sc.Point) -> str:
    return f"{_px(p[0])},{_px(p[1])}"


def svg_item(item: sc.Item) -> str:
    match item:
        case sc.Circle(centre=(x, y), radius=r):
            return f'<circle cx="{_px(x)}" cy="{_px(y)}" r="{_px(r)}"{_svg_paint(item)}/>'
        case sc.Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = f' rx="{_px(corner)}"' if corner else ""
            place = f'x="{_px(x)}" y="{_px(y)}" width="{_px(w)}" height="{_px(h)}"'
            return f"<rect {place}{rounded}{_svg_paint(item)}/>"
        case sc.Line():
            return _svg_line(item)
        case sc.Label():
            return _label(item)
        case _:
            assert_never(item)


def _svg_paint(item: sc.Circle | sc.Box) -> str:
    classes = []
    inside = "none"
    faded = ""
    edge = ""
    state = ""
    if item.fill is not None:
        classes.append(f"fill-{item.fill}")
        inside = sc.COLORS[item.fill]
        if item.shade < 1:
            faded = f' fill-opacity="{item.shade:.2f}"'
    if item.line is not None:
        classes.append(f"line-{item.line}")
        edge = f' stroke="{sc.COLORS[item.line]}" stroke-width="{_px(0.032)}"'
    if item.state is not None:
        state = f' data-state="{item.state}"'
    return f'{state} class="{" ".join(classes)}" fill="{inside}"{faded}{edge}'


def _svg_line(line: sc.Line) -> str:
    first, *others = map(_svg_point, sc.shaft(line))
    if line.curved:
        path = f"M{first} C{' '.join(others)}"
    else:
        path = " L".join((f"M{first}", *others))
    dash = ""
    if line.is_dashed:
        dash = f' stroke-dasharray="{" ".join(map(_px, DASHES))}"'
    color = f'class="line-{line.color}" stroke="{sc.COLORS[line.color]}"'
    out = f'<path d="{path}" fill="none" {color} stroke-width="{_px(line.width)}" stroke-linejoin="round"{dash}/>'
    if line.arrow:
        tip = " ".join(map(_svg_point, sc.head(line)))
        out += f'<polygon points="{tip}" class="fill-{line.color}" fill="{sc.COLORS[line.color]}"/>'
    return out


def _label(label: sc.Label) -> str:
    x, y = label.at
    fill = f"fill-{label.color}"
    style = f' class="{fill}"'
    if label.halo:
        style = f' stroke="{sc.COLORS["paper"]}" stroke-width="{_px(0.12)}" paint-order="stroke" class="halo {fill}"'
    place = f'x="{_px(x)}" y="{_px(y + label.size * 0.34)}" font-size="{_px(label.size)}" text-anchor="{label.anchor}"'
    return f'<text {place} fill="{sc.COLORS[label.color]}"{style}>{runs(label.text)}</text>'


def runs(tree: m.Math) -> str:
    """Return mathematics as pieces of text: letters in italics, scripts smaller and shifted."""
    match tree:
        case m.Ident(text=text, style="italic"):
            return f'<tspan font-style="italic">{escape(text)}</tspan>'
        case m.Row(items=items):
            return "".join(map(runs, items))
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


def tikz(scene: sc.Scene) -> str:
    """Return a `tikzpicture`; the names of its colours are those of `tikz_colors`."""
    options = "x=1cm, y=-1cm, line width=0.7pt, line join=round"
    body = "\n  ".join((rf"\begin{{tikzpicture}}[{options}]", *map(_tikz_item, scene.items)))
    return f"{body}\n\\end{{tikzpicture}}"


def tikz_colors() -> str:
    """Return definitions of the named colours."""
    lines = []
    for role, code in sc.COLORS.items():
        lines.append(rf"\definecolor{{task{role}}}{{HTML}}{{{code[1:].upper()}}}")
    return "\n".join(lines)


def _cm(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _tikz_point(p: sc.Point) -> str:
    return f"({_cm(p[0])}, {_cm(p[1])})"


def _tikz_item(item: sc.Item) -> str:
    match item:
        case sc.Circle(centre=centre, radius=r):
            return rf"\path[{_tikz_paint(item)}] {_tikz_point(centre)} circle [radius={_cm(r)}];"
        case sc.Box(corner=(x, y), width=w, height=h, round=corner):
            rounded = ""
            if corner:
                rounded = f", rounded corners={_cm(corner * 28)}pt"
            corners = f"{_tikz_point((x, y))} rectangle {_tikz_point((x + w, y + h))}"
            return rf"\path[{_tikz_paint(item)}{rounded}] {corners};"
        case sc.Line():
            return _tikz_line(item)
        case sc.Label(at=at, text=text, color=color):
            anchor = {"start": "west", "end": "east", "middle": "center"}[item.anchor]
            halo = ", fill=taskpaper" * item.halo
            size = r"\footnotesize" if item.size < 0.34 else r"\small"
            options = f"anchor={anchor}, inner sep=1pt, text=task{color}, font={size}{halo}"
            return rf"\node[{options}] at {_tikz_point(at)} {{${latex(text)}$}};"
        case _:
            assert_never(item)


def _tikz_paint(item: sc.Circle | sc.Box) -> str:
    parts = []
    if item.fill:
        strength = ""
        if item.shade < 1:
            strength = f"!{round(100 * item.shade)}!taskpaper"
        parts.append(f"fill=task{item.fill}{strength}")
    if item.line:
        parts.append(f"draw=task{item.line}")
    return ", ".join(parts)


def _tikz_line(line: sc.Line) -> str:
    points = sc.shaft(line)
    dash = ", dashed" if line.is_dashed else ""
    thick = f", line width={_cm(line.width * 23)}pt"
    if line.curved:
        a, b, c, d = points
        path = f"{_tikz_point(a)} .. controls {_tikz_point(b)} and {_tikz_point(c)} .. {_tikz_point(d)}"
    else:
        path = " -- ".join(map(_tikz_point, points))
    out = rf"\draw[task{line.color}{dash}{thick}] {path};"
    if line.arrow:
        out += rf" \fill[task{line.color}] {' -- '.join(map(_tikz_point, sc.head(line)))} -- cycle;"
    return out
