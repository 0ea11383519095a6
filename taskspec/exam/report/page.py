"""An exam as one static HTML page, with drawings of seeds and learning curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from taskspec.exam.report import rows as told
from taskspec.exam.report.rows import SeedCell, TaskRow
from taskspec.pages.render.html import page_of

# ---------- strips
# Drawings of a page: the seeds of a task on one line, and learning curves, as SVG whose colours the style sheet gives.

WIDTH, LANE, MARGIN = 340.0, 17.0, 8.0
PANEL, HIGH = 170.0, 96.0
"""Of a panel of learning curves: its width and height."""


def scale(rows: Sequence[TaskRow]) -> tuple[float, float]:
    """The lowest and the highest score that is shown."""
    shown = told.cut([score for row in rows for cell in (row.printed, row.twins) for score in cell.scores])
    return min([0.0, *shown]), max([1.0, *shown])


def strip(row: TaskRow, ends: tuple[float, float]) -> Markup:
    """Every seed a dot, the 95 % interval of the mean a box, the mean a line, the range a whisker: as printed, then twins."""
    lanes = [(cell, kind) for cell, kind in ((row.printed, "printed"), (row.twins, "twins")) if cell.scores]
    height = LANE * max(len(lanes), 1) + 4
    body = [_rule(x, height, ends, kind) for x, kind in ((0.0, "random"), (1.0, "expert"))]
    body += [_lane(cell, kind, 2 + LANE * (i + 0.5), ends) for i, (cell, kind) in enumerate(lanes)]
    label = "; ".join(
        f"{kind}: mean {told.decimal(cell.mean)} {told.interval(*cell.interval)}".strip() for cell, kind in lanes
    )
    return _svg("strip", WIDTH, height, f"{row.name}, {label or 'not run'}", body)


def _svg(kind: str, width: float, height: float, label: str, body: Sequence[Markup]) -> Markup:
    head = Markup('<svg class="{}" viewBox="0 0 {} {}" role="img"><title>{}</title>').format(
        kind, _n(width), _n(height), label
    )
    return head + Markup("").join(body) + Markup("</svg>")


def _at(score: float, ends: tuple[float, float]) -> float:
    low, high = ends
    return MARGIN + (max(score, told.FLOOR) - low) / (high - low) * (WIDTH - 2 * MARGIN)


def _rule(score: float, height: float, ends: tuple[float, float], kind: str) -> Markup:
    x = _n(_at(score, ends))
    return Markup('<line class="rule {}" x1="{}" x2="{}" y1="0" y2="{}"/>').format(kind, x, x, _n(height))


def _lane(cell: SeedCell, kind: str, y: float, ends: tuple[float, float]) -> Markup:
    low, high = (_at(end, ends) for end in cell.interval)
    first, last = _at(min(cell.scores), ends), _at(max(cell.scores), ends)
    middle = _at(cell.mean or 0.0, ends)
    parts = [
        Markup('<line class="range" x1="{}" x2="{}" y1="{}" y2="{}"/>').format(_n(first), _n(last), _n(y), _n(y)),
        Markup('<rect class="box" x="{}" y="{}" width="{}" height="9" rx="1.5"/>').format(_n(low), _n(y - 4.5), _n(high - low)),
        *(Markup('<circle class="dot" cx="{}" cy="{}" r="1.9"/>').format(_n(_at(s, ends)), _n(y)) for s in cell.scores),
        Markup('<line class="mean" x1="{}" x2="{}" y1="{}" y2="{}"/>').format(_n(middle), _n(middle), _n(y - 6), _n(y + 6)),
    ]  # fmt: skip
    return Markup('<g class="{}">{}</g>').format(kind, Markup("").join(parts))


def axis(ends: tuple[float, float]) -> Markup:
    """What stands above the strips: where random actions and the expert are."""
    words = ((0.0, "random 0"), (1.0, "expert 1"))
    ticks = [
        Markup('<text x="{}" y="11" text-anchor="{}">{}</text>').format(
            _n(_at(x, ends)), "end" if WIDTH - _at(x, ends) < 30 else "start" if _at(x, ends) < 30 else "middle", text
        )
        for x, text in words
    ]
    return _svg("strip axis", WIDTH, 14, "scores: random actions 0, expert 1", ticks)


def curves(row: TaskRow) -> Markup:
    """Scores over steps: every seed thin, the mean thick, lines at the optimum, the expert and random actions."""
    points = [point for curve in row.curves for point in curve]
    last = max([x for x, _ in points] + [1.0])
    values = [*told.cut([y for _, y in points]), 0.0, 1.0, *([] if row.optimum is None else [row.optimum])]
    low, high = min(values), max(values)

    def place(x: float, y: float) -> str:
        return f"{_n(4 + x / last * (PANEL - 8))},{_n(5 + (high - max(y, told.FLOOR)) / (high - low) * (HIGH - 10))}"

    def line(kind: str, curve: Sequence[tuple[float, float]]) -> Markup:
        return Markup('<polyline class="{}" points="{}"/>').format(kind, " ".join(place(x, y) for x, y in curve))

    levels = [("optimum", row.optimum), ("expert", 1.0), ("random", 0.0)]
    body = [line(f"rule {kind}", [(0, y), (last, y)]) for kind, y in levels if y is not None]
    body += [line("seed", curve) for curve in row.curves]
    body += [line("middle", list(zip(*told.mean_curve(row.curves), strict=True)))]
    return _svg("curves", PANEL, HIGH, f"Learning curves of {row.name}, up to {told.steps(last)} steps", body)


def _n(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


# ---------- page
# An exam as one static HTML page: no script, no network, light and dark, wide and narrow.


def page(exam: Mapping[str, Any]) -> str:
    """The page of an exam."""
    rows = told.rows(exam)
    ends = scale(rows)
    return page_of(
        "report.html", learner=exam["learner"], suite=exam["suite"], headline=told.headline(exam), finding=told.finding(exam),
        verdicts=[_verdict(name, verdict) for name, verdict in exam["verdicts"].items()],
        rows=[_row(row, ends) for row in rows], axis=axis(ends),
        curves=[{"name": row.name, "picture": curves(row), "steps": _last(row)} for row in rows if row.curves],
        diagnoses=[each | {key: _code(each[key]) for key in ("message", "cause", "try")} for each in exam["diagnoses"]],
        flags=[flag | {"task": told.named(flag["task"]), "size": _size(flag)} for flag in exam["flags"]], facts=_facts(exam),
    )  # fmt: skip


def _verdict(capability: str, verdict: Mapping[str, Any]) -> dict[str, str]:
    grade, twins = verdict["verdict"], verdict["twins"]
    return {
        "capability": capability, "grade": grade, "sign": told.SIGNS[grade], "mean": _mean(verdict),
        "twins": _mean(twins) if twins and twins["verdict"] != "masters" else "",
    }  # fmt: skip


def _mean(found: Mapping[str, Any]) -> str:
    """A mean with its interval; nothing where there is none."""
    interval = told.interval(found["low"], found["high"])
    return told.decimal(found["mean"]) + (f", 95 % from {interval}" if interval else "")


def _row(row: TaskRow, ends: tuple[float, float]) -> dict[str, Any]:
    constant = SeedCell(() if row.constant is None else (row.constant,))
    cells = (("printed", row.printed), ("twins", row.twins), ("drawn", row.drawn), ("constant", constant))
    return {
        "name": row.name, "grade": row.grade, "sign": told.SIGNS[row.grade] if row.grade else "",
        "picture": strip(row, ends), "capability": row.capability, "cells": [_cell(name, cell) for name, cell in cells],
    }  # fmt: skip


def _cell(name: str, cell: SeedCell) -> dict[str, str]:
    background = told.NOT_RUN if cell.mean is None else told.colour(cell.mean)
    return {
        "name": name, "words": cell.words or "–", "background": told.hexadecimal(background), "ink": told.ink(background),
        "title": told.interval(*cell.interval) if len(cell.scores) > 1 else "",
    }  # fmt: skip


def _code(text: str) -> Markup:
    """Words with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 and i < len(parts) - 1 else part for i, part in enumerate(parts)
    )


def _size(flag: Mapping[str, Any]) -> str:
    if flag["effect"] is None:
        return ""
    ends = told.interval(flag["low"], flag["high"])
    return f"{told.decimal(flag['effect'])}{f' (95 % from {ends})' if ends else ''}"


def _last(row: TaskRow) -> str:
    return told.steps(max(x for curve in row.curves for x, _ in curve))


def _facts(exam: Mapping[str, Any]) -> dict[str, str]:
    """How it was run: cost, command, versions, machine."""
    versions = ", ".join(f"{name} {version}" for name, version in exam["versions"].items())
    machine = ", ".join(f"{name} {value}" for name, value in exam["machine"].items())
    left_out = {"Cannot learn": "; ".join(told.left_out(exam))} if told.left_out(exam) else {}
    return left_out | {"Cost": told.costs(exam), "Command": exam["command"], "Versions": versions, "Machine": machine}
