"""Drawings of a page: the seeds of a task on one line, and learning curves, as SVG whose colours the style sheet gives."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from taskspec.exam.report import told
from taskspec.exam.report.told import SeedCell, TaskRow

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
