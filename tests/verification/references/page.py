"""The table and the picture of learners beside those of other libraries, in docs/explain/learners.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskspec.base.display import fixed, interval
from taskspec.exam import Exam
from taskspec.learn.exam.score_rows import task_name
from taskspec.learn.statistics import seeds_interval
from taskspec.show.figures import chart

DOCS = Path(__file__).parents[3] / "docs"
PAGE = DOCS / "explain/learners.md"
PICTURE = DOCS / "pictures/references.svg"
NAMES = {"ppo": "PPO", "bc": "behavioural cloning", "gail": "GAIL"}
HEAD = """\
| learner | task | library | seeds | score, ours | theirs | mean of the curve, ours | theirs |
|---|---|---|---|---|---|---|---|"""


@dataclass(frozen=True)
class Runs:
    """Of every seed the score in the end, and the curve: steps, and scores (seeds, points), of which there may be none."""

    scores: list[float]
    steps: list[float]
    curves: np.ndarray

    @property
    def areas(self) -> list[float]:
        """The mean of each curve, its last point included."""
        return [float(np.mean([*curve, last])) for curve, last in zip(self.curves, self.scores, strict=True)]


@dataclass(frozen=True)
class Compared:
    """One of our learners on a task, beside that of a library."""

    learner: str
    task: str
    library: str
    ours: Runs
    theirs: Runs

    @property
    def overlap(self) -> bool:
        """Whether intervals of scores overlap, and those of curves."""
        pairs = [(self.ours.scores, self.theirs.scores), (self.ours.areas, self.theirs.areas)]
        return all(a[0] <= b[1] and b[0] <= a[1] for a, b in ([_interval(side) for side in pair] for pair in pairs))


def compared(learner: str, library: str, ours: Exam, theirs: Exam) -> list[Compared]:
    return [Compared(learner, task, library, *(_runs(exam, task) for exam in (ours, theirs))) for task in ours["tasks"]]


def _runs(exam: Exam, task: str) -> Runs:
    own = [score for score in exam["scores"] if score["task"] == task]
    failed = [score["error"] for score in own if score["error"] is not None]
    assert not failed, failed[0]
    curves = [score["curve"] or [] for score in own]
    return Runs(
        [score["deterministic"] or 0.0 for score in own], [float(x or 0) for x, _ in curves[0]],
        np.array([[y for _, y in curve] for curve in curves], float).reshape(len(own), -1),
    )  # fmt: skip


def row(found: Compared) -> str:
    """A line of the table."""
    cells = [NAMES[found.learner], task_name(found.task), found.library, str(len(found.ours.scores))]
    cells += [_told(values) for values in (found.ours.scores, found.theirs.scores)]
    has_curve = found.ours.curves.size > 0
    cells += [_told(runs.areas) if has_curve else "" for runs in (found.ours, found.theirs)]
    return f"| {' | '.join(cells)} |"


def _told(values: Sequence[float]) -> str:
    low, high = _interval(values)
    spread = interval(low, high) if low < high else "all seeds alike"
    return f"{fixed(float(np.mean(values)), 2)}, {spread}"


def _interval(values: Sequence[float]) -> tuple[float, float]:
    return seeds_interval(values)


def written(found: Sequence[Compared]) -> None:
    """Put the table into the page, and draw the curves beside it."""
    table = "\n".join([HEAD, *map(row, found)])
    text = PAGE.read_text(encoding="utf-8")
    text, count = re.subn(
        r"(<!-- references -->).*?(<!-- /references -->)", rf"\g<1>\n{table}\n\g<2>", text, flags=re.DOTALL
    )
    assert count == 1, "the page has no place for the table"
    PAGE.write_text(text, encoding="utf-8")
    draw([each for each in found if each.ours.curves.size])


def draw(found: Sequence[Compared]) -> None:
    """Learning curves: means over seeds, with their 95 % intervals."""
    with chart.style():
        figure = chart.figure(2.4 * len(found), 2.2, layout="constrained")
        for i, each in enumerate(found):
            axes = figure.add_subplot(1, len(found), i + 1)
            both = ((each.ours, "ours"), (each.theirs, each.library))
            for (runs, label), (color, dash, _) in zip(both, chart.SERIES, strict=False):
                low, high = zip(*(_interval(column) for column in runs.curves.T), strict=True)
                axes.plot(runs.steps, runs.curves.mean(axis=0), color=color, linestyle=dash, label=label)
                chart.band(axes, runs.steps, low, high, color)
            axes.axhline(1, color=chart.MUTED, linestyle=":", linewidth=0.8)
            axes.set_title(f"{NAMES[each.learner]}, {task_name(each.task)}", fontsize=8)
            axes.set_xlabel("steps")
            axes.set_xticks([runs.steps[-1]], [f"{runs.steps[-1] / 1000:.0f}k"])
            if i == 0:
                axes.set_ylabel(chart.SCORE)
        chart.key_below(figure, 4)
    chart.save(chart.Chart(figure, "Learning curves, ours and those of other libraries"), PICTURE)
