"""Pictures of exams: one learner's heat map beside its seeds, learning curves, and the paper's table of several learners."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.extras import need
from taskspec.base.files import safe_name, write_bytes
from taskspec.exam.report import rows as told
from taskspec.exam.report.rows import SeedCell, TaskRow

PRINTED, TWINS, QUIET = "#0072B2", "#CC79A7", "#6b7785"
"""Colours of Okabe and Ito: of tasks as printed, of twins; and of what stands beside."""
GRADES = {"masters": "#0072B2", "unsure": QUIET, "fails": "#B8400A"}
SETTINGS = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.linewidth": 0.6, "axes.edgecolor": "#9aa3ad", "pdf.fonttype": 42,
    "svg.hashsalt": "taskspec", "svg.fonttype": "path",
}  # fmt: skip
METADATA: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
ACROSS = 5
"""Panels of learning curves side by side."""


def save(drawn: Any, path: Path) -> Path:
    """Write a figure as SVG, PNG or PDF, by the name of the file; the same figure gives the same bytes."""
    kind, picture = path.suffix[1:].lower(), BytesIO()
    with need("matplotlib", "figures").rc_context(SETTINGS):
        drawn.savefig(picture, format=kind, dpi=160, metadata=METADATA[kind], facecolor="white")
    write_bytes(path, picture.getvalue())
    return path


# -- one learner ------------------------------------------------------------------------------------------------------


def of_exam(exam: Mapping[str, Any]) -> Any:
    """A heat map (as printed, twins, the best constant action) beside the scores of every seed, and learning curves.

    Raises:
        SpecError: E705 without matplotlib.
    """
    matplotlib, figures = need("matplotlib", "figures"), need("matplotlib.figure", "figures")
    rows = told.rows(exam)
    curves = [row for row in rows if row.curves]
    top, low = 0.36 * len(rows) + 1.4, 1.75 * math.ceil(len(curves) / ACROSS)
    with matplotlib.rc_context(SETTINGS):
        drawn = figures.Figure(figsize=(9.6, top + low), layout="constrained")
        upper, *lower = drawn.subfigures(2, 1, height_ratios=[top, low]) if curves else [drawn]
        sentence = textwrap.fill(told.finding(exam), 118)
        upper.suptitle(f"{exam['learner']}: {told.headline(exam)}\n{sentence}", fontsize=9.5, x=0.01, ha="left")
        cells, seeds = upper.subplots(1, 2, width_ratios=[1.0, 2.1], sharey=True)
        _cells(cells, rows)
        _seeds(seeds, rows)
        if lower:
            _curves(lower[0], curves)
    return drawn


def _cells(axes: Any, rows: Sequence[TaskRow]) -> None:
    columns = ("as printed", "twins", "constant\naction")
    values = [[row.printed, row.twins, _constant(row)] for row in rows]
    _heat(axes, values, columns, [row.name for row in rows])
    for i, row in enumerate(rows):
        if row.grade:
            axes.annotate(told.SIGNS[row.grade], (-0.5, i), xytext=(-4, 0), textcoords="offset points", ha="right",
                          va="center", color=GRADES[row.grade], fontweight="bold", fontsize=10)  # fmt: skip
    axes.tick_params(axis="y", pad=16)


def _constant(row: TaskRow) -> SeedCell:
    return SeedCell(() if row.constant is None else (row.constant,))


def _heat(axes: Any, values: Sequence[Sequence[SeedCell]], across: Sequence[str], down: Sequence[str]) -> None:
    """Cells with their numbers; grey ones were not run."""
    colours = [[told.NOT_RUN if c.mean is None else told.colour(c.mean) for c in line] for line in values]
    axes.imshow(np.array(colours, np.uint8), aspect="auto", interpolation="nearest")
    for i, line in enumerate(values):
        for j, cell in enumerate(line):
            axes.text(j, i, cell.words, ha="center", va="center", fontsize=8, color=told.ink(colours[i][j]))
    axes.set_xticks(range(len(across)), across, fontsize=8)
    axes.set_yticks(range(len(down)), down)
    axes.xaxis.tick_top()
    axes.set_xticks(np.arange(len(across) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(down) + 1) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=1.5)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)


def _seeds(axes: Any, rows: Sequence[TaskRow]) -> None:
    """Every seed a dot; a box from end to end of the 95 % interval of the mean, a line at the mean, whiskers to the range."""
    for i, row in enumerate(rows):
        both = bool(row.twins.scores)
        box(axes, row.printed, i - 0.2 * both, PRINTED)
        box(axes, row.twins, i + 0.2, TWINS)
        if i % 2:
            axes.axhspan(i - 0.5, i + 0.5, color="#f3f4f5", zorder=0, linewidth=0)
    for x in (0, 1):
        axes.axvline(x, color="#4a545e", linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    shown = [s for row in rows for s in told.cut((*row.printed.scores, *row.twins.scores))]
    low, high = min([0.0, *shown]), max([1.0, *shown])
    axes.set_xlim(low - 0.08, high + 0.08)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks([0, 1], ["0\nrandom", "1\nexpert"], fontsize=8)
    axes.set_xticks(np.arange(math.ceil(low * 4) / 4, high + 0.01, 0.25), minor=True)
    axes.xaxis.tick_top()
    axes.tick_params(axis="y", which="both", length=0, labelleft=False)
    axes.spines[["left", "right", "bottom"]].set_visible(False)
    lines = need("matplotlib.lines", "figures")
    handles = [
        lines.Line2D([], [], color=c, marker="o", linewidth=3, alpha=0.8, markersize=4) for c in (PRINTED, TWINS)
    ]
    axes.legend(
        handles,
        ["as printed", "twins"],
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        ncols=2,
        frameon=False,
        fontsize=8,
    )


def box(axes: Any, cell: SeedCell, at: float, colour: str, upright: bool = False) -> None:
    """One box: along the x-axis at a height, or upright along the y-axis."""
    if not cell.scores:
        return
    scores, (low, high) = told.cut(cell.scores), told.cut(cell.interval)
    middle = max(cell.mean or 0.0, told.FLOOR)

    def place(along: Any, across: Any) -> tuple[Any, Any]:
        return (across, along) if upright else (along, across)

    axes.plot(*place([min(scores), max(scores)], [at, at]), color=colour, linewidth=1, zorder=2, solid_capstyle="butt")
    corners = place([low, high, high, low, low], [at - 0.13, at - 0.13, at + 0.13, at + 0.13, at - 0.13])
    axes.fill(*corners, facecolor=colour, alpha=0.28, edgecolor=colour, linewidth=0.8, zorder=3)
    axes.plot(
        *place([middle, middle], [at - 0.17, at + 0.17]), color=colour, linewidth=2.2, zorder=5, solid_capstyle="butt"
    )
    axes.plot(
        *place(scores, at + _spread(scores)), "o", color=colour, markersize=3, alpha=0.75, zorder=4, markeredgewidth=0
    )


def _spread(scores: Sequence[float]) -> Any:
    """How far dots of about the same score stand to the sides, so that each can be seen."""
    found = np.zeros(len(scores))
    groups: dict[int, list[int]] = {}
    for i, score in enumerate(scores):
        groups.setdefault(round(score / 0.04), []).append(i)
    for members in groups.values():
        reach = min(0.12, 0.02 * (len(members) - 1))
        found[members] = np.linspace(-reach, reach, len(members))
    return found


def _curves(part: Any, rows: Sequence[TaskRow]) -> None:
    """Scores over steps: every seed thin, their mean thick, with lines at the optimum, the expert and random actions."""
    ticks, down = need("matplotlib.ticker", "figures"), math.ceil(len(rows) / ACROSS)
    grid = np.atleast_1d(part.subplots(down, ACROSS, squeeze=False, sharey=True)).ravel()
    for axes, row in zip(grid, rows, strict=False):
        levels = [(row.optimum, "#009E73", ":"), (1.0, "#4a545e", "--"), (0.0, "#D55E00", "-.")]
        for level, colour, dashes in levels:
            if level is not None:
                axes.axhline(level, color=colour, linewidth=0.9, linestyle=dashes)
        for curve in row.curves:
            xs, ys = zip(*curve, strict=True)
            axes.plot(xs, told.cut(ys), color=PRINTED, linewidth=0.6, alpha=0.3)
        axes.plot(*told.mean_curve(row.curves), color=PRINTED, linewidth=1.8)
        axes.set_title(row.name, fontsize=8)
        axes.tick_params(labelsize=7, width=0.5)
        axes.xaxis.set_major_locator(ticks.MaxNLocator(3))
        axes.xaxis.set_major_formatter(ticks.FuncFormatter(lambda x, _: told.steps(x)))
        axes.spines[["top", "right"]].set_visible(False)
    for axes in grid[len(rows) :]:
        axes.set_visible(False)
    part.supxlabel(
        "steps; lines at the optimum (dotted), the expert (dashed) and random actions (dash-dotted)", fontsize=8
    )


# -- several learners -------------------------------------------------------------------------------------------------


def of_several(exams: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Any]]:
    """The heat map of several learners, and a box plot for each task and each learner, by names for their files."""
    found = {name: {row.name: row.printed for row in told.rows(exam)} for name, exam in exams.items()}
    tasks = dict.fromkeys(task for cells in found.values() for task in cells)
    yield "table", table(exams)
    for task in tasks:
        yield _stem(f"task-{task}"), boxes({name: cells.get(task, SeedCell(())) for name, cells in found.items()}, task)
    for name, cells in found.items():
        yield _stem(f"learner-{name}"), boxes(cells, name)


def _stem(name: str) -> str:
    return safe_name(re.sub(r"[^\w.=-]+", "-", name).strip("-"))


def table(exams: Mapping[str, Mapping[str, Any]], title: str = "") -> Any:
    """The paper's heat map: mean scores, learners across and tasks down; grey where one was not run.

    Raises:
        SpecError: E705 without matplotlib.
    """
    matplotlib, figures = need("matplotlib", "figures"), need("matplotlib.figure", "figures")
    found = {name: {row.id: row for row in told.rows(exam)} for name, exam in exams.items()}
    tasks = {task: row.name for each in found.values() for task, row in each.items()}
    values = [[_cut(by[task].printed) if task in by else SeedCell(()) for by in found.values()] for task in tasks]
    with matplotlib.rc_context(SETTINGS):
        drawn = figures.Figure(figsize=(1.8 + 0.62 * len(found), 1.5 + 0.36 * len(tasks)), layout="constrained")
        axes = drawn.subplots()
        names = _without_family(list(found))
        _heat(axes, values, names, list(tasks.values()))
        axes.set_xticks(range(len(found)), names, rotation=45, ha="left", rotation_mode="anchor", fontsize=8)
        if title:
            drawn.suptitle(title, fontsize=11, x=0.01, ha="left")
    return drawn


def _without_family(learners: Sequence[str]) -> list[str]:
    """What learners are called among those of one family, or of one folder."""
    parts = [name.rpartition("/") for name in learners]
    return [own for _, _, own in parts] if len({family for family, _, _ in parts}) == 1 else list(learners)


def _cut(cell: SeedCell) -> SeedCell:
    return SeedCell(tuple(told.cut(cell.scores)), cell.failed)


def boxes(cells: Mapping[str, SeedCell], title: str) -> Any:
    """The paper's box plots: learners, or tasks, side by side, upright; the mean stands under each name.

    Raises:
        SpecError: E705 without matplotlib.
    """
    matplotlib, figures = need("matplotlib", "figures"), need("matplotlib.figure", "figures")
    colours = (PRINTED, "#D55E00", "#009E73", TWINS, "#E69F00", "#56B4E9")
    with matplotlib.rc_context(SETTINGS):
        drawn = figures.Figure(figsize=(1.2 + 0.62 * len(cells), 3.0), layout="constrained")
        axes = drawn.subplots()
        for i, cell in enumerate(cells.values()):
            box(axes, cell, i, colours[i % len(colours)], upright=True)
        for y in (0, 1):
            axes.axhline(y, color="#4a545e", linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        names = [f"{name}\n{cell.words or 'not run'}" for name, cell in cells.items()]
        axes.set_xticks(range(len(cells)), names, fontsize=7, rotation=30 if len(cells) > 6 else 0)
        axes.set_xlim(-0.6, len(cells) - 0.4)
        axes.set_ylabel("score: 0 random, 1 expert", fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_title(title, fontsize=10, loc="left")
    return drawn
