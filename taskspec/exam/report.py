"""Reports of exams in files: one static HTML page without scripts, pictures, and tables in Parquet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.files import write_text
from taskspec.exam import score_charts, score_rows
from taskspec.exam.learned import learned_notes
from taskspec.exam.score_rows import SeedCell, TaskRow
from taskspec.figures import chart, save
from taskspec.figures.chart import Scale
from taskspec.figures.scene import Scene
from taskspec.figures.vector_formats import svg
from taskspec.pages.render.html import page_of


def _html(exam: Mapping[str, Any], path: Path) -> None:
    write_text(path, page(exam))


def _picture(exam: Mapping[str, Any], path: Path) -> None:
    save(score_charts.of_exam(exam), path)


def _parquet(exam: Mapping[str, Any], path: Path) -> None:
    score_rows.write_scores({exam["learner"]: exam}, path)


_WRITERS: dict[str, tuple[str, Callable[[Mapping[str, Any], Path], None]]] = {
    "html": ("report.html", _html), "png": ("report.png", _picture), "pdf": ("report.pdf", _picture),
    "svg": ("report.svg", _picture), "parquet": ("scores.parquet", _parquet),
}  # fmt: skip
FORMATS = tuple(_WRITERS)
"""Forms of a report besides `exam.json`, which it is made of."""
PICTURES = ("png", "pdf", "svg")


def write(exam: Mapping[str, Any], folder: Path | str, formats: Iterable[str] = ("html",)) -> list[Path]:
    """Write reports of an exam into a folder.

    Args:
        exam: what `exam.json` holds.
        folder: made if need be.
        formats: of `FORMATS`.

    Returns:
        The files written, in order.

    Raises:
        SpecError: E713 for another format; E705 for PNG and PDF without matplotlib, for tables without pyarrow; E716 for a file
            that cannot be written.
    """
    written = []
    for name in _known(formats, FORMATS):
        file, writer = _WRITERS[name]
        writer(exam, Path(folder) / file)
        written.append(Path(folder) / file)
    return written


def write_several(exams: Mapping[str, Mapping[str, Any]], folder: Path | str, formats: Iterable[str]) -> list[Path]:
    """Write exams of several learners side by side, as the paper has them.

    Args:
        exams: what `exam.json` holds, by what the learner is called.
        folder: made if need be.
        formats: of `PICTURES`: a heat map `table`, and box plots `task-NAME` and `learner-NAME`; `parquet`: all scores.

    Returns:
        The files written, in order.

    Raises:
        SpecError: as `write`.
    """
    place = Path(folder)
    written = []
    for name in _known(formats, (*PICTURES, "parquet")):
        if name == "parquet":
            written.append(score_rows.write_scores(exams, place / "scores.parquet"))
        else:
            written += [save(scene, place / f"{stem}.{name}") for stem, scene in score_charts.of_several(exams)]
    return written


def _known(formats: Iterable[str], known: Sequence[str]) -> list[str]:
    """Return the formats asked for, each once, or raise E713 for an unknown one."""
    wanted = list(dict.fromkeys(formats))
    for name in wanted:
        if name not in known:
            hint = suggest(name, known) or f"use {', '.join(known)}"
            raise SpecError([Diagnostic("E713", None, f"'{name}' is not a format of this report", hint)])
    return wanted


# The page.


def page(exam: Mapping[str, Any]) -> str:
    """Return the page of an exam."""
    rows = score_rows.rows(exam)
    scores = score_charts.strip_axis(rows)
    return page_of(
        "report.html", learner=exam["learner"], suite=exam["suite"], headline=score_rows.headline(exam),
        finding=score_rows.finding(exam),
        verdicts=[_verdict(name, verdict) for name, verdict in exam["verdicts"].items()],
        rows=[_row(row, scores) for row in rows], axis=_embedded(score_charts.strip_head(scores), "strip axis"),
        curves=[_curves(row) for row in rows if row.curves],
        diagnoses=[each | {key: _code(each[key]) for key in ("message", "cause", "try")} for each in exam["diagnoses"]],
        flags=[_flag(flag) for flag in exam["flags"]],
        notes=[_code(note) for note in learned_notes(exam["scores"])], facts=_facts(exam),
    )  # fmt: skip


def _verdict(capability: str, verdict: Mapping[str, Any]) -> dict[str, str]:
    grade = verdict["verdict"]
    twins = verdict["twins"]
    passed = ""
    if "passed" in verdict:
        passed = f"{verdict['passed']} of {verdict['seeds']} seeds pass"
    return {
        "capability": capability, "grade": grade, "sign": score_rows.SIGNS[grade], "mean": _mean(verdict),
        "passed": passed,
        "twins": _mean(twins) if twins and twins["verdict"] != "masters" else "",
    }  # fmt: skip


def _mean(found: Mapping[str, Any]) -> str:
    """Return a mean with its interval; nothing if there is none."""
    interval = score_rows.interval(found["low"], found["high"])
    return score_rows.decimal(found["mean"]) + (f", 95 % from {interval}" if interval else "")


def _embedded(scene: Scene, kind: str) -> Markup:
    return Markup(svg(scene, css=True, kind=kind))


def _curves(row: TaskRow) -> dict[str, Any]:
    last = max(x for curve in row.curves for x, _ in curve)
    return {
        "name": row.name,
        "picture": _embedded(score_charts.small_curves(row), "curves"),
        "steps": score_rows.steps(last),
    }


def _row(row: TaskRow, scores: Scale) -> dict[str, Any]:
    constant = SeedCell(() if row.constant is None else (row.constant,))
    cells = (("printed", row.printed), ("twins", row.twins), ("drawn", row.drawn), ("constant", constant))
    picture = _embedded(score_charts.strip(row, scores), "strip")
    return {
        "name": row.name, "grade": row.grade, "sign": score_rows.SIGNS[row.grade] if row.grade else "",
        "picture": picture, "capability": row.capability, "cells": [_cell(name, cell) for name, cell in cells],
    }  # fmt: skip


def _cell(name: str, cell: SeedCell) -> dict[str, str]:
    background = score_charts.background(cell)
    return {
        "name": name, "words": cell.words or "–", "background": chart.hexadecimal(background), "ink": chart.ink(background),
        "title": score_rows.interval(*cell.interval) if len(cell.scores) > 1 else "",
    }  # fmt: skip


def _code(text: str) -> Markup:
    """Return words with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 and i < len(parts) - 1 else part for i, part in enumerate(parts)
    )


def _flag(flag: Mapping[str, Any]) -> dict[str, Any]:
    return {**flag, "task": score_rows.named(flag["task"]), "message": _code(flag["message"]), "size": _size(flag)}


def _size(flag: Mapping[str, Any]) -> str:
    if flag["effect"] is None:
        return ""
    ends = score_rows.interval(flag["low"], flag["high"])
    return f"{score_rows.decimal(flag['effect'])}{f' (95 % from {ends})' if ends else ''}"


def _facts(exam: Mapping[str, Any]) -> dict[str, str]:
    """Return how the exam was run: cost, command, versions, machine."""
    versions = ", ".join(f"{name} {version}" for name, version in exam["versions"].items())
    machine = ", ".join(f"{name} {value}" for name, value in exam["machine"].items())
    left_out = {"Cannot learn": "; ".join(score_rows.left_out(exam))} if score_rows.left_out(exam) else {}
    return left_out | {
        "Cost": score_rows.costs(exam),
        "Command": exam["command"],
        "Versions": versions,
        "Machine": machine,
    }
