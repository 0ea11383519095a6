"""Charts of exams: one strip of scores for each task on a shared axis, learning curves, and a matrix of several learners."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from taskspec.base.files import safe_name
from taskspec.language.printers import tree as m
from taskspec.learn.exam import score_rows
from taskspec.learn.exam.card import Card, LearnerMatrix, card, matrix
from taskspec.learn.exam.score_rows import FIXED, FLOOR, FORMS, PUBLISHED, RELABELLED, TaskRow, decimal, forms_of
from taskspec.learn.exam.verdicts import MASTERED
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Axes, Scale
from taskspec.show.figures.shapes import Area, Box, Circle, Hex, Item, Label, Line, Paint, Scene

GRADES: dict[str | None, Paint] = {
    "masters": chart.BLUE, "passes": "muted", "unsure": "muted", "fails": Hex("#B8400A"), None: "muted",
}  # fmt: skip
"""The colour of a verdict."""
TINTS: dict[str, Hex] = {
    "masters": Hex("#d3e6f4"), "passes": Hex("#e6e9ec"), "unsure": Hex("#e6e9ec"), "fails": Hex("#f8d5c2"),
    "": Hex("#f6f6f4"),
}  # fmt: skip
"""The same colours as backgrounds of numbers."""
WORSE = Hex("#f6ece6")
BETWEEN = Hex("#eef2f5")
LANE = 0.72
"""The height of a strip, in centimetres."""
WIDTH = 10.6
"""The width of the strips, in centimetres."""
SPARK = (2.9, 0.5)
"""Width and height of a learning curve beside a strip, in centimetres."""
TITLE = 0.34
LETTERS = 105
"""Letters in a line of a title."""


# -- strips


def score_axis(rows: Sequence[TaskRow]) -> Scale:
    """Return the axis that the strips of all tasks share: it shows random actions, the expert, and scores down to `FLOOR`."""
    highest = [max(cell.scores) for row in rows for cell in row.forms.values() if cell.scores]
    return Scale(FLOOR - 0.13, max([1.0, *highest]) + 0.06)


def backdrop(plot: Axes) -> Iterator[Item]:
    """Yield the bands of all strips (worse than random, random to expert) and lines at random, 0.9 and the expert."""
    start = plot.at(0.0, 0.0)[0]
    end = plot.at(1.0, 0.0)[0]
    yield Box((plot.left, plot.top), start - plot.left, plot.height, WORSE, None)
    yield Box((start, plot.top), end - start, plot.height, BETWEEN, None)
    yield chart.upright(plot, 0.0, "muted", "solid", 0.02)
    yield chart.upright(plot, MASTERED, "muted", "dashed", 0.02)
    yield chart.upright(plot, 1.0, "muted", "solid", 0.02)


def axis_words(plot: Axes, size: float = chart.SMALL) -> Iterator[Item]:
    """Yield the words above the strips."""
    y = plot.top - 0.2
    middle = (plot.left + plot.at(0.0, 0.0)[0]) / 2
    yield from chart.words("worse than random", (middle, y), size, color="muted")
    yield from chart.words("random", (plot.at(0.0, 0.0)[0], y), size, color="muted")
    yield from chart.words(decimal(MASTERED).rstrip("0"), (plot.at(MASTERED, 0.0)[0] - 0.2, y), size, "end", "muted")
    yield from chart.words("expert", (plot.right, y), size, "end", "muted")


def marks(plot: Axes, row: TaskRow, lane: float) -> Iterator[Item]:
    """Yield the scores of a task: seeds as faint dots, the mean as a dot joined to the hollow one of its twins.

    The colour is that of the verdict. Positions are clipped at `FLOOR`; a clipped mean gets a mark at the edge, and its value.
    """
    color = GRADES[row.grade]
    shown = [(cell.mean, form) for form, cell in row.forms.items() if cell.mean is not None]
    places = {form: plot.at(max(mean, FLOOR), lane) for mean, form in shown}
    for score in row.printed.scores:
        yield Circle(plot.at(max(score, FLOOR), lane), 0.05, color, None, 0.25)
    if PUBLISHED in places and RELABELLED in places:
        yield Line((places[PUBLISHED], places[RELABELLED]), color=color, width=0.05)
    if FIXED in places:
        x, y = places[FIXED]
        yield Line(((x, y - 0.2), (x, y + 0.2)), color="muted", width=0.05)
    if PUBLISHED in places:
        yield Circle(places[PUBLISHED], 0.12, color, color)
    if RELABELLED in places:
        yield Circle(places[RELABELLED], 0.12 if PUBLISHED not in places else 0.1, "paper", color)
    clipped = [decimal(mean) for mean, form in shown if mean < FLOOR and form in (PUBLISHED, RELABELLED)]
    if clipped:
        yield from _clipped(plot, lane, ", ".join(dict.fromkeys(clipped)), color)


def _clipped(plot: Axes, lane: float, text: str, color: Paint) -> Iterator[Item]:
    """Yield a mark at the left edge, and the value of what is further left."""
    x = plot.left + 0.04
    y = plot.at(0.0, lane)[1]
    yield Area(((x, y), (x + 0.16, y - 0.11), (x + 0.16, y + 0.11)), color)
    yield from chart.words(text, (plot.left + 0.85, y - 0.21), 0.22, "start", color)


def strip(row: TaskRow, scores: Scale) -> Scene:
    """Draw the strip of one task, for a page."""
    plot = Axes(0.0, 0.0, WIDTH, LANE, scores, Scale(0.5, -0.5))
    values = [f"{form} {cell.words}" for form, cell in row.forms.items() if cell.words]
    alt = f"{row.name}: {', '.join(values) or 'not run'}"
    return Scene(WIDTH, LANE, (*backdrop(plot), *marks(plot, row, 0.0)), alt, font="sans")


def strip_head(scores: Scale) -> Scene:
    """Draw the words above the strips, for a page."""
    plot = Axes(0.0, 0.42, WIDTH, 0.0, scores, Scale(0.5, -0.5))
    return Scene(WIDTH, 0.42, tuple(axis_words(plot, 0.26)), "scores: random actions 0, expert 1", font="sans")


# -- learning curves


def learning_curves(plot: Axes, row: TaskRow) -> Iterator[Item]:
    """Yield scores over steps: every seed thin, their mean thick, with lines at the optimum, the expert and random actions."""
    color = GRADES[row.grade]
    if row.optimum is not None:
        yield chart.level(plot, row.optimum, "muted", "dotted", 0.02)
    yield chart.level(plot, 1.0, "muted", "dashed", 0.02)
    yield chart.level(plot, 0.0, "muted", "dashdot", 0.02)
    for curve in row.curves:
        xs, ys = zip(*curve, strict=True)
        yield from chart.polyline(plot, xs, score_rows.clipped(ys), color, 0.02, shade=0.4)
    steps, means = score_rows.mean_curve(row.curves)
    yield from chart.polyline(plot, steps, score_rows.clipped(means), color, 0.05)


def sparkline(left: float, top: float, size: tuple[float, float], row: TaskRow) -> Iterator[Item]:
    """Yield the learning curves of a task in a small plot without axes."""
    steps = max(1.0, *(x for curve in row.curves for x, _ in curve))
    values = [0.0, 1.0, *score_rows.clipped([y for curve in row.curves for _, y in curve])]
    yield from learning_curves(Axes(left, top, *size, Scale(0.0, steps), Scale(min(values), max(values))), row)


def curves(row: TaskRow) -> Scene:
    """Draw the learning curves of a task with axes, for a page."""
    last = max(1.0, *(x for curve in row.curves for x, _ in curve))
    scores = [y for curve in row.curves for _, y in curve]
    values = [0.0, 1.0, *score_rows.clipped(scores)]
    below = "≤ " if min(scores) < FLOOR else ""
    names = {FLOOR: f"{below}−1", 0.0: "0", 1.0: "1"}
    ticks = tuple((y, name) for y, name in names.items() if min(values) <= y <= max(values))
    steps = Scale(0.0, last, ((0.0, "0"), (last, f"{score_rows.steps(last)} steps")))
    plot = Axes(0.75, 0.2, 3.6, 1.5, steps, Scale(min(values), max(values), ticks))
    items = (*chart.frame(plot, size=0.26), *learning_curves(plot, row))
    alt = f"Learning curves of {row.name}, up to {score_rows.steps(last)} steps"
    return Scene(5.1, 2.3, items, alt, font="sans")


# -- the card


def picture(shown: Card) -> Scene:
    """Draw the card of an exam: what is wrong in words, a strip for each task that needs a look, and learning curves."""
    lines: list[tuple[str, Paint, bool]] = [(f"{shown.learner}: {shown.terms}", "muted", False)]
    lines += [(line, "ink", True) for line in textwrap.wrap(shown.lead, LETTERS)]
    lines += [(line, "ink", False) for line in textwrap.wrap(shown.advice.replace("`", ""), LETTERS)]
    lines += [(line, "muted", False) for line in textwrap.wrap(shown.passed, LETTERS)]
    named = [(row.name, row) for row in shown.rows]
    return chart.chart([*_lines(lines), *strips(named)], f"Exam of {shown.learner}. {shown.lead}")


def _lines(lines: Sequence[tuple[str, Paint, bool]]) -> Iterator[Item]:
    for i, (line, color, bold) in enumerate(lines):
        top = -1.0 - 0.5 * (len(lines) - i)
        yield Label((0.0, top), m.Words(line), TITLE, "start", color, bold=bold)


def strips(named: Sequence[tuple[str, TaskRow]]) -> Iterator[Item]:
    """Yield rows of a name, a strip, the numbers, and a learning curve if there is one."""
    rows = [row for _, row in named]
    left = max((chart.breadth(name) for name, _ in named), default=0.0) + 0.7
    plot = Axes(left, 0.0, WIDTH, LANE * len(rows), score_axis(rows), Scale(len(rows) - 0.5, -0.5))
    forms = forms_of(rows)
    columns = [(form, plot.right + 1.2 + 1.75 * i) for i, form in enumerate(forms)]
    last = plot.right + 1.2 + 1.75 * len(forms)
    yield from backdrop(plot)
    yield from axis_words(plot)
    for form, x in columns:
        yield from chart.words(form.replace(" ", "\n", 1), (x, -0.3), chart.SMALL, color="muted")
    for i, (name, row) in enumerate(named):
        y = LANE * (i + 0.5)
        color = GRADES[row.grade]
        yield Label((0.0, y), m.Words(row.sign), 0.34, "start", color, bold=True)
        yield from chart.words(name, (0.5, y), anchor="start")
        if i:
            yield Line(((plot.left, LANE * i), (plot.right, LANE * i)), color="paper", width=0.04)
        yield from marks(plot, row, i)
        for form, x in columns:
            text = row.forms[form].words or "–"
            yield from chart.words(text, (x, y), color=color if form == PUBLISHED else "ink")
        if row.curves:
            yield from sparkline(last, y - SPARK[1] / 2, SPARK, row)
    yield from key((plot.left + 0.12, plot.bottom + 0.4), forms)


def strip_key() -> Scene:
    """Draw what the marks of the strips mean, for a page."""
    return chart.chart(key((0.0, 0.0), FORMS), "key of the marks", margin=0.05)


def key(at: tuple[float, float], forms: Sequence[str]) -> Iterator[Item]:
    """Yield what the marks of the strips mean."""
    x, y = at
    entries = ((PUBLISHED, "filled"), (RELABELLED, "hollow"), (FIXED, "tick"), ("one seed", "seed"))
    for text, kind in entries:
        if kind != "seed" and text not in forms:
            continue
        match kind:
            case "tick":
                yield Line(((x, y - 0.14), (x, y + 0.14)), color="muted", width=0.05)
            case "seed":
                yield Circle((x, y), 0.05, "ink", None, 0.25)
            case _:
                yield Circle((x, y), 0.1, "ink" if kind == "filled" else "paper", "ink")
        yield from chart.words(text, (x + 0.2, y), chart.SMALL, "start", "muted")
        x += 0.75 + chart.breadth(text, chart.SMALL)


# -- several learners


def of_several(exams: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Scene]]:
    """Yield charts of several learners by the stems of their files: `table`, and strips `task-NAME` and `learner-NAME`."""
    found = matrix(exams)
    yield "table", table(found)
    for j, task in enumerate(found.tasks):
        known = [(name, row[j].row) for name, row in zip(found.learners, found.cells, strict=True)]
        named = [(name, row) for name, row in known if row is not None]
        yield _stem(f"task-{task}"), chart.chart([*_lines([(task, "ink", True)]), *strips(named)], f"Scores on {task}")
    for name, exam in exams.items():
        yield _stem(f"learner-{name}"), picture(card(exam))


def _stem(name: str) -> str:
    return safe_name(re.sub(r"[^\w.=-]+", "-", name).strip("-"))


def table(found: LearnerMatrix) -> Scene:
    """Draw a matrix of learners and tasks: mean scores as published, the diagnosis in words, and the verdict as the colour."""
    width = 2.25
    height = 1.05
    items: list[Item] = []
    for j, task in enumerate(found.tasks):
        lines = _headed(task)
        items += chart.words(lines, (width * (j + 0.5), -0.28 - 0.16 * lines.count("\n")))
    for i, (name, cells) in enumerate(zip(found.learners, found.cells, strict=True)):
        items += chart.words(name, (-0.2, height * (i + 0.5)), anchor="end")
        for j, cell in enumerate(cells):
            items += _cell((width * j, height * i), (width, height), cell.score, cell.word, TINTS[cell.grade])
    return chart.chart(items, f"Mean scores of {len(found.learners)} learners on {len(found.tasks)} tasks")


def _headed(task: str) -> str:
    """Return a name in lines that are short enough for a column."""
    name, *values = task.split(", ")
    if len(name) > 13:
        name = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]*$)", "\n", name)
    return "\n".join([name, *values])


def _cell(corner: tuple[float, float], size: tuple[float, float], score: str, word: str, tint: Hex) -> Iterator[Item]:
    yield Box(corner, *size, tint, "paper")
    x = corner[0] + size[0] / 2
    y = corner[1] + size[1] / 2
    if not word:
        yield from chart.words(score or "·", (x, y), color=Hex("#1f2933"))
        return
    lines = "\n".join(textwrap.wrap(word, 14))
    yield from chart.words(score, (x, y - 0.14 * (1 + lines.count("\n"))), color=Hex("#1f2933"), bold=True)
    yield from chart.words(lines, (x, y + 0.2), 0.2, color=Hex("#1f2933"))
