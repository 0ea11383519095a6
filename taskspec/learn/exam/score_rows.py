"""The scores of an exam, a row for each task."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.base import ids
from taskspec.base.display import fixed
from taskspec.learn.documents.seed_scores import seed_means, side
from taskspec.learn.exam.results import Grade
from taskspec.learn.exam.verdicts import MASTERED, WORST_FIRST, mean_score, worst
from taskspec.learn.statistics import seeds_interval

FLOOR = -1.0
"""The score at which strips clip positions; numbers are printed as they are."""
SIGNS = {"masters": "✓", "passes": "=", "unsure": "?", "fails": "✗"}
PUBLISHED = "as published"
RELABELLED = "relabelled"
SAMPLED = "sampled"
FIXED = "best fixed action"
FORMS = (PUBLISHED, RELABELLED, SAMPLED, FIXED)
"""What scores are of: the task as its authors have it; its twins; the policy that samples its actions; the best fixed action."""
Curve = tuple[tuple[float, float], ...]
"""Points of steps and scores."""


@dataclass(frozen=True)
class SeedCell:
    """The scores of one learner on a task, or on its twins (mean over them): a number for each seed; `cannot` where it has none
    because the learner is not for the task."""

    scores: tuple[float, ...] = ()
    failed: int = 0
    cannot: bool = False

    @property
    def mean(self) -> float | None:
        if self.scores:
            return float(np.mean(self.scores))
        return None

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval of the mean; None for one seed."""
        if len(self.scores) < 2:
            return None
        return seeds_interval(self.scores)

    @property
    def words(self) -> str:
        """The mean as text, or the reason why there is none."""
        if self.mean is not None:
            return fixed(self.mean, 2)
        if self.failed:
            return "failed"
        if self.cannot:
            return "cannot"
        return ""

    @property
    def passing(self) -> int:
        """The number of seeds that pass."""
        return sum(score >= MASTERED for score in self.scores)


@dataclass(frozen=True)
class TaskRow:
    """The scores on a task.

    Attributes:
        id: of the task.
        name: of the task in reports.
        capability: the title of the task.
        forms: the scores by their form.
        fixed: the score of the best action that is the same as published and relabelled.
        optimum: the score of the best policy.
        curves: a learning curve for each seed.
        word: the flag or verdict in few words.
    """

    id: str
    name: str
    capability: str = ""
    forms: Mapping[str, SeedCell] = field(default_factory=lambda: dict.fromkeys(FORMS, SeedCell()))
    fixed: float | None = None
    optimum: float | None = None
    curves: tuple[Curve, ...] = ()
    word: str = ""

    @property
    def printed(self) -> SeedCell:
        return self.forms[PUBLISHED]

    @property
    def grade(self) -> Grade | None:
        """The grade of a task, as published and relabelled; None if it was not run."""
        if not self._known:
            return None
        return worst([mean_score(cell.scores, self.fixed) for cell in self._known])["verdict"]

    @property
    def _known(self) -> list[SeedCell]:
        """The scores as published and relabelled, where it has some."""
        return [cell for cell in (self.printed, self.forms[RELABELLED]) if cell.scores]

    @property
    def sign(self) -> str:
        """The sign of the grade, or of a run that failed; a dash where the learner is not for the task."""
        if self.printed.cannot:
            return "–"
        return SIGNS[self.grade or "fails"]

    @property
    def passed(self) -> str:
        """The number of seeds that pass, of all, as published or relabelled, where fewer do: `13/15`."""
        if not self.printed.scores:
            return ""
        fewest = min(self._known, key=lambda cell: cell.passing / len(cell.scores))
        return f"{fewest.passing}/{len(fewest.scores)}"

    @property
    def means(self) -> dict[str, float]:
        """The mean scores that are known, by form."""
        return {form: cell.mean for form, cell in self.forms.items() if cell.mean is not None}

    @property
    def worst(self) -> tuple[float, str]:
        """The lowest of the mean scores, and on which form of the task."""
        means = [(mean, form) for form, mean in self.means.items() if form in (PUBLISHED, RELABELLED)]
        return min(means, default=(math.inf, PUBLISHED))

    @property
    def rank(self) -> tuple[int, float]:
        """Sort key: the worst verdicts, then the lowest scores; last the runs that raised an error."""
        if self.grade is None:
            return len(WORST_FIRST), 0.0
        return WORST_FIRST.index(self.grade), self.worst[0]


def forms_of(rows: Sequence[TaskRow]) -> list[str]:
    """Return the forms that some row has scores of; without the sampled policy where that scores the same everywhere."""
    forms = []
    for form in FORMS:
        if any(row.forms[form].words for row in rows):
            forms.append(form)
    if SAMPLED in forms and all(row.forms[SAMPLED].words in ("", row.printed.words) for row in rows):
        forms.remove(SAMPLED)
    return forms


def task_name(task: str) -> str:
    """Return the name of a task in a report: `NoisyObs`, or `NoisyObs, L=50` for one of several instances."""
    about = ids.parse(task)
    name = about.name.partition("/")[2].rpartition("-v")[0] or about.name
    values = [f"{key}={value}" for key, value in about.parameters.items()]
    return ", ".join([name, *values, *about.modifiers])


def task_rows(exam: Mapping[str, Any]) -> list[TaskRow]:
    return [_task_row(exam, task, about) for task, about in exam["tasks"].items()]


def _task_row(exam: Mapping[str, Any], task: str, about: Mapping[str, Any]) -> TaskRow:
    by_side: dict[str | None, list[Mapping[str, Any]]] = defaultdict(list)
    for record in exam["scores"]:
        if record["task"] == task:
            by_side[side(record)].append(record)
    published = by_side["printed"]
    twins = _cell(by_side["twin"], "deterministic")
    curves = []
    for record in published:
        points = []
        for x, y in record["curve"] or ():
            if y is not None:
                points.append((float(x), float(y)))
        if points:
            curves.append(tuple(points))
    printed = _cell(published, "deterministic")
    if about.get("cannot"):
        printed = SeedCell(cannot=True)
    constant = SeedCell()
    if about.get("constant") is not None:
        constant = SeedCell((float(about["constant"]),))
    known = constant.mean
    if twins.scores:
        known = about.get("fixed")
    forms = {PUBLISHED: printed, RELABELLED: twins, SAMPLED: _cell(published, "stochastic"), FIXED: constant}
    name = task_name(task)
    capability = str(about.get("capability") or name)
    return TaskRow(task, name, capability, forms, known, _optimum(about), tuple(curves))


def _cell(records: Sequence[Mapping[str, Any]], entry: str) -> SeedCell:
    failed = set()
    complete = []
    for record in records:
        if record.get("error") is None:
            complete.append(record)
        else:
            failed.add(record["seed"])
    by_seed = seed_means(complete, lambda record: record.get(entry))
    return SeedCell(tuple(by_seed.values()), len(failed - by_seed.keys()))


def _optimum(about: Mapping[str, Any]) -> float | None:
    low, high, best = (about.get(key) for key in ("random", "expert", "optimal"))
    if low is None or high is None or best is None or high == low:
        return None
    return float((best - low) / (high - low))
