"""Charts of exams: one learner's heat map beside its seeds, learning curves, and the paper's charts of several learners."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from taskspec.base.files import safe_name
from taskspec.exam import score_rows
from taskspec.exam.score_rows import SeedCell, TaskRow
from taskspec.figures import chart
from taskspec.figures.chart import Axes, BoxSample, LegendEntry, Rgb, Scale
from taskspec.figures.scene import Anchor, Box, Hex, Item, Label, Line, Paint, Scene
from taskspec.printers import tree as m

PRINTED = chart.BLUE
TWINS = chart.PURPLE
GRADES: dict[str, Paint] = {"masters": chart.BLUE, "passes": "muted", "unsure": "muted", "fails": Hex("#B8400A")}
ROW = 0.92
"""The height of a row of a heat map, in centimetres."""
ACROSS = 5
"""Panels of learning curves side by side."""
PANEL = (4.05, 2.9)
"""Width and height of such a panel, in centimetres."""
TITLE = 0.34


# -- one learner


def of_exam(exam: Mapping[str, Any]) -> Scene:
    """Draw a heat map (as printed, twins, the best constant action) beside the scores of every seed, and learning curves."""
    rows = score_rows.rows(exam)
    names = max(chart.breadth(row.name) for row in rows) + 0.75
    cell = 2.2
    seeds = Axes(
        names + 3 * cell + 0.3, 0.0, 22.6 - names - 3 * cell, ROW * len(rows), _score_axis(rows, 0.08), _lanes(rows)
    )
    items: list[Item] = [*_title(exam)]
    for i, row in enumerate(rows):
        y = ROW * (i + 0.5)
        items += chart.words(row.name, (names - 0.6, y), anchor="end")
        if row.grade:
            items.append(
                Label((names - 0.3, y), m.Words(score_rows.SIGNS[row.grade]), 0.34, color=GRADES[row.grade], bold=True)
            )
    cells = [[row.printed, row.twins, _constant(row)] for row in rows]
    items += _heat(names, cell, cells, ("as printed", "twins", "constant\naction"))
    items += _seeds(seeds, rows)
    curves = [row for row in rows if row.curves]
    if curves:
        items += _panels(curves, seeds.bottom + 2.2)
    return chart.chart(items, f"Scores of {exam['learner']} on {len(rows)} tasks")


def _title(exam: Mapping[str, Any]) -> Iterator[Item]:
    lines = [f"{exam['learner']}: {score_rows.headline(exam)}", *textwrap.wrap(score_rows.finding(exam), 115)]
    for i, line in enumerate(lines):
        yield Label((0.0, -1.05 - 0.48 * (len(lines) - i)), m.Words(line), TITLE, "start")


def _constant(row: TaskRow) -> SeedCell:
    return SeedCell(() if row.constant is None else (row.constant,))


def _heat(left: float, width: float, cells: Sequence[Sequence[SeedCell]], across: Sequence[str]) -> Iterator[Item]:
    """Yield cells with their mean scores, grey if one was not run, below the names of their columns."""
    colors = [[background(cell) for cell in line] for line in cells]
    yield from chart.heat_map(left, 0.0, (width, ROW), colors, [[cell.words for cell in line] for line in cells])
    for j, name in enumerate(across):
        lines = name.count("\n") + 1
        yield from chart.words(name, (left + width * (j + 0.5), -0.1 - 0.17 * lines), chart.SMALL)


def background(cell: SeedCell) -> Rgb:
    """Return the colour of a cell of a heat map."""
    if cell.mean is None:
        return score_rows.NOT_RUN
    return score_rows.colour(cell.mean)


def _score_axis(rows: Sequence[TaskRow], margin: float = 0.0) -> Scale:
    """Return an axis for the scores of all seeds, which includes random actions and the expert."""
    shown = score_rows.cut([score for row in rows for cell in (row.printed, row.twins) for score in cell.scores])
    return Scale(min([0.0, *shown]) - margin, max([1.0, *shown]) + margin)


def _lanes(rows: Sequence[TaskRow]) -> Scale:
    """Return an axis with a place for each row, the first at the top."""
    return Scale(len(rows) - 0.5, -0.5)


def _seeds(plot: Axes, rows: Sequence[TaskRow]) -> Iterator[Item]:
    """Yield a box plot for each task, and one for its twins, on one scale."""
    for i in range(1, len(rows), 2):
        yield Box((plot.left, ROW * i), plot.width, ROW, chart.STRIPE, None)
    for score, word in ((0, "random"), (1, "expert")):
        yield chart.upright(plot, score)
        yield from chart.words(f"{score}\n{word}", (plot.at(score, 0)[0], -0.45), chart.SMALL)
    yield Line(((plot.left, 0.0), (plot.right, 0.0)), color=chart.EDGE, width=0.02)
    for tick in range(math.ceil(plot.x.low * 4), math.floor(plot.x.high * 4) + 1):
        x, _ = plot.at(tick / 4, 0)
        yield Line(((x, -0.07), (x, 0.0)), color=chart.EDGE, width=0.02)
    for i, row in enumerate(rows):
        beside = 0.2 if row.twins.scores else 0.0
        yield from chart.box_plot(plot, sample(row.printed), i - beside, PRINTED)
        yield from chart.box_plot(plot, sample(row.twins), i + beside, TWINS)
    entries = [
        LegendEntry("as printed", PRINTED, shape="circle", filled=True),
        LegendEntry("twins", TWINS, shape="circle", filled=True),
    ]
    yield from chart.legend(entries, plot.left + plot.width / 2 - 2.4, plot.bottom + 0.3, 8.0)


def sample(cell: SeedCell) -> BoxSample:
    """Return scores as charts show them, cut off below `FLOOR`."""
    low, high = score_rows.cut(cell.interval)
    return BoxSample(score_rows.cut(cell.scores), (low, high), max(cell.mean or 0.0, score_rows.FLOOR))


# -- learning curves


@dataclass(frozen=True)
class CurveStyle:
    """Colours of a panel of learning curves."""

    own: Paint = PRINTED
    optimum: Paint = chart.GREEN
    expert: Paint = chart.RULE
    random: Paint = chart.VERMILION


def _panels(rows: Sequence[TaskRow], top: float) -> Iterator[Item]:
    """Yield a panel with axes for each task, on one scale of scores."""
    width, height = PANEL
    values = [y for row in rows for y in _levels(row)]
    scale = chart.axis(values, most=5)
    for i, row in enumerate(rows):
        left = 0.9 + (i % ACROSS) * (width + 0.4)
        upper = top + (i // ACROSS) * (height + 1.5)
        steps = chart.axis([x for curve in row.curves for x, _ in curve], most=3)
        steps = replace(steps, ticks=tuple((x, score_rows.steps(x)) for x, _ in steps.ticks))
        if i % ACROSS == 0:
            y = scale
        else:
            y = replace(scale, ticks=tuple((y, "") for y, _ in scale.ticks))
        plot = Axes(left, upper, width, height, steps, y)
        yield from chart.frame(plot)
        yield from learning_curves(plot, row, CurveStyle())
        yield from chart.words(row.name, (left + width / 2, upper - 0.3))
    bottom = top + math.ceil(len(rows) / ACROSS) * (height + 1.5)
    key = "steps; lines at the optimum (dotted), the expert (dashed) and random actions (dash-dotted)"
    yield from chart.words(key, (0.9 + ACROSS * (width + 0.4) / 2, bottom - 0.4))


def _levels(row: TaskRow) -> list[float]:
    """Return the scores that a panel has to have room for."""
    levels = [0.0, 1.0] if row.optimum is None else [0.0, 1.0, row.optimum]
    return [*score_rows.cut([y for curve in row.curves for _, y in curve]), *levels]


def learning_curves(plot: Axes, row: TaskRow, style: CurveStyle) -> Iterator[Item]:
    """Yield scores over steps: every seed thin, their mean thick, with lines at the optimum, the expert and random actions."""
    if row.optimum is not None:
        yield chart.level(plot, row.optimum, style.optimum, "dotted")
    yield chart.level(plot, 1.0, style.expert, "dashed")
    yield chart.level(plot, 0.0, style.random, "dashdot")
    for curve in row.curves:
        steps = [x for x, _ in curve]
        yield from chart.polyline(plot, steps, score_rows.cut([y for _, y in curve]), style.own, 0.02, shade=0.4)
    steps, means = score_rows.mean_curve(row.curves)
    yield from chart.polyline(plot, steps, means, style.own, 0.06)


# -- pieces of a page


STRIP = (8.9, 0.45)
"""Width of a strip of seeds and height of a lane in it, in centimetres."""
SIDE = 0.21
"""Margin on both sides."""


def strip_axis(rows: Sequence[TaskRow]) -> Scale:
    """Return the axis that the strips of all tasks share."""
    return _score_axis(rows)


def strip(row: TaskRow, scores: Scale) -> Scene:
    """Draw the seeds of a task in one lane, and those of its twins in another below it."""
    lanes = [(cell, kind) for cell, kind in ((row.printed, "printed"), (row.twins, "twins")) if cell.scores]
    plot = _strip_plot(scores, max(len(lanes), 1))
    items: list[Item] = [
        chart.upright(plot, 0.0, "muted", "dashdot", 0.021),
        chart.upright(plot, 1.0, "muted", "dashed", 0.021),
    ]
    for i, (cell, kind) in enumerate(lanes):
        items += chart.box_plot(plot, sample(cell), i, PRINTED if kind == "printed" else TWINS)
    parts = [
        f"{kind}: mean {score_rows.decimal(cell.mean)} {score_rows.interval(*cell.interval)}".strip()
        for cell, kind in lanes
    ]
    return Scene(STRIP[0], plot.bottom, tuple(items), f"{row.name}, {'; '.join(parts) or 'not run'}", font="sans")


def strip_head(scores: Scale) -> Scene:
    """Draw the line above the strips: where random actions and the expert are."""
    width, _ = STRIP
    plot = _strip_plot(scores, 1)
    items: list[Item] = []
    for score, text in ((0.0, "random 0"), (1.0, "expert 1")):
        x, _ = plot.at(score, 0)
        anchor: Anchor = "middle"
        if x < 0.8:
            anchor = "start"
        if width - x < 0.8:
            anchor = "end"
        items += chart.words(text, (x, 0.2), 0.22, anchor, "muted")
    return Scene(width, 0.37, tuple(items), "scores: random actions 0, expert 1", font="sans")


def _strip_plot(scores: Scale, lanes: int) -> Axes:
    width, height = STRIP
    return Axes(SIDE, 0.0, width - 2 * SIDE, height * lanes + 0.1, scores, Scale(lanes - 0.5, -0.5))


def small_curves(row: TaskRow) -> Scene:
    """Draw learning curves without axes, for a row of small pictures."""
    last = max(1.0, *(x for curve in row.curves for x, _ in curve))
    values = _levels(row)
    plot = Axes(0.1, 0.13, 4.27, 2.26, Scale(0.0, last), Scale(min(values), max(values)))
    style = CurveStyle(PRINTED, "muted", "muted", "muted")
    alt = f"Learning curves of {row.name}, up to {score_rows.steps(last)} steps"
    return Scene(4.47, 2.53, tuple(learning_curves(plot, row, style)), alt, font="sans")


# -- several learners


def of_several(exams: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Scene]]:
    """Yield charts of several learners by the stems of their files: `table`, and box plots `task-NAME` and `learner-NAME`."""
    found = {name: {row.name: row.printed for row in score_rows.rows(exam)} for name, exam in exams.items()}
    tasks = dict.fromkeys(task for cells in found.values() for task in cells)
    yield "table", table(exams)
    for task in tasks:
        yield _stem(f"task-{task}"), boxes({name: cells.get(task, SeedCell(())) for name, cells in found.items()}, task)
    for name, cells in found.items():
        yield _stem(f"learner-{name}"), boxes(cells, name)


def _stem(name: str) -> str:
    return safe_name(re.sub(r"[^\w.=-]+", "-", name).strip("-"))


def table(exams: Mapping[str, Mapping[str, Any]], title: str = "") -> Scene:
    """Draw the paper's heat map: mean scores, learners across and tasks down; grey if one was not run."""
    found = {name: {row.id: row for row in score_rows.rows(exam)} for name, exam in exams.items()}
    tasks = {task: row.name for by_task in found.values() for task, row in by_task.items()}
    cells = [[_cut(by[task].printed) if task in by else SeedCell(()) for by in found.values()] for task in tasks]
    width = 1.58
    items: list[Item] = [*_heat(0.0, width, cells, ())]
    for i, name in enumerate(tasks.values()):
        items += chart.words(name, (-0.2, ROW * (i + 0.5)), anchor="end")
    learners = _without_family(list(found))
    for j, name in enumerate(learners):
        items += chart.words(name, (width * (j + 0.5) - 0.1, -0.2), anchor="start", angle=45)
    if title:
        left = -0.2 - max(map(chart.breadth, tasks.values()))
        top = -0.9 - 0.71 * max(map(chart.breadth, learners))
        items.append(Label((left, top), m.Words(title), 0.38, "start"))
    return chart.chart(items, title or f"Mean scores of {len(found)} learners on {len(tasks)} tasks")


def _without_family(learners: Sequence[str]) -> list[str]:
    """Return the names of learners, without the family or folder if all are in one."""
    parts = [name.rpartition("/") for name in learners]
    families = {family for family, _, _ in parts}
    if len(families) == 1:
        return [own for _, _, own in parts]
    return list(learners)


def _cut(cell: SeedCell) -> SeedCell:
    return SeedCell(tuple(score_rows.cut(cell.scores)), cell.failed)


def boxes(cells: Mapping[str, SeedCell], title: str) -> Scene:
    """Draw the paper's box plots: learners, or tasks, side by side, with the mean below each name."""
    colors = (PRINTED, chart.VERMILION, chart.GREEN, TWINS, chart.ORANGE, chart.SKY)
    names = tuple((i, f"{name}\n{cell.words or 'not run'}") for i, (name, cell) in enumerate(cells.items()))
    x = Scale(-0.6, len(cells) - 0.4, names, angle=30 if len(cells) > 6 else 0)
    y = chart.axis(
        [0.0, 1.0, *(score for cell in cells.values() for score in score_rows.cut(cell.scores))],
        "score: 0 random, 1 expert",
    )
    plot = Axes(0.0, 0.0, max(1.6 * len(cells), 3.0), 5.2, x, y)
    items: list[Item] = [*chart.frame(plot), chart.level(plot, 0.0), chart.level(plot, 1.0)]
    for i, cell in enumerate(cells.values()):
        items += chart.box_plot(plot, sample(cell), i, colors[i % len(colors)], is_upright=True, half=0.2)
    items.append(Label((0.0, -0.35), m.Words(title), 0.36, "start"))
    return chart.chart(items, f"Scores: {title}")
