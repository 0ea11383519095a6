"""Reports of exams in files: one static HTML page without scripts, pictures, and tables in Parquet."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.extras import install
from taskspec.base.files import write_text
from taskspec.learn.exam import score_charts, score_rows
from taskspec.learn.exam.card import card, matrix
from taskspec.learn.exam.score_rows import TaskRow, counted, forms_of
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from taskspec.show.pages.render.html import page_of

PICTURES = ("png", "pdf", "svg")
FORMATS = ("html", *PICTURES, "parquet")
"""Forms of a report other than `exam.json`."""


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
    written = []
    for name in _known(formats):
        if name == "parquet":
            written.append(score_rows.write_scores(exams, place / "scores.parquet"))
        elif len(exams) == 1:
            (exam,) = exams.values()
            written.append(_write_one(exam, place / f"report.{name}"))
        elif name == "html":
            write_text(place / "learners.html", page_of_several(exams))
            written.append(place / "learners.html")
        else:
            written += [chart.save(drawn, place / f"{stem}.{name}") for stem, drawn in score_charts.of_several(exams)]
    return written


def _write_one(exam: Mapping[str, Any], path: Path) -> Path:
    """Write the page of an exam, or its picture."""
    if path.suffix == ".html":
        write_text(path, page(exam))
        return path
    return chart.save(score_charts.picture(card(exam)), path)


def _known(formats: Iterable[str]) -> list[str]:
    """Return the formats asked for, each once, or raise E726 for an unknown one."""
    wanted = list(dict.fromkeys(formats))
    for name in wanted:
        if name not in FORMATS:
            hint = suggest(name, FORMATS) or f"use {', '.join(FORMATS)}"
            raise SpecError([Diagnostic("E726", None, f"'{name}' is not a format of this report", hint)])
    return wanted


# -- pages


def page(exam: Mapping[str, Any]) -> str:
    """Return the page of an exam."""
    shown = card(exam)
    forms = forms_of(shown.rows)
    scores = score_charts.score_ends(shown.rows)
    return page_of(
        "report.html", card=shown, suite=exam["suite"], lead=_code(shown.lead), advice=_code(shown.advice),
        forms=[*forms, "seeds pass"], rows=[_row(row, forms, scores) for row in shown.rows],
        axis=_embedded("strip axis", score_charts.strip_head, scores),
        curves=[
            {"name": row.name, "picture": _embedded("curves", score_charts.curves, row)}
            for row in (*shown.rows, *shown.others)
            if row.curves and chart.is_available()
        ],
        install=install("figures"),
        diagnoses=[{**each, **{key: _code(each[key]) for key in ("message", "cause", "try")}} for each in shown.diagnoses],
        flags=[{"kind": flag.kind, "words": _code(flag.words)} for flag in shown.flags],
        notes=[_code(note) for note in shown.notes],
        facts=_facts(exam),
    )  # fmt: skip


def page_of_several(exams: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the page of several learners side by side."""
    found = matrix(exams)
    rows = [
        {"learner": name, "cells": cells, "lead": _code(own.lead), "advice": _code(own.advice)}
        for name, cells, own in zip(found.learners, found.cells, found.cards, strict=True)
    ]
    title = f"{counted(len(found.learners), 'learner')} on {counted(len(found.tasks), 'task')}"
    return page_of("learners.html", title=title, tasks=map(_breakable, found.tasks), rows=rows)


def _breakable(name: str) -> Markup:
    """Return a name that may be broken before its capital letters."""
    parts = re.split(r"(?<=[a-z])(?=[A-Z])", name)
    return Markup("<wbr>").join(parts)


def _embedded(kind: str, draw: Callable[..., Chart], *drawn: Any) -> Markup:
    """Return a chart for a page; nothing without matplotlib."""
    if not chart.is_available():
        return Markup()
    return Markup(chart.svg(draw(*drawn), kind))


def _row(row: TaskRow, forms: Sequence[str], scores: score_charts.Ends) -> dict[str, Any]:
    """Return a task with its strip, and its numbers in words, each with its interval."""
    numbers = []
    for form in forms:
        cell = row.forms[form]
        numbers.append({"form": form, "words": cell.words, "interval": score_rows.interval(*cell.interval)})
    numbers.append({"form": "seeds pass", "words": row.passed, "interval": ""})
    return {"task": row, "numbers": numbers, "picture": _embedded("strip", score_charts.strip, row, scores)}


def _code(text: str) -> Markup:
    """Return words with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 and i < len(parts) - 1 else part for i, part in enumerate(parts)
    )


def _facts(exam: Mapping[str, Any]) -> dict[str, str]:
    """Return how the exam was run: cost, command, versions, machine."""
    versions = ", ".join(f"{name} {version}" for name, version in exam["versions"].items())
    machine = ", ".join(f"{name} {value}" for name, value in exam["machine"].items())
    return {
        "Cost": score_rows.costs(exam),
        "Command": exam["command"],
        "Versions": versions,
        "Machine": machine,
    }
