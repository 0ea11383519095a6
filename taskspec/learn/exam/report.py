"""Reports of exams in files: one static HTML page without scripts, pictures, and tables in Parquet."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.display import interval, plural
from taskspec.base.extras import install
from taskspec.base.files import safe_name, whole, write_text
from taskspec.learn.data.datasets import write_table
from taskspec.learn.exam import card_charts, card_picture
from taskspec.learn.exam.card import Card, LearnerMatrix, card, matrix
from taskspec.learn.exam.card_picture import picture, strips
from taskspec.learn.exam.score_rows import TaskRow, forms_of
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from taskspec.show.pages.render.html import page_of

TINTS: dict[str | None, str] = {
    "masters": chart.TINT_MASTERS, "passes": chart.TINT_UNSURE, "unsure": chart.TINT_UNSURE, "fails": chart.TINT_FAILS,
    None: chart.TINT_NONE,
}  # fmt: skip
"""The same colours as backgrounds of numbers."""
CELL = (0.9, 0.42)
"""Width and height of a cell of a matrix, in inches."""
LONGEST = 12
"""Letters in a line above a column of a matrix."""


def of_several(learners: LearnerMatrix) -> Iterator[tuple[str, Chart]]:
    """Yield charts of several learners by the stems of their files: `table`, and strips `task-NAME` and `learner-NAME`."""
    yield "table", table(learners)
    for j, task in enumerate(learners.tasks):
        named = []
        for name, row in zip(learners.learners, learners.cells, strict=True):
            if row[j].capability:
                named.append((name, row[j]))
        yield _stem(f"task-{task}"), strips(named, [(task, chart.INK, "bold")], f"Scores on {task}")
    for name, shown in learners.cards.items():
        yield _stem(f"learner-{name}"), picture(shown)


def _stem(name: str) -> str:
    return safe_name(re.sub(r"[^\w.=-]+", "-", name).strip("-"))


def table(shown: LearnerMatrix) -> Chart:
    """Draw a matrix of learners and tasks: mean scores as published, flags or verdicts in words, verdicts as colours."""
    width, height = CELL
    across = len(shown.tasks)
    down = len(shown.learners)
    with chart.style():
        figure = chart.figure(width * across, height * down)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(0, across)
        axes.set_ylim(down, 0)
        axes.xaxis.tick_top()
        axes.set_xticks([j + 0.5 for j in range(across)], map(_headed, shown.tasks))
        axes.set_yticks([i + 0.5 for i in range(down)], shown.learners)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        for i, cells in enumerate(shown.cells):
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


PICTURES = ("png", "pdf", "svg")
FORMATS = ("html", *PICTURES, "parquet")
"""Forms of a report other than `exam.json`."""
COLUMNS = (
    "task", "twin", "peek", "seed", "deterministic", "stochastic", "half", "return", "error", "steps", "demonstrations",
    "comparisons", "seconds", "starc", "reward_regret",
)  # fmt: skip
"""Of a score, as `exam.json` calls them; learning curves are left to it."""


def write(exam: Mapping[str, Any], folder: Path | str, formats: Iterable[str] = ("html",)) -> list[Path]:
    """Write reports of an exam into a folder.

    Args:
        exam: what `exam.json` holds.
        folder: made if need be.
        formats: of `FORMATS`.

    Returns:
        The files written, in order.

    Raises:
        SpecError: E726 for another format; E705 for PNG and PDF without matplotlib, for tables without pyarrow; E716 for a file
            that cannot be written.
    """
    return write_several({exam["learner"]: exam}, folder, formats)


def write_several(exams: Mapping[str, Mapping[str, Any]], folder: Path | str, formats: Iterable[str]) -> list[Path]:
    """Write exams of several learners side by side; of one learner, its reports.

    Args:
        exams: what `exam.json` holds, by what the learner is called.
        folder: made if need be.
        formats: of `FORMATS`: a page `learners.html`; pictures of the matrix, `table`, and of strips, `task-NAME` and
            `learner-NAME`; `parquet`: all scores.

    Returns:
        The files written, in order.

    Raises:
        SpecError: as `write`.
    """
    place = Path(folder)
    stem = "learners"
    if len(exams) == 1:
        stem = "report"
    written = []
    for name in _known(formats):
        if name == "parquet":
            written.append(write_file(exams, place / "scores.parquet"))
        elif name == "html" or len(exams) == 1:
            written.append(write_file(exams, place / f"{stem}.{name}"))
        else:
            cards = {learner: card(exam) for learner, exam in exams.items()}
            for part, drawn in of_several(matrix(cards)):
                written.append(chart.save(drawn, place / f"{part}.{name}"))
    return written


def write_file(exams: Mapping[str, Mapping[str, Any]], path: Path, is_narrow: bool = False) -> Path:
    """Write exams into one file: a page, a picture or a table; of several learners, the picture is their matrix.

    Args:
        exams: what `exam.json` holds, by what the learner is called.
        path: its ending is one of `FORMATS`.
        is_narrow: whether the card of one learner is as narrow as a telephone.

    Raises:
        SpecError: as `write`.
    """
    (name,) = _known([path.suffix[1:]])
    if name == "parquet":
        return write_scores(exams, path)
    cards = {learner: card(exam) for learner, exam in exams.items()}
    if len(cards) > 1:
        if name == "html":
            write_text(path, page_of_several(matrix(cards)))
            return path
        return chart.save(table(matrix(cards)), path)
    (shown,) = cards.values()
    if name == "html":
        write_text(path, page(shown))
        return path
    layout = card_picture.WIDE
    if is_narrow:
        layout = card_picture.NARROW
    return chart.save(card_picture.picture(shown, layout), path)


def write_paper(exam: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write the scores of an exam as pictures for one column and for two columns of a paper, as PDF and SVG.

    Raises:
        SpecError: as `write`.
    """
    shown = card(exam)
    written = []
    for stem, layout in card_picture.PAPER.items():
        for suffix in ("pdf", "svg"):
            written.append(chart.save(card_picture.picture(shown, layout), folder / f"{stem}.{suffix}"))
    return written


def write_scores(exams: Mapping[str, Mapping[str, Any]], path: Path) -> Path:
    """Write the scores of exams, by the name of the learner, which is the first column.

    Raises:
        SpecError: E705 without pyarrow; E716, it cannot be written.
    """
    rows: list[dict[str, Any]] = []
    for learner, exam in exams.items():
        rows += [{"learner": learner, **score} for score in exam["scores"]]
    columns = {}
    for name in ("learner", *COLUMNS):
        columns[name] = [row.get(name) for row in rows]
    with whole(path) as place:
        write_table(place, columns)
    return path


def _known(formats: Iterable[str]) -> list[str]:
    wanted = list(dict.fromkeys(formats))
    for name in wanted:
        if name not in FORMATS:
            hint = suggest(name, FORMATS) or f"use {', '.join(FORMATS)}"
            raise SpecError([Diagnostic("E726", None, f"'{name}' is not a format of this report", hint)])
    return wanted


# -- pages


def page(shown: Card) -> str:
    forms = forms_of(shown.rows)
    ends = card_charts.score_ends(shown.rows)
    curves = []
    for row in (*shown.rows, *shown.others):
        if row.curves and chart.is_available():
            curves.append({"name": row.name, "picture": _embedded("curves", card_charts.curves, row)})
    diagnoses = []
    for each in shown.diagnoses:
        marked_up = {key: _code(each[key]) for key in ("message", "cause", "try")}
        diagnoses.append({**each, **marked_up})
    return page_of(
        "report.html", card=shown, lead=_code(shown.lead), advice=_code(shown.advice), forms=[*forms, "seeds pass"],
        rows=[_row(row, forms, ends) for row in shown.rows], axis=_embedded("strip axis", card_charts.strip_head, ends),
        install=install("figures"), curves=curves, diagnoses=diagnoses,
        flags=[{"kind": flag.kind, "words": _code(flag.words)} for flag in shown.flags], notes=map(_code, shown.notes),
    )  # fmt: skip


def page_of_several(shown: LearnerMatrix) -> str:
    rows = []
    for name, cells, own in zip(shown.learners, shown.cells, shown.cards.values(), strict=True):
        rows.append({"learner": name, "cells": cells, "lead": _code(own.lead), "advice": _code(own.advice)})
    title = f"{plural(len(shown.learners), 'learner')} on {plural(len(shown.tasks), 'task')}"
    return page_of("learners.html", title=title, tasks=map(_breakable, shown.tasks), rows=rows)


def _breakable(name: str) -> Markup:
    parts = re.split(r"(?<=[a-z])(?=[A-Z])", name)
    return Markup("<wbr>").join(parts)


def _embedded(kind: str, draw: Callable[..., Chart], *drawn: Any) -> Markup:
    """Return a chart for a page; nothing without matplotlib."""
    if not chart.is_available():
        return Markup()
    return Markup(chart.svg(draw(*drawn), kind))


def _row(row: TaskRow, forms: Sequence[str], ends: card_charts.Ends) -> dict[str, Any]:
    numbers = []
    for form in forms:
        cell = row.forms[form]
        ends_of_mean = ""
        if cell.interval:
            ends_of_mean = interval(*cell.interval)
        numbers.append({"form": form, "words": cell.words, "interval": ends_of_mean})
    numbers.append({"form": "seeds pass", "words": row.passed, "interval": ""})
    return {"task": row, "numbers": numbers, "picture": _embedded("strip", card_charts.strip, row, ends)}


def _code(text: str) -> Markup:
    parts = text.split("`")
    for i in range(1, len(parts) - 1, 2):
        parts[i] = Markup("<code>{}</code>").format(parts[i])
    return Markup("").join(parts)
