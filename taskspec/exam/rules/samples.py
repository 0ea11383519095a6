"""The results that rules are about: scores of seeds, by learner, task and side."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Set
from typing import Any

import numpy as np

from taskspec.exact.claims.refusals import Undecidable
from taskspec.exam.bootstrap import Array
from taskspec.exam.verdicts import side

ONE = ""
"""The learner where there is only one."""
_VERSIONED = re.compile(r"(?:[^?+]*/)?([^?+]+?)(?:-v\d+)?([?+].*)?")


def short(task: str) -> str:
    """The name of a task in rules: `NoisyObs?L=50` for `derail/NoisyObs-v0?L=50`."""
    found = _VERSIONED.fullmatch(task)
    return found[1] + (found[2] or "") if found else task


class SeedScores:
    """Results of learners by name, as `exam.json` holds them; of one learner under the name `ONE`.

    Args:
        exams: results by the name of the learner.
        floor: scores below it count as it.
        drawn: whether scores are those of policies that draw their actions, instead of those that take their best ones.
        same: names of tasks that count as others, where those were not run.
        instances: names of tasks at some values, by those.
    """

    def __init__(
        self, exams: Mapping[str, Mapping[str, Any]], floor: float | None = None, drawn: bool = False,
        same: Mapping[str, str] | None = None, instances: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        self.floor, self.drawn = floor, drawn
        self.records: dict[tuple[str, str, str], list[Mapping[str, Any]]] = defaultdict(list)
        self.tasks: dict[str, Mapping[str, Any]] = {}
        self.ids: dict[str, str] = {}
        for learner, exam in exams.items():
            own = {short(task) for task in exam["tasks"]}
            called = {
                task: _known_as(short(task), own, {**(same or {}), **(instances or {})}) for task in exam["tasks"]
            }
            self.ids |= {called[task]: task for task in exam["tasks"]}
            self.tasks |= {called[task]: about for task, about in exam["tasks"].items()}
            for record in exam["scores"]:
                self.records[learner, called[record["task"]], side(record)].append(record)

    def values(self, learner: str, task: str, side: str, entry: str) -> Array:
        """One number for each seed, the mean over the twins where it was run on several, seeds in order.

        Raises:
            Undecidable: where there is none.
        """
        entry = "stochastic" if self.drawn and entry == "deterministic" else entry
        by_seed: dict[int, list[float]] = defaultdict(list)
        for record in self.records.get((learner, task, side), ()):
            if record.get("error") is None and record.get(entry) is not None:
                by_seed[record["seed"]].append(float(record[entry]))
        if not by_seed:
            raise Undecidable(f"there are no results of {f'{learner} on ' if learner else ''}{_called(task, side)}")
        found = np.array([np.mean(by_seed[seed]) for seed in sorted(by_seed)])
        is_score = entry in ("deterministic", "stochastic")
        return np.maximum(found, self.floor) if is_score and self.floor is not None else found

    def constant(self, task: str) -> float:
        """The score of the best action that is taken always.

        Raises:
            Undecidable: where it is not known.
        """
        about = self.tasks.get(task, {})
        found = about.get("constant")
        if found is None:
            raise Undecidable(f"the best constant action of {task} is not known")
        return float(found)


def _known_as(task: str, own: Set[str], same: Mapping[str, str]) -> str:
    other = same.get(task, task)
    return task if other in own else other


def _called(task: str, side: str) -> str:
    return {"printed": task, "twin": f"twins of {task}"}.get(side, f"{task} with the reward {side}")
