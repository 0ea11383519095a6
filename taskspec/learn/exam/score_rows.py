"""Rows of reports of exams: the scores of each task, as numbers and words, and tables in Parquet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base import ids
from taskspec.base.files import whole
from taskspec.envs.data.datasets import write_table
from taskspec.exact.rollout.statistics import seeds_interval
from taskspec.exact.rules.score_rules import seed_means, side
from taskspec.learn.exam.results import Grade
from taskspec.learn.exam.verdicts import MASTERED, WORST_FIRST, mean_score, worst

COLUMNS = (
    "task", "twin", "peek", "seed", "deterministic", "stochastic", "half", "return", "error", "steps", "demonstrations",
    "comparisons", "seconds", "starc", "reward_regret",
)  # fmt: skip
"""Of a score, as `exam.json` calls them; learning curves are left to it."""


def write_scores(exams: Mapping[str, Mapping[str, Any]], path: Path) -> Path:
    """Write the scores of exams, by the name of the learner, which is the first column.

    Raises:
        SpecError: E705 without pyarrow; E716, it cannot be written.
    """
    rows = [{"learner": name, **score} for name, exam in exams.items() for score in exam["scores"]]
    with whole(path) as place:
        write_table(place, {name: [row.get(name) for row in rows] for name in ("learner", *COLUMNS)})
    return path


# -- rows of a report

FLOOR = -1.0
"""The score at which pictures clip positions; numbers are printed as they are."""
SIGNS = {"masters": "✓", "passes": "=", "unsure": "?", "fails": "✗"}
PUBLISHED = "as published"
RELABELLED = "relabelled"
SAMPLED = "sampled"
FIXED = "best fixed action"
FORMS = (PUBLISHED, RELABELLED, SAMPLED, FIXED)
"""What scores are of: the task as its authors have it; its twins; the policy that samples its actions; the best fixed action."""


@dataclass(frozen=True)
class SeedCell:
    """The scores of one learner on a task, or on its twins (mean over them): a number for each seed; `cannot` where it has none
    because the learner is not for the task."""

    scores: tuple[float, ...]
    failed: int = 0
    cannot: bool = False

    @property
    def mean(self) -> float | None:
        return float(np.mean(self.scores)) if self.scores else None

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the mean; the mean itself, of one seed."""
        if len(self.scores) < 2:
            return (self.mean or 0.0,) * 2
        return seeds_interval(self.scores)

    @property
    def passed(self) -> int:
        """The number of seeds that pass."""
        return sum(score >= MASTERED for score in self.scores)

    @property
    def words(self) -> str:
        """The mean as text, or the reason why there is none."""
        if self.scores:
            return decimal(self.mean)
        if self.failed:
            return "failed"
        return "cannot" if self.cannot else ""


@dataclass(frozen=True)
class TaskRow:
    """A task of an exam, with what was found on it; `curves` are points (steps, score) for each seed."""

    id: str
    about: Mapping[str, Any]
    printed: SeedCell
    twins: SeedCell
    drawn: SeedCell
    curves: tuple[tuple[tuple[float, float], ...], ...]

    @property
    def name(self) -> str:
        return named(self.id)

    @property
    def capability(self) -> str:
        return str(self.about.get("capability") or self.name)

    @property
    def constant(self) -> float | None:
        """The score of the best constant action."""
        found = self.about.get("constant")
        return None if found is None else float(found)

    @property
    def fixed(self) -> float | None:
        """The score of the best action that is the same as printed and on twins; without twins, of the best constant one."""
        if self.twins.scores:
            return self.about.get("fixed")
        return self.constant

    @property
    def grade(self) -> Grade | None:
        """The grade of a task, as printed and as twins; None if it was not run."""
        known = [cell for cell in (self.printed, self.twins) if cell.scores]
        if not known:
            return None
        return worst([mean_score(cell.scores, self.fixed) for cell in known])["verdict"]

    @property
    def sign(self) -> str:
        """The sign of the grade, or of a run that failed; a dash where the learner is not for the task."""
        if self.printed.cannot:
            return "–"
        return SIGNS[self.grade or "fails"]

    @property
    def passed(self) -> str:
        """The number of seeds that pass as published, of all: `13/15`."""
        if not self.printed.scores:
            return ""
        return f"{self.printed.passed}/{len(self.printed.scores)}"

    @property
    def optimum(self) -> float | None:
        """The score of the best policy."""
        low, high, best = (self.about.get(key) for key in ("random", "expert", "optimal"))
        if low is None or high is None or best is None or high == low:
            return None
        return float((best - low) / (high - low))

    @property
    def worst(self) -> tuple[float, str]:
        """The lowest of the mean scores, and on which form of the task."""
        means = [(cell.mean, form) for cell, form in ((self.printed, PUBLISHED), (self.twins, RELABELLED))]
        return min(((mean, form) for mean, form in means if mean is not None), default=(math.inf, PUBLISHED))

    @property
    def rank(self) -> tuple[int, float]:
        """Sort key: runs that failed, then the worst verdicts, then the lowest scores."""
        if self.grade is None:
            return -1, 0.0
        return WORST_FIRST.index(self.grade), self.worst[0]

    @property
    def forms(self) -> dict[str, SeedCell]:
        """The scores by what they are scores of."""
        constant = SeedCell(() if self.constant is None else (self.constant,))
        return {PUBLISHED: self.printed, RELABELLED: self.twins, SAMPLED: self.drawn, FIXED: constant}


def forms_of(rows: Sequence[TaskRow]) -> list[str]:
    """Return the forms that some row has scores of; without the sampled policy where that scores the same everywhere."""
    forms = [form for form in FORMS if any(row.forms[form].words for row in rows)]
    if SAMPLED in forms and all(row.drawn.words in ("", row.printed.words) for row in rows):
        forms.remove(SAMPLED)
    return forms


def named(task: str) -> str:
    """Return the name of a task in a report: `NoisyObs`, or `NoisyObs, L=50` for one of several instances."""
    about = ids.parse(task)
    name = about.name.partition("/")[2].rpartition("-v")[0] or about.name
    return ", ".join([name, *(f"{key}={value}" for key, value in about.parameters.items()), *about.modifiers])


def left_out(exam: Mapping[str, Any]) -> list[str]:
    """Return the tasks that the learner is not made for, each with the reason."""
    return [f"{named(task)}: {why}" for task, about in exam["tasks"].items() if (why := about.get("cannot"))]


def rows(exam: Mapping[str, Any]) -> list[TaskRow]:
    """Return the tasks of an exam, in its order."""
    found = []
    for task, about in exam["tasks"].items():
        own = [record for record in exam["scores"] if record["task"] == task]
        sides = {which: [r for r in own if side(r) == which] for which in ("printed", "twin")}
        shown = [[(float(x), float(y)) for x, y in r["curve"] or () if y is not None] for r in sides["printed"]]
        curves = tuple(tuple(points) for points in shown if points)
        printed, drawn = (_cell(sides["printed"], entry) for entry in ("deterministic", "stochastic"))
        if about.get("cannot"):
            printed = SeedCell((), cannot=True)
        found.append(TaskRow(task, about, printed, _cell(sides["twin"], "deterministic"), drawn, curves))
    return found


def _cell(records: Sequence[Mapping[str, Any]], entry: str) -> SeedCell:
    failed = {record["seed"] for record in records if record.get("error") is not None}
    by_seed = seed_means([r for r in records if r.get("error") is None], lambda record: record.get(entry))
    return SeedCell(tuple(by_seed.values()), len(failed - by_seed.keys()))


# -- words ------------------------------------------------------------------------------------------------


def headline(exam: Mapping[str, Any]) -> str:
    """Return what was examined: `learns from demonstrations; 500,000 steps, 15 seeds`."""
    source = " and ".join(exam["learns_from"]) or "nothing"
    return f"learns from {source}; {exam['steps']:,} steps, {counted(len(exam['seeds']), 'seed')}"


def listed(names: Sequence[str]) -> str:
    """Return `a, b and c`."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def costs(exam: Mapping[str, Any]) -> str:
    """Return the cost of an exam: `7,500,000 steps, 150,000 demonstrated transitions, 84 s`."""
    cost = exam["cost"]
    parts = [f"{int(cost.get('steps', 0)):,} steps"]
    for name, words in {"demonstrations": "demonstrated transitions", "comparisons": "comparisons"}.items():
        if cost.get(name):
            parts.append(f"{int(cost[name]):,} {words}")
    return ", ".join([*parts, duration(float(cost.get("seconds", 0.0)))])


def duration(seconds: float) -> str:
    """Return `84 s`, `12 min`, `3.5 h`."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def counted(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def decimal(value: float | None) -> str:
    """Return a score in two decimals, with a real minus sign; nothing for none."""
    if value is None:
        return ""
    text = f"{value:.2f}"
    return ("0.00" if text == "-0.00" else text).replace("-", "−")


def interval(low: float | None, high: float | None) -> str:
    """Return `0.81 to 0.95`; nothing for none, nor for one without a width."""
    return "" if low is None or high is None or low == high else f"{decimal(low)} to {decimal(high)}"


def clipped(scores: Iterable[float]) -> list[float]:
    """Return the positions of scores in pictures."""
    return [max(score, FLOOR) for score in scores]


def steps(count: float) -> str:
    """Return `250k`, `1.5M`."""
    if count < 1000:
        return f"{count:g}"
    if count < 1e6:
        return f"{count / 1e3:g}k"
    return f"{count / 1e6:g}M"


def mean_curve(curves: Sequence[Sequence[tuple[float, float]]]) -> tuple[list[float], list[float]]:
    """Return the mean over seeds at the steps where all of them were looked at."""
    known = [dict(curve) for curve in curves]
    xs = sorted(set.intersection(*map(set, known)))
    return xs, [float(np.mean([each[x] for each in known])) for x in xs]
