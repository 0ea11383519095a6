"""Charts of results, through matplotlib: their colours, their style, and files or SVG for pages."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import ON_PAGES, number, visible
from taskspec.base.extras import is_installed, need
from taskspec.base.files import write_bytes

INK = "#1f2933"
MUTED = "#6b7785"
FAINT = "#c3cad2"
PAPER = "#ffffff"
# Colours of Okabe and Ito, which people with any colour vision can tell apart.
BLUE = "#0072b2"
VERMILION = "#d55e00"
GREEN = "#009e73"
PURPLE = "#cc79a7"
ORANGE = "#e69f00"
SERIES = (
    (BLUE, "-", "o"), (VERMILION, "--", "s"), (GREEN, "-.", "D"), (PURPLE, "-", "^"), (ORANGE, "--", "v"), (INK, ":", "o"),
)  # fmt: skip
"""Colours, dashes and marks of learners and measures in one picture."""
SCORE = "score: random 0, expert 1"
"""The label of an axis of scores."""
# Verdicts, and backgrounds of scores.
FAILS = "#b8400a"
UNSURE = "#5c6773"
WORSE = "#f6ece6"
BETWEEN = "#eef2f5"
TINT_MASTERS = "#d3e6f4"
TINT_UNSURE = "#e6e9ec"
TINT_FAILS = "#f8d5c2"
TINT_NONE = "#f6f6f4"
VARIABLES = {
    INK: "ink", MUTED: "muted", FAINT: "faint", PAPER: "paper", BLUE: "masters", FAILS: "fails-ink", UNSURE: "unsure",
    WORSE: "worse", BETWEEN: "between",
}  # fmt: skip
"""The CSS variables that have a colour's value on light and on dark paper."""
FORMATS = ("svg", "png", "pdf")
DPI = 200
SMALLEST = 7
"""The least size of letters, in points."""
LETTER = 0.075
"""The width of a letter of a tick label, in inches."""
STYLE: dict[str, Any] = {
    "svg.hashsalt": "taskspec", "svg.fonttype": "none", "pdf.fonttype": 42, "text.parse_math": False,
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans", "Verdana", "Helvetica", "Arial"], "font.size": 8,
    "text.color": INK, "axes.titlesize": 9, "figure.titlesize": 10.5, "axes.labelcolor": INK, "axes.edgecolor": MUTED,
    "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True, "axes.linewidth": 0.6,
    "axes.unicode_minus": True, "xtick.color": MUTED, "ytick.color": MUTED, "xtick.labelcolor": INK,
    "ytick.labelcolor": INK, "xtick.major.width": 0.6, "ytick.major.width": 0.6, "grid.color": FAINT, "grid.alpha": 0.5,
    "grid.linewidth": 0.5, "lines.linewidth": 1.4, "lines.markersize": 4, "legend.frameon": False,
    "legend.handlelength": 2.5, "figure.facecolor": PAPER, "axes.facecolor": "none",
}  # fmt: skip
METADATA: dict[str, dict[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
"""Entries of files that are left out, so that the same picture gives the same bytes."""


@dataclass(frozen=True)
class Chart:
    """A figure of matplotlib, and its description in words.

    `is_tight` charts are as large as their contents; others keep the size and the margins of the figure.
    """

    figure: Any
    alt: str
    is_tight: bool = True


def is_available() -> bool:
    """Return whether charts can be drawn: matplotlib is installed."""
    return is_installed("matplotlib")


def possible(formats: Iterable[str]) -> list[str]:
    """Return formats that can be written: where matplotlib is missing, those that are no pictures."""
    return [name for name in formats if name not in FORMATS or is_available()]


@contextmanager
def style() -> Iterator[None]:
    """Draw in the style of all charts.

    Raises:
        SpecError: E705 without matplotlib.
    """
    with need("matplotlib", "figures", "a chart").rc_context(STYLE), quiet():
        yield


@contextmanager
def quiet() -> Iterator[None]:
    """Hide warnings about letters that no font has; they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        yield


def figure(width: float, height: float, layout: str | None = None) -> Any:
    """Make an empty figure.

    Args:
        width: in inches.
        height: in inches.
        layout: of matplotlib, such as `constrained`.
    """
    return need("matplotlib.figure", "figures", "a chart").Figure(figsize=(width, height), layout=layout)


def svg(chart: Chart, kind: str = "chart") -> str:
    """Return a chart as SVG for a page, in the colours of its paper.

    Args:
        chart: the chart.
        kind: its CSS class.
    """
    text = _drawn(chart, "svg", is_transparent=True).decode()
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var(--{variable}, {color})")
    return re.sub(r'<g id="[^"]*"', "<g", text).replace("<svg", f'<svg class="{escape(kind)}"', 1)


def save(chart: Chart, path: Path) -> Path:
    """Write a chart on white paper; the same chart gives the same bytes.

    Args:
        chart: the chart.
        path: ends in `.svg`, `.png` or `.pdf`.

    Returns:
        The path.

    Raises:
        SpecError: E726 for another ending; E716 for a file that cannot be written.
    """
    kind = path.suffix[1:]
    if kind not in FORMATS:
        raise spec_error("E726", f"'{path.suffix}' is not a format of charts", f"use {', '.join(FORMATS)}")
    write_bytes(path, _drawn(chart, kind))
    return path


def _drawn(chart: Chart, kind: str, is_transparent: bool = False) -> bytes:
    picture = BytesIO()
    options: dict[str, Any] = {"format": kind, "dpi": DPI, "metadata": METADATA[kind], "transparent": is_transparent}
    if chart.is_tight:
        options["bbox_inches"] = "tight"
    with style():
        chart.figure.savefig(picture, **options)
    if kind == "svg":
        return _described(picture.getvalue().decode(), chart.alt).encode()
    return picture.getvalue()


def _described(text: str, alt: str) -> str:
    text = text[text.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<defs>\s*<style[^>]*>[^<]*</style>\s*</defs>", "", text, count=1)
    text = re.sub(r"font-family: [^;]*; ", "", text)
    text = re.sub(r"\n(?! *<)", " ", text)
    head, _, body = text.partition(">")
    fonts = ", ".join((*STYLE["font.sans-serif"], "sans-serif"))
    about = f'role="img" stroke-linejoin="round" font-family="{fonts}"'
    return visible(f"{head} {about}><title>{escape(alt)}</title>{body}", ON_PAGES)


# Axes.


def inches(axes: Any) -> Any:
    """Return the transform of places in inches from the lower left corner of axes."""
    width, height = axes.get_window_extent().size / axes.figure.dpi
    return need("matplotlib.transforms", "figures").Affine2D().scale(1 / width, 1 / height) + axes.transAxes


def numbers(axis: Any, is_log: bool = False, most: int = 6) -> None:
    """Label an axis with round numbers, at most `most` of them on a linear axis.

    Args:
        axis: `xaxis` or `yaxis`.
        is_log: whether its scale is logarithmic.
        most: the number of intervals.
    """
    ticker = need("matplotlib.ticker", "figures")
    locator = ticker.MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10])
    if is_log:
        low, high = axis.get_view_interval()
        factors = [1.0]
        if high < 300 * low:
            factors = [1.0, 2.0, 5.0]
        locator = ticker.LogLocator(subs=factors, numticks=8)
    axis.set_major_locator(locator)
    axis.set_minor_locator(ticker.NullLocator())
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: number(value)))


def labelled(axes: Any, places: Sequence[float], names: Sequence[str], width: float, turns: bool = False) -> None:
    """Label the x axis at given places; names that would overlap the one before are left out.

    Args:
        axes: whose axis it is, its limits known.
        places: values on the axis.
        names: their labels.
        width: of the axis, in inches.
        turns: whether names turn where they are too long for a line.
    """
    ends = axes.xaxis.get_transform().transform(axes.get_xlim())
    inches = (axes.xaxis.get_transform().transform(places) - ends[0]) * width / (ends[1] - ends[0])
    turned = turns and LETTER * sum(map(len, set(names))) > width
    kept: dict[float, str] = {}
    reached = -math.inf
    for inch, place, name in sorted(zip(inches, places, names, strict=True)):
        half = LETTER * len(name) / 2
        if turned:
            half = LETTER
        if inch - half > reached:
            kept[place] = name
            reached = inch + half + LETTER
    axes.set_xticks(list(kept), list(kept.values()))
    axes.xaxis.set_minor_locator(need("matplotlib.ticker", "figures").NullLocator())
    if turned:
        axes.tick_params(axis="x", labelrotation=30)
        for label in axes.get_xticklabels():
            label.set_horizontalalignment("right")


def band(axes: Any, xs: Any, low: Any, high: Any, color: str, **where: Any) -> None:
    """Draw an interval along a curve.

    Args:
        axes: where to draw.
        xs: places on the x axis.
        low, high: ends of the interval at each of them.
        color: of the curve.
        where: further arguments of `fill_between`.
    """
    axes.fill_between(xs, low, high, color=color, alpha=0.2, linewidth=0, **where)


def key_below(figure: Any, columns: int) -> None:
    """Name each kind of line of a figure once, below all its panels."""
    entries = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries[label] = handle
    if entries:
        figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)


def heat_map(axes: Any, cells: np.ndarray, has_numbers: bool) -> None:
    """Draw numbers as colours, from dark to bright, beside a bar of the colours; far apart, by their logarithms.

    Args:
        axes: where to draw.
        cells: (rows, columns), from below; not a number where nothing is drawn.
        has_numbers: whether cells have their numbers in them.
    """
    colors = need("matplotlib.colors", "figures")
    known = cells[np.isfinite(cells)]
    if not known.size:
        known = np.zeros(1)
    low = float(known.min())
    high = float(known.max())
    norm = colors.Normalize(low, high)
    is_log = 0 < 100 * low < high
    if is_log:
        norm = colors.LogNorm(low, high)
    palette = need("matplotlib").colormaps["cividis"].resampled(64)
    mesh = axes.pcolormesh(np.ma.masked_invalid(cells), cmap=palette, norm=norm)
    bar = axes.figure.colorbar(mesh, ax=axes, shrink=0.84, aspect=16)
    bar.outline.set_visible(False)
    bar.solids.set_edgecolor("face")
    bar.solids.set_rasterized(False)
    numbers(bar.ax.yaxis, is_log)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    if not has_numbers:
        return
    place = {"ha": "center", "va": "center", "fontsize": SMALLEST}
    for (i, j), value in np.ndenumerate(cells):
        if np.isfinite(value):
            text = number(float(f"{value:.3g}"))
            axes.text(j + 0.5, i + 0.5, text, color=_readable(palette(norm(value))), **place)


def _readable(background: tuple[float, ...]) -> str:
    """Return the colour of letters on a background: dark or light, by its luminance in sRGB."""
    c = np.array(background[:3])
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    if linear @ (0.2126, 0.7152, 0.0722) < 0.1791:
        return "#fafafa"
    return "#000000"
