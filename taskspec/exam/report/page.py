"""An exam as one static HTML page: no script, no network, light and dark, wide and narrow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from taskspec.exam.report import pictures
from taskspec.exam.report import rows as report_rows
from taskspec.exam.report.rows import SeedCell, TaskRow
from taskspec.figures import chart
from taskspec.figures.chart import Scale
from taskspec.figures.scene import Scene
from taskspec.figures.svg import svg
from taskspec.pages.render.html import page_of


def page(exam: Mapping[str, Any]) -> str:
    """Return the page of an exam."""
    rows = report_rows.rows(exam)
    scores = pictures.strip_axis(rows)
    return page_of(
        "report.html", learner=exam["learner"], suite=exam["suite"], headline=report_rows.headline(exam),
        finding=report_rows.finding(exam),
        verdicts=[_verdict(name, verdict) for name, verdict in exam["verdicts"].items()],
        rows=[_row(row, scores) for row in rows], axis=_picture(pictures.strip_head(scores), "strip axis"),
        curves=[_curves(row) for row in rows if row.curves],
        diagnoses=[each | {key: _code(each[key]) for key in ("message", "cause", "try")} for each in exam["diagnoses"]],
        flags=[flag | {"task": report_rows.named(flag["task"]), "size": _size(flag)} for flag in exam["flags"]],
        facts=_facts(exam),
    )  # fmt: skip


def _verdict(capability: str, verdict: Mapping[str, Any]) -> dict[str, str]:
    grade = verdict["verdict"]
    twins = verdict["twins"]
    return {
        "capability": capability, "grade": grade, "sign": report_rows.SIGNS[grade], "mean": _mean(verdict),
        "twins": _mean(twins) if twins and twins["verdict"] != "masters" else "",
    }  # fmt: skip


def _mean(found: Mapping[str, Any]) -> str:
    """Return a mean with its interval; nothing if there is none."""
    interval = report_rows.interval(found["low"], found["high"])
    return report_rows.decimal(found["mean"]) + (f", 95 % from {interval}" if interval else "")


def _picture(scene: Scene, kind: str) -> Markup:
    return Markup(svg(scene, css=True, kind=kind))


def _curves(row: TaskRow) -> dict[str, Any]:
    last = max(x for curve in row.curves for x, _ in curve)
    return {
        "name": row.name,
        "picture": _picture(pictures.small_curves(row), "curves"),
        "steps": report_rows.steps(last),
    }


def _row(row: TaskRow, scores: Scale) -> dict[str, Any]:
    constant = SeedCell(() if row.constant is None else (row.constant,))
    cells = (("printed", row.printed), ("twins", row.twins), ("drawn", row.drawn), ("constant", constant))
    picture = _picture(pictures.strip(row, scores), "strip")
    return {
        "name": row.name, "grade": row.grade, "sign": report_rows.SIGNS[row.grade] if row.grade else "",
        "picture": picture, "capability": row.capability, "cells": [_cell(name, cell) for name, cell in cells],
    }  # fmt: skip


def _cell(name: str, cell: SeedCell) -> dict[str, str]:
    background = pictures.background(cell)
    return {
        "name": name, "words": cell.words or "–", "background": chart.hexadecimal(background), "ink": chart.ink(background),
        "title": report_rows.interval(*cell.interval) if len(cell.scores) > 1 else "",
    }  # fmt: skip


def _code(text: str) -> Markup:
    """Return words with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 and i < len(parts) - 1 else part for i, part in enumerate(parts)
    )


def _size(flag: Mapping[str, Any]) -> str:
    if flag["effect"] is None:
        return ""
    ends = report_rows.interval(flag["low"], flag["high"])
    return f"{report_rows.decimal(flag['effect'])}{f' (95 % from {ends})' if ends else ''}"


def _facts(exam: Mapping[str, Any]) -> dict[str, str]:
    """Return how the exam was run: cost, command, versions, machine."""
    versions = ", ".join(f"{name} {version}" for name, version in exam["versions"].items())
    machine = ", ".join(f"{name} {value}" for name, value in exam["machine"].items())
    left_out = {"Cannot learn": "; ".join(report_rows.left_out(exam))} if report_rows.left_out(exam) else {}
    return left_out | {
        "Cost": report_rows.costs(exam),
        "Command": exam["command"],
        "Versions": versions,
        "Machine": machine,
    }
