"""Chart of findings: a row of squares for each family of learners and each set of results."""

from __future__ import annotations

from taskspec.learn.exam.findings import FindingResult, FindingsResult, Outcome
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart

SIGNS: dict[Outcome, str] = {"confirmed": "✓", "refuted": "✗", "undecided": "?", "not run": "·"}
TINTS: dict[Outcome, str] = {
    "confirmed": chart.TINT_MASTERS, "refuted": chart.TINT_FAILS, "undecided": chart.TINT_UNSURE, "not run": chart.TINT_NONE,
}  # fmt: skip
SQUARE = (0.46, 0.24)
"""Width and height of the square of a finding, in inches."""
LEFT = 2.1
"""Room for the names of families and sets, in inches."""
GAP = 0.35
"""Space between families, as a part of a square."""


def outcomes(found: FindingsResult) -> Chart:
    """Draw the outcome of every finding, by the learners that it is about and by the set of results."""
    families: dict[str, list[FindingResult]] = {}
    for each in found.results:
        families.setdefault(each.entry.about or "all", []).append(each)
    columns = max(map(len, families.values()))
    rows = (len(found.sets) + GAP) * len(families) + 1
    width, height = SQUARE
    with chart.style():
        figure = chart.figure(LEFT + columns * width, rows * height)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(-LEFT / width, columns)
        axes.set_ylim(rows, 0)
        axes.axis("off")
        y = 0.0
        for family, members in families.items():
            axes.text(-LEFT / width, y + 0.5, family, va="center", weight="bold")
            for name in found.sets:
                axes.text(-0.2, y + 0.5, name, va="center", ha="right", color=chart.MUTED)
                for x, each in enumerate(members):
                    outcome = each.outcome(name)
                    axes.bar(x + 0.5, 1, 1, bottom=y, color=TINTS[outcome], edgecolor=chart.PAPER, clip_on=False)
                    axes.text(x + 0.5, y + 0.5, f"{each.name} {SIGNS[outcome]}", ha="center", va="center", fontsize=7)
                y += 1
            y += GAP
        key = ",  ".join(f"{sign} {outcome}" for outcome, sign in SIGNS.items())
        axes.text(-LEFT / width, y + 0.5, key, va="center", color=chart.MUTED)
    return Chart(figure, _described(found))


def _described(found: FindingsResult) -> str:
    parts = []
    for name in found.sets:
        counts = ", ".join(f"{count} {outcome}" for outcome, count in found.counts(name).items() if count)
        parts.append(f"{name}: {counts}")
    return f"Outcomes of {len(found.results)} findings by learners. {'; '.join(parts)}"
