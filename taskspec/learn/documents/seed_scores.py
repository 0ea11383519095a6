"""Scores of learners by learner, task, side of the task and seed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.rules.evaluator import Undecidable

ONE = ""
"""The learner where there is only one."""
_VERSIONED = re.compile(r"(?:[^?+]*/)?([^?+]+?)(?:-v\d+)?([?+].*)?")


def side(score: Mapping[str, Any]) -> str:
    """Return the side of a task that a score belongs to: "printed", "twin", or what else was tried."""
    if score["peek"]:
        return str(score["peek"])
    if score["twin"] is None:
        return "printed"
    return "twin"


def seed_means(records: Iterable[Mapping[str, Any]], number: Callable[[Any], float | None]) -> dict[int, float]:
    """Return a number for each seed, in order: the mean over its records that have one."""
    numbers: dict[int, list[float]] = defaultdict(list)
    for record in records:
        value = number(record)
        if value is not None:
            numbers[record["seed"]].append(float(value))
    means = {}
    for seed in sorted(numbers):
        means[seed] = float(np.mean(numbers[seed]))
    return means


def short_name(task: str) -> str:
    """Return the name of a task in rules: `NoisyObs?L=50` for `derail/NoisyObs-v0?L=50`."""
    match = _VERSIONED.fullmatch(task)
    if match is None:
        return task
    return match[1] + (match[2] or "")


class SeedScores:
    """Scores of learners, by learner, task and side.

    Args:
        exams: results by the name of the learner, as `exam.json` holds them; of one learner under the name `ONE`.
        floor: lower scores are raised to it.
        drawn: whether policies sample their actions, instead of taking their best ones.
        same: names of tasks that count as others, where those were not run.
        instances: names in rules of tasks at other values of parameters, by their own names.
    """

    def __init__(
        self, exams: Mapping[str, Mapping[str, Any]], floor: float | None = None, drawn: bool = False,
        same: Mapping[str, str] | None = None, instances: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        self.floor = floor
        self.drawn = drawn
        self.records: dict[tuple[str, str, str], list[Mapping[str, Any]]] = defaultdict(list)
        self.tasks: dict[str, Mapping[str, Any]] = {}
        self.ids: dict[str, str] = {}
        self.exams = exams
        renamed = {**(same or {}), **(instances or {})}
        for learner, exam in exams.items():
            own = set(map(short_name, exam["tasks"]))
            names = {}
            for task, about in exam["tasks"].items():
                name = short_name(task)
                if renamed.get(name, name) not in own:
                    name = renamed[name]
                names[task] = name
                self.ids[name] = task
                self.tasks[name] = about
            for record in exam["scores"]:
                self.records[learner, names[record["task"]], side(record)].append(record)

    def values(self, learner: str, task: str, side: str, entry: str) -> Array:
        """Return one number for each seed (n,), seeds in order; the mean over twins if there are several."""
        if self.drawn and entry == "deterministic":
            entry = "stochastic"
        records = _without_errors(self.records.get((learner, task, side), ()))
        by_seed = seed_means(records, lambda record: record.get(entry))
        if not by_seed:
            of = f"{learner} on " * bool(learner)
            sides = {
                "printed": task, "twin": f"twins of {task}", "negated": f"{task} with the reward negated",
                "extended": f"{task} with longer training",
            }  # fmt: skip
            raise Undecidable(f"there are no results of {of}{sides[side]}")
        array = np.array(list(by_seed.values()))
        if entry in ("deterministic", "stochastic") and self.floor is not None:
            array = np.maximum(array, self.floor)
        return array

    def constant(self, task: str) -> float:
        """Return the score of the best constant action."""
        score = self.tasks.get(task, {}).get("constant")
        if score is None:
            raise Undecidable(f"the best constant action of {task} is not known")
        return float(score)

    def about_learner(self, name: str, what: str) -> float:
        """Return a number of the one learner that there is, of those in `ABOUT_LEARNER`.

        Raises:
            Undecidable: if it is not known.
        """
        exam = self.exams.get(ONE, {})
        if name == "learns_from" and name in exam:
            return float(what in exam[name])
        amounts = [score[what] for score in _without_errors(exam.get("scores", ())) if what in score]
        if name == "learns_from" or not amounts:
            raise Undecidable(f"{name}({what}) is not known")
        return float(np.mean(amounts))


def _without_errors(records: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    return (record for record in records if record.get("error") is None)
