"""Charts of exams: one strip of scores for each task on a shared axis, learning curves, and a matrix of several learners."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from taskspec.base.display import fixed
from taskspec.base.files import safe_name
from taskspec.learn.exam.card import Card, LearnerMatrix
from taskspec.learn.exam.score_rows import FIXED, FLOOR, PUBLISHED, RELABELLED, Curve, TaskRow, forms_of
from taskspec.learn.exam.verdicts import MASTERED
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart

GRADES: dict[str | None, str] = {
    "masters": chart.BLUE, "passes": chart.MUTED, "unsure": chart.MUTED, "fails": chart.FAILS, None: chart.MUTED,
}  # fmt: skip
"""The colour of a verdict."""
TINTS: dict[str | None, str] = {
    "masters": chart.TINT_MASTERS, "passes": chart.TINT_UNSURE, "unsure": chart.TINT_UNSURE, "fails": chart.TINT_FAILS,
    None: chart.TINT_NONE,
}  # fmt: skip
"""The same colours as backgrounds of numbers."""
WIDTH = 4.2
LANE = 0.28
"""Width and height of a strip, in inches."""
COLUMN = 0.75
"""The width of a column of numbers beside the strips, in inches."""
SPARK = 1.15
"""The width of a learning curve beside a strip, in inches."""
LINE = 0.19
"""The distance of lines of words, in inches."""
LETTERS = 105
"""Letters in a line of words."""
CELL = (0.9, 0.42)
"""Width and height of a cell of a matrix, in inches."""
LONGEST = 12
"""Letters in a line above a column of a matrix."""
Ends = tuple[float, float]


# -- strips


def score_ends(rows: Sequence[TaskRow]) -> Ends:
    """Return the ends of the axis that the strips of all tasks share: it shows random actions, the expert, and scores down to
    `FLOOR`."""
    highest = [max(cell.scores) for row in rows for cell in row.forms.values() if cell.scores]
    return FLOOR - 0.13, max([1.0, *highest]) + 0.06


def _backdrop(axes: Any, ends: Ends) -> None:
    """Draw the bands of all strips (worse than random, random to expert) and lines at random, 0.9 and the expert."""
    axes.set_xlim(ends)
    axes.axvspan(ends[0], 0.0, color=chart.WORSE, linewidth=0)
    axes.axvspan(0.0, 1.0, color=chart.BETWEEN, linewidth=0)
    for score, dash in ((0.0, "-"), (MASTERED, "--"), (1.0, "-")):
        axes.axvline(score, color=chart.MUTED, linestyle=dash, linewidth=0.7)
    axes.axis("off")


def _axis_words(axes: Any, ends: Ends, y: float, size: float) -> None:
    """Write the words above the strips, from a height in shares of the axes."""
    where = {"transform": axes.get_xaxis_transform(), "color": chart.MUTED, "fontsize": size, "va": "bottom"}
    axes.text(ends[0] / 2, y, "worse than random", ha="center", **where)
    axes.text(0.0, y, "random", ha="center", **where)
    axes.text(MASTERED - 0.045, y, f"{MASTERED:g}", ha="right", **where)
    axes.text(ends[1], y, "expert", ha="right", **where)


def _marks(axes: Any, row: TaskRow, lane: float) -> None:
    """Draw the scores of a task: seeds as faint dots, the mean as a dot joined to the hollow one of its twins.

    The colour is that of the verdict. Positions are clipped at `FLOOR`; a clipped mean gets a mark at the edge, and its value.
    """
    color = GRADES[row.grade]
    means = row.means
    places = dict(zip(means, clipped(means.values()), strict=True))
    seeds = clipped(row.printed.scores)
    axes.plot(seeds, [lane] * len(seeds), "o", color=color, markersize=3, markeredgewidth=0, alpha=0.3)
    if PUBLISHED in places and RELABELLED in places:
        axes.plot([places[PUBLISHED], places[RELABELLED]], [lane, lane], color=color, linewidth=1.5)
    if FIXED in places:
        axes.plot([places[FIXED]], [lane], "|", color=chart.MUTED, markersize=11, markeredgewidth=1.5)
    if PUBLISHED in places:
        axes.plot([places[PUBLISHED]], [lane], "o", color=color, markersize=7)
    if RELABELLED in places:
        axes.plot([places[RELABELLED]], [lane], "o", color=color, markersize=6, markerfacecolor=chart.PAPER)
    further = [fixed(means[form], 2) for form in (PUBLISHED, RELABELLED) if means.get(form, 0.0) < FLOOR]
    if further:
        axes.plot([0.012], [lane], "<", color=color, markersize=5, transform=axes.get_yaxis_transform())
        text = ", ".join(dict.fromkeys(further))
        axes.annotate(text, (FLOOR, lane), (7, 1), textcoords="offset points", color=color, fontsize=6.5)


def strip(row: TaskRow, ends: Ends) -> Chart:
    """Draw the strip of one task, for a page."""
    values = [f"{form} {cell.words}" for form, cell in row.forms.items() if cell.words]
    with chart.style():
        figure = chart.figure(WIDTH, LANE)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_ylim(0.5, -0.5)
        _backdrop(axes, ends)
        _marks(axes, row, 0.0)
    return Chart(figure, f"{row.name}: {', '.join(values) or 'not run'}", is_tight=False)


def strip_head(ends: Ends) -> Chart:
    """Draw the words above the strips, for a page."""
    with chart.style():
        figure = chart.figure(WIDTH, LINE)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(ends)
        axes.axis("off")
        _axis_words(axes, ends, 0.2, 7.5)
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


def _steps(count: float) -> str:
    if count < 1000:
        return f"{count:g}"
    if count < 1e6:
        return f"{count / 1e3:g}k"
    return f"{count / 1e6:g}M"


def _learning_curves(axes: Any, row: TaskRow) -> None:
    """Draw scores over steps: every seed thin, their mean thick, with lines at the optimum, the expert and random actions."""
    color = GRADES[row.grade]
    if row.optimum is not None:
        axes.axhline(row.optimum, color=chart.MUTED, linestyle=":", linewidth=0.7)
    axes.axhline(1.0, color=chart.MUTED, linestyle="--", linewidth=0.7)
    axes.axhline(0.0, color=chart.MUTED, linestyle="-.", linewidth=0.7)
    for curve in row.curves:
        xs, ys = zip(*curve, strict=True)
        axes.plot(xs, clipped(ys), color=color, linewidth=0.6, alpha=0.4)
    steps, means = mean_curve(row.curves)
    axes.plot(steps, clipped(means), color=color, linewidth=1.6)
    axes.set_xlim(0.0, _last_step(row))


def _last_step(row: TaskRow) -> float:
    return max(1.0, *(x for curve in row.curves for x, _ in curve))


def curves(row: TaskRow) -> Chart:
    """Draw the learning curves of a task with axes, for a page."""
    last = _last_step(row)
    lowest = min(y for curve in row.curves for _, y in curve)
    ticks = {0.0: "0", 1.0: "1"}
    if lowest <= FLOOR:
        if lowest < FLOOR:
            ticks[FLOOR] = "≤ −1"
        else:
            ticks[FLOOR] = "−1"
    with chart.style():
        figure = chart.figure(2.0, 0.95)
        axes = figure.add_axes((0.18, 0.22, 0.74, 0.7))
        _learning_curves(axes, row)
        axes.set_yticks(list(ticks), list(ticks.values()))
        axes.set_xticks([0.0, last], ["0", f"{_steps(last)} steps"])
        axes.get_xticklabels()[1].set_horizontalalignment("right")
    return Chart(figure, f"Learning curves of {row.name}, up to {_steps(last)} steps", is_tight=False)


# -- the card


def picture(shown: Card) -> Chart:
    """Draw the card of an exam: what is wrong in words, a strip for each task that needs a look, and learning curves."""
    lines = [(f"{shown.learner}: {shown.terms}", chart.MUTED, "normal")]
    lines += [(line, chart.INK, "bold") for line in textwrap.wrap(shown.lead, LETTERS)]
    lines += [(line, chart.INK, "normal") for line in textwrap.wrap(shown.advice.replace("`", ""), LETTERS)]
    lines += [(line, chart.MUTED, "normal") for line in textwrap.wrap(shown.passed, LETTERS)]
    named = [(row.name, row) for row in shown.rows]
    return _strips(named, lines, f"Exam of {shown.learner}. {shown.lead}")


def _strips(named: Sequence[tuple[str, TaskRow]], lines: Sequence[tuple[str, str, str]], alt: str) -> Chart:
    """Draw lines of words (text, colour, weight), and below them rows of a name, a strip, the numbers, and a learning curve."""
    rows = [row for _, row in named]
    forms = forms_of(rows)
    ends = score_ends(rows)
    left = chart.LETTER * (max((len(name) for name, _ in named), default=0) + 3)
    with chart.style():
        figure = chart.figure(WIDTH, LANE * max(1, len(rows)))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_ylim(len(rows) - 0.5, -0.5)
        _backdrop(axes, ends)
        _axis_words(axes, ends, 1.01, 7)
        inches = chart.inches(axes)
        top = LANE * max(1, len(rows))
        for i, (line, color, weight) in enumerate(reversed(lines)):
            axes.text(-left, top + 0.5 + LINE * i, line, transform=inches, color=color, weight=weight, fontsize=9)
        places = [WIDTH + COLUMN * (j + 0.7) for j in range(len(forms))]
        for form, x in zip(forms, places, strict=True):
            head = form.replace(" ", "\n", 1)
            axes.text(x, top + 0.05, head, transform=inches, ha="center", color=chart.MUTED, fontsize=7)
        for i, (name, row) in enumerate(named):
            y = top - LANE * (i + 0.5)
            where = {"transform": inches, "va": "center_baseline"}
            color = GRADES[row.grade]
            axes.text(-left, y, row.sign, color=color, weight="bold", fontsize=9, **where)
            axes.text(-left + 0.2, y, name, **where)
            axes.axhline(i + 0.5, color=chart.PAPER, linewidth=1.2)
            _marks(axes, row, i)
            for form, x in zip(forms, places, strict=True):
                if form == PUBLISHED:
                    shade = color
                else:
                    shade = chart.INK
                axes.text(x, y, row.forms[form].words or "–", color=shade, ha="center", **where)
            if row.curves:
                _spark(axes, row, WIDTH + COLUMN * (len(forms) + 0.3), y)
        _key(axes, forms)
    return Chart(figure, alt)


def _spark(axes: Any, row: TaskRow, left: float, middle: float) -> None:
    """Draw the learning curves of a task in a small plot without axes; places are in inches."""
    height = 0.75 * LANE
    place = (left, middle - height / 2, SPARK, height)
    small = axes.inset_axes(place, transform=chart.inches(axes))
    small.axis("off")
    _learning_curves(small, row)


def _key(axes: Any, forms: Sequence[str]) -> None:
    """Say below the strips what their marks mean."""
    lines = [
        (PUBLISHED, {"marker": "o", "markersize": 6}),
        (RELABELLED, {"marker": "o", "markersize": 6, "markerfacecolor": chart.PAPER}),
        (FIXED, {"marker": "|", "markersize": 9, "markeredgewidth": 1.5}),
        ("one seed", {"marker": "o", "markersize": 3, "markeredgewidth": 0, "alpha": 0.4}),
    ]
    for label, look in lines:
        if label in (*forms, "one seed"):
            axes.plot([], [], linestyle="none", color=chart.INK, label=label, **look)
    axes.legend(
        loc="upper left", bbox_to_anchor=(0, 0), ncols=len(lines), fontsize=7, labelcolor=chart.MUTED, handletextpad=0.2,
        borderaxespad=0.4, handlelength=1.2,
    )  # fmt: skip


# -- several learners


def of_several(found: LearnerMatrix) -> Iterator[tuple[str, Chart]]:
    """Yield charts of several learners by the stems of their files: `table`, and strips `task-NAME` and `learner-NAME`."""
    yield "table", table(found)
    for j, task in enumerate(found.tasks):
        column = [(name, row[j]) for name, row in zip(found.learners, found.cells, strict=True)]
        named = [(name, row) for name, row in column if row.capability]
        yield _stem(f"task-{task}"), _strips(named, [(task, chart.INK, "bold")], f"Scores on {task}")
    for name, shown in found.cards.items():
        yield _stem(f"learner-{name}"), picture(shown)


def _stem(name: str) -> str:
    return safe_name(re.sub(r"[^\w.=-]+", "-", name).strip("-"))


def table(found: LearnerMatrix) -> Chart:
    """Draw a matrix of learners and tasks: mean scores as published, flags or verdicts in words, verdicts as colours."""
    width, height = CELL
    across = len(found.tasks)
    down = len(found.learners)
    with chart.style():
        figure = chart.figure(width * across, height * down)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(0, across)
        axes.set_ylim(down, 0)
        axes.xaxis.tick_top()
        axes.set_xticks([j + 0.5 for j in range(across)], map(_headed, found.tasks))
        axes.set_yticks([i + 0.5 for i in range(down)], found.learners)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        for i, cells in enumerate(found.cells):
            for j, cell in enumerate(cells):
                axes.fill_between([j, j + 1], i, i + 1, facecolor=TINTS[cell.grade], edgecolor=chart.PAPER)
                where = {"x": j + 0.5, "ha": "center"}
                if not cell.word:
                    axes.text(y=i + 0.5, s=cell.printed.words or "·", va="center", **where)
                    continue
                axes.text(y=i + 0.45, s=cell.printed.words, va="bottom", weight="bold", **where)
                axes.text(y=i + 0.5, s="\n".join(textwrap.wrap(cell.word, 16)), va="top", fontsize=6, **where)
    return Chart(figure, f"Mean scores of {down} learners on {across} tasks")


def _headed(task: str) -> str:
    lines = [""]
    for part in re.split(r"(?<=[a-z])(?=[A-Z])|(?<=, )", task):
        if len(lines[-1]) + len(part) > LONGEST:
            lines.append("")
        lines[-1] += part
    return "\n".join(line.strip() for line in lines if line)
