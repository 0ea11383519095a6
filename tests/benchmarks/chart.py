"""A chart of rates, to be read in a paper: a row for each task, a mark for each program and number of lanes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.base.extras import need
from taskspec.show.figures import chart

if TYPE_CHECKING:
    from tests.benchmarks.race import Rate

WIDTH = 7.0
ROW = 0.38
MARGIN = 1.3
COLUMNS = 3
"""Inches: of the chart, of a row, and of what is above and below the rows; columns of the legend."""
SMALL = 4.0
LARGE = 8.5
"""Diameters in points of marks for the least and the greatest number of lanes."""


@dataclass(frozen=True, slots=True)
class Marker:
    """How a program is drawn. Colours are those of Okabe and Ito, which all eyes tell apart; shapes tell as much
    without them, and marks of others are hollow."""

    label: str
    shape: str
    color: str
    ours: bool = True


MARKS = {
    "scalar": Marker("taskspec, one environment", "D", "#E69F00"),
    "numpy": Marker("taskspec on NumPy", "s", "#56B4E9"),
    "numba": Marker("taskspec on Numba", "o", "#0072B2"),
    "jax": Marker("taskspec on JAX", "v", "#CC79A7"),
    "jax-scan": Marker("taskspec on JAX, in scan", "^", "#009E73"),
    "seals": Marker("seals", "D", "#000000", ours=False),
    "SyncVectorEnv": Marker("seals in SyncVectorEnv", "s", "#000000", ours=False),
    "gymnax": Marker("gymnax, in scan", "^", "#000000", ours=False),
    "CartPoleVectorEnv": Marker("CartPoleVectorEnv of Gymnasium", "p", "#000000", ours=False),
    "EnvPool": Marker("EnvPool", "o", "#000000", ours=False),
}
LEVELS = (-0.22, 0.0, 0.22)
"""Where in its row, by turns, a program is drawn, so that marks of two that are as fast do not hide each other."""


def draw(rates: Sequence[Rate], path: Path) -> None:
    """Write an SVG, PNG or PDF file; the same rates give the same bytes.

    Raises:
        SpecError: E705 without matplotlib.
    """
    chart.save(chart.Chart(figure(rates), "Steps per second by task, program and number of lanes"), path)


def figure(rates: Sequence[Rate]) -> Any:
    """The chart as matplotlib's `Figure`."""
    tasks = list(dict.fromkeys(r.contestant.task for r in rates))
    sizes = _sizes(rates)
    with chart.style():
        drawn = chart.figure(WIDTH, MARGIN + ROW * len(tasks), layout="constrained")
        axes = drawn.add_subplot()
        _frame(axes, tasks, [r.median for r in rates])
        for row, task in enumerate(tasks):
            mine = sorted(
                (r for r in rates if r.contestant.task == task), key=lambda r: -r.contestant.lanes
            )  # small ones on top
            programs = _programs(mine)
            for r in mine:
                level = LEVELS[programs.index(r.contestant.program) % len(LEVELS)]
                axes.plot([r.median], [row + level], **_style(MARKS[r.contestant.program], sizes[r.contestant.lanes]))
        drawn.legend(handles=_legend(_programs(rates), sizes), loc="outside lower center", ncols=COLUMNS)
    return drawn


def _programs(rates: Sequence[Rate]) -> list[str]:
    """Those that were measured, in the order of `MARKS`."""
    return [p for p in MARKS if any(r.contestant.program == p for r in rates)]


def _legend(programs: Sequence[str], sizes: Mapping[int, float]) -> list[Any]:
    """A column of our programs, one of others, one of numbers of lanes; filled up to the same length."""
    line = need("matplotlib.lines", "figures").Line2D
    middle = (SMALL + LARGE) / 2
    plain = Marker("", "o", "#999999")
    found = [[line([], [], label=MARKS[p].label, **_style(MARKS[p], middle)) for p in programs if MARKS[p].ours is ours]
             for ours in (True, False)]  # fmt: skip
    found.append([line([], [], label=_lanes(n), **_style(plain, size)) for n, size in sizes.items()])
    rows = max(map(len, found))
    return [
        h for column in found for h in (*column, *(line([], [], linestyle="none") for _ in range(rows - len(column))))
    ]


def _frame(axes: Any, tasks: Sequence[str], values: Sequence[float]) -> None:
    axes.set_xscale("log")
    low = math.floor(math.log10(min(values)))
    high = math.ceil(math.log10(max(values)))
    axes.set_xlim(10.0**low, 10.0 ** max(high, low + 1))
    axes.set_ylim(len(tasks) - 0.5, -0.5)
    axes.set_yticks(range(len(tasks)), tasks)
    axes.tick_params(axis="y", length=0)
    ticker = need("matplotlib.ticker", "figures")
    axes.xaxis.set_major_formatter(ticker.EngFormatter(sep=""))
    axes.xaxis.set_minor_formatter(ticker.NullFormatter())
    axes.set_xlabel("steps per second")
    axes.grid(axis="x", color="#DDDDDD", linewidth=0.6)
    for row in range(0, len(tasks), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#F4F4F4", linewidth=0, zorder=0)
    axes.set_axisbelow(True)
    axes.spines["left"].set_visible(False)


def _sizes(rates: Sequence[Rate]) -> dict[int, float]:
    """The diameter for each number of lanes: even steps."""
    lanes = sorted({r.contestant.lanes for r in rates})
    step = (LARGE - SMALL) / max(1, len(lanes) - 1)
    return {n: SMALL + i * step for i, n in enumerate(lanes)}


def _style(mark: Marker, size: float) -> dict[str, Any]:
    return {
        "marker": mark.shape, "color": mark.color, "markersize": size, "linestyle": "none", "markeredgewidth": 0.9,
        "markerfacecolor": mark.color if mark.ours else "white",
        "zorder": 2, "markeredgecolor": "white" if mark.ours else mark.color,
    }  # fmt: skip


def _lanes(n: int) -> str:
    return "1 lane" if n == 1 else f"{n:,} lanes"
