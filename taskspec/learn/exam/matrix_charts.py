"""Charts of several learners: a matrix of learners and tasks, and strips of scores for each task and each learner."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator

from taskspec.base.files import safe_name
from taskspec.learn.exam.card import LearnerMatrix
from taskspec.learn.exam.card_picture import picture, strips
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart

TINTS: dict[str | None, str] = {
    "masters": chart.TINT_MASTERS, "passes": chart.TINT_UNSURE, "unsure": chart.TINT_UNSURE, "fails": chart.TINT_FAILS,
    None: chart.TINT_NONE,
}  # fmt: skip
"""The same colours as backgrounds of numbers."""
CELL = (0.9, 0.42)
"""Width and height of a cell of a matrix, in inches."""
LONGEST = 12
"""Letters in a line above a column of a matrix."""


def of_several(found: LearnerMatrix) -> Iterator[tuple[str, Chart]]:
    """Yield charts of several learners by the stems of their files: `table`, and strips `task-NAME` and `learner-NAME`."""
    yield "table", table(found)
    for j, task in enumerate(found.tasks):
        column = [(name, row[j]) for name, row in zip(found.learners, found.cells, strict=True)]
        named = [(name, row) for name, row in column if row.capability]
        yield _stem(f"task-{task}"), strips(named, [(task, chart.INK, "bold")], f"Scores on {task}")
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
                axes.text(
                    y=i + 0.5, s="\n".join(textwrap.wrap(cell.word, 16)), va="top", fontsize=chart.SMALLEST, **where
                )
        look = {"transform": axes.transAxes, "color": chart.MUTED, "fontsize": chart.SMALLEST, "va": "top"}
        axes.text(0, -0.1 / down, "mean scores: random actions 0, expert 1; the colour is the verdict", **look)
    return Chart(figure, f"Mean scores of {down} learners on {across} tasks")


def _headed(task: str) -> str:
    lines = [""]
    for part in re.split(r"(?<=[a-z])(?=[A-Z])|(?<=, )", task):
        if len(lines[-1]) + len(part) > LONGEST:
            lines.append("")
        lines[-1] += part
    return "\n".join(line.strip() for line in lines if line)
