"""Charts of one task of an exam: its scores as marks on a strip, on an axis that all tasks share, and its learning curves."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from taskspec.base.display import fixed
from taskspec.base.extras import need
from taskspec.learn.exam.score_rows import FIXED, FLOOR, PUBLISHED, RELABELLED, Curve, TaskRow
from taskspec.learn.exam.verdicts import MASTERED
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart

GRADES: dict[str | None, str] = {
    "masters": chart.BLUE, "passes": chart.UNSURE, "unsure": chart.UNSURE, "fails": chart.FAILS, None: chart.UNSURE,
}  # fmt: skip
"""The colour of a verdict."""
WIDTH = 4.2
LANE = 0.28
"""Width and height of a strip, in inches."""
LETTER = 0.0087
"""The mean width of a letter of one point, in inches."""
LINE = 0.19
"""The height of the words above strips, in inches."""
MARKS: dict[str, dict[str, Any]] = {
    PUBLISHED: {"marker": "o", "markersize": 6.5},
    RELABELLED: {"marker": "o", "markersize": 6, "markerfacecolor": chart.PAPER},
    FIXED: {"marker": "D", "markersize": 4, "markeredgewidth": 0},
    "one seed": {"marker": "o", "markersize": 2.8, "markeredgecolor": chart.PAPER, "markeredgewidth": 0.3},
}
"""The marks of a strip."""
BELOW = 0.32
"""The distance of seeds from their mean, as a share of the height of a strip."""
Ends = tuple[float, float]


# -- strips


def score_ends(rows: Sequence[TaskRow]) -> Ends:
    """Return the ends of the axis that the strips of all tasks share: it shows random actions, the expert, and scores down to
    `FLOOR`."""
    highest = 1.0
    for row in rows:
        for cell in row.forms.values():
            highest = max([highest, *cell.scores])
    return FLOOR - 0.13, highest + 0.06


def backdrop(axes: Any, ends: Ends) -> None:
    """Draw the bands of all strips (worse than random, random to expert) and lines at random, 0.9 and the expert."""
    axes.set_xlim(ends)
    axes.axvspan(ends[0], 0.0, color=chart.WORSE, linewidth=0)
    axes.axvspan(0.0, 1.0, color=chart.BETWEEN, linewidth=0)
    for score, dash in ((0.0, "-"), (MASTERED, "--"), (1.0, "-")):
        axes.axvline(score, color=chart.MUTED, linestyle=dash, linewidth=0.7)
    axes.axis("off")


def axis_words(axes: Any, ends: Ends, y: float, size: float) -> None:
    """Write the words above the strips, from a height in shares of the axes, while there is room for them."""
    letter = size * LETTER * (ends[1] - ends[0]) / (axes.get_window_extent().width / axes.figure.dpi)
    where = {"transform": axes.get_xaxis_transform(), "color": chart.MUTED, "fontsize": size, "va": "bottom"}
    below = "worse than random"
    if letter * len(f"{below} random") / 2 > -ends[0] / 2:
        below = "worse"
    axes.text(ends[0] / 2, y, below, ha="center", **where)
    axes.text(0.0, y, "random", ha="center", **where)
    axes.text(ends[1], y, "expert", ha="right", **where)
    before = min(MASTERED, ends[1] - letter * len("expert "))
    if before > MASTERED - 0.15:
        axes.text(before, y, f"{MASTERED:g}", ha="right", **where)


def marks(axes: Any, row: TaskRow, lane: float, size: float = 7) -> None:
    """Draw the scores of a task: the mean as a dot joined to the hollow one of its twins, and below it seeds as small dots.

    The colour is that of the verdict. Positions are clipped at `FLOOR`; a clipped mean gets a mark at the edge, and its value.

    Args:
        size: of the letters of a value, in points.
    """
    color = GRADES[row.grade]
    means = row.means
    places = dict(zip(means, clipped(means.values()), strict=True))
    seeds = clipped(row.printed.scores)
    if PUBLISHED in places and RELABELLED in places:
        axes.plot([places[PUBLISHED], places[RELABELLED]], [lane, lane], color=color, linewidth=1.5)
    for form, shade in ((FIXED, chart.MUTED), (PUBLISHED, color), (RELABELLED, color)):
        if form in places:
            axes.plot([places[form]], [lane], color=shade, linestyle="none", **MARKS[form])
    axes.plot(seeds, [lane - BELOW] * len(seeds), color=color, linestyle="none", **MARKS["one seed"])
    further = [fixed(means[form], 2) for form in (PUBLISHED, RELABELLED) if means.get(form, 0.0) < FLOOR]
    if further:
        axes.plot([0.012], [lane], "<", color=color, markersize=5, transform=axes.get_yaxis_transform())
        text = ", ".join(dict.fromkeys(further))
        axes.annotate(text, (FLOOR, lane), (8, 0), textcoords="offset points", color=color, fontsize=size, va="center")


def marks_key(forms: Sequence[str]) -> list[Any]:
    """Return handles of a legend for the marks of these forms, and of a seed."""
    lines = need("matplotlib.lines", "figures", "a chart")
    handles = []
    for form, look in MARKS.items():
        if form in (*forms, "one seed"):
            handles.append(lines.Line2D([], [], linestyle="none", color=chart.INK, label=form, **look))
    return handles


def strip(row: TaskRow, ends: Ends) -> Chart:
    """Draw the strip of one task, for a page."""
    values = [f"{form} {cell.words}" for form, cell in row.forms.items() if cell.words]
    with chart.style():
        figure = chart.figure(WIDTH, LANE)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_ylim(-0.5, 0.5)
        backdrop(axes, ends)
        marks(axes, row, 0.06)
    return Chart(figure, f"{row.name}: {', '.join(values) or 'not run'}", is_tight=False)


def strip_head(ends: Ends) -> Chart:
    """Draw the words above the strips, for a page."""
    with chart.style():
        figure = chart.figure(WIDTH, LINE)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(ends)
        axes.axis("off")
        axis_words(axes, ends, 0.2, 7.5)
    return Chart(figure, "scores: random actions 0, expert 1", is_tight=False)


def clipped(scores: Iterable[float]) -> list[float]:
    """Return the positions of scores in pictures."""
    return [max(score, FLOOR) for score in scores]


# -- learning curves


def mean_curve(curves: Sequence[Curve]) -> tuple[list[float], list[float]]:
    """Return the mean over seeds at the steps where all of them were looked at."""
    known = [dict(curve) for curve in curves]
    xs = sorted(set.intersection(*map(set, known)))
    return xs, [float(np.mean([each[x] for each in known])) for x in xs]


def steps_words(count: float) -> str:
    """Return a number of steps in few letters: `500k`."""
    if count < 1000:
        return f"{count:g}"
    if count < 1e6:
        return f"{count / 1e3:g}k"
    return f"{count / 1e6:g}M"


def learning_curves(axes: Any, row: TaskRow) -> None:
    """Draw scores over steps: every seed thin, their mean thick, with lines at the optimum, the expert and random actions."""
    color = GRADES[row.grade]
    if row.optimum is not None:
        axes.axhline(row.optimum, color=chart.MUTED, linestyle=":", linewidth=0.7)
    axes.axhline(1.0, color=chart.MUTED, linestyle="--", linewidth=0.7)
    axes.axhline(0.0, color=chart.MUTED, linestyle="-.", linewidth=0.7)
    for curve in row.curves:
        xs, ys = zip(*curve, strict=True)
        axes.plot(xs, clipped(ys), color=color, linewidth=0.6, alpha=0.6)
    steps, means = mean_curve(row.curves)
    axes.plot(steps, clipped(means), color=color, linewidth=1.6)
    axes.set_xlim(0.0, last_step(row))


def last_step(row: TaskRow) -> float:
    """Return the last step that the learning curves of a task show."""
    last = 1.0
    for step, _ in itertools.chain.from_iterable(row.curves):
        last = max(last, step)
    return last


def curves(row: TaskRow) -> Chart:
    """Draw the learning curves of a task with axes, for a page."""
    last = last_step(row)
    lowest = min(score for _, score in itertools.chain.from_iterable(row.curves))
    ticks = {0.0: "0", 1.0: "1"}
    if lowest < FLOOR:
        ticks[FLOOR] = "≤ −1"
    elif lowest == FLOOR:
        ticks[FLOOR] = "−1"
    with chart.style():
        figure = chart.figure(2.0, 0.95)
        axes = figure.add_axes((0.22, 0.22, 0.7, 0.7))
        learning_curves(axes, row)
        axes.set_yticks(list(ticks), list(ticks.values()))
        axes.set_xticks([0.0, last], ["0", f"{steps_words(last)} steps"])
        axes.get_xticklabels()[1].set_horizontalalignment("right")
    return Chart(figure, f"Learning curves of {row.name}, up to {steps_words(last)} steps", is_tight=False)
