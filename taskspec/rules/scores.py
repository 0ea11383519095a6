"""Words of findings and diagnoses, the names that they may use, and the scores that they are about."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.rollout.statistics import Statistic, deviation, mean
from taskspec.rules.evaluator import Undecidable
from taskspec.rules.vocabulary import Word

# -- words --------------------------------------------------------------------------------------------


def _along_seeds(function: Callable[..., Array]) -> Statistic:
    return lambda samples: function(samples, axis=-1)


@dataclass(frozen=True, slots=True)
class OverSeeds:
    """A number over the seeds of a task: the entry of a result that it is made of, and the statistic."""

    word: Word
    entry: str
    statistic: Statistic


def _over_seeds(name: str, entry: str, statistic: Statistic, doc: str) -> OverSeeds:
    return OverSeeds(Word(name, f"{name}(task)", doc), entry, statistic)


NUMBERS: dict[str, OverSeeds] = {
    n.word.name: n
    for n in (
        _over_seeds("score", "deterministic", mean, "Mean score of the best actions of the policy; 0 is random, 1 the expert."),
        _over_seeds("sampled", "stochastic", mean, "Mean score of the policy that samples its actions."),
        _over_seeds("sd", "deterministic", deviation, "Standard deviation of the scores between seeds."),
        _over_seeds("median", "deterministic", _along_seeds(np.median), "Score that half of the seeds reach."),
        _over_seeds("highest", "deterministic", _along_seeds(np.max), "Score of the best seed."),
        _over_seeds("lowest", "deterministic", _along_seeds(np.min), "Score of the worst seed."),
        _over_seeds("starc", "starc", mean, "Mean distance of the learned reward to the true one, up to shaping and scale."),
        _over_seeds("regret", "reward_regret", mean, "Mean score that is lost by optimising the learned reward exactly."),
    )
}  # fmt: skip
"""Each takes a task, where there are several learners a learner before it, and one of `SIDES` behind it."""

FIXED: dict[str, Word] = {"constant": Word("constant", "constant(task)", "Score of the best constant action.")}
"""Numbers of a task that no seed changes."""

SIDES: dict[str, str] = {
    "printed": "the task as printed; the default",
    "twin": "its twins: states renamed, actions permuted, or a symmetry of the task; mean over all of them",
    "negated": "the task as printed, with the reward that is withheld negated",
}

FUNCTIONS: dict[str, tuple[int, int, str]] = {
    "abs": (1, 1, "Absolute value."), "min": (2, 9, "The smallest of some numbers."),
    "max": (2, 9, "The largest of some numbers."),
}  # fmt: skip
"""Functions of numbers: the fewest and the most arguments, and the meaning."""

QUANTIFIERS: dict[str, str] = {
    "all": "The condition holds for all: `all(score(t) > 0 for t in tasks)`.",
    "any": "It holds for at least one.",
    "most": "It holds for more than half.",
    "count": "The number for which it holds.",
}
ALL_TASKS = "tasks"
ALL_LEARNERS = "learners"
"""Groups that need not be declared."""


@dataclass(frozen=True)
class RuleNames:
    """Names for rules: tasks, learners (none if the results are those of one), groups of either, tasks at other values."""

    tasks: tuple[str, ...]
    learners: tuple[str, ...] = ()
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    instances: tuple[str, ...] = ()

    def group(self, name: str) -> tuple[str, ...] | None:
        """Return the members of a group."""
        own = {ALL_TASKS: self.tasks} | ({ALL_LEARNERS: self.learners} if self.learners else {})
        return {**self.groups, **own}.get(name)

    @property
    def known_groups(self) -> tuple[str, ...]:
        return (ALL_TASKS, *((ALL_LEARNERS,) if self.learners else ()), *self.groups)


# -- scores -------------------------------------------------------------------------------------------

ONE = ""
"""The learner where there is only one."""
_VERSIONED = re.compile(r"(?:[^?+]*/)?([^?+]+?)(?:-v\d+)?([?+].*)?")


def side(score: Mapping[str, Any]) -> str:
    """Return the side of a task that a score belongs to: "printed", "twin", or the name of a probe."""
    return score["probe"] or ("printed" if score["twin"] is None else "twin")


def short_name(task: str) -> str:
    """Return the name of a task in rules: `NoisyObs?L=50` for `derail/NoisyObs-v0?L=50`."""
    found = _VERSIONED.fullmatch(task)
    return found[1] + (found[2] or "") if found else task


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
        renamed = {**(same or {}), **(instances or {})}
        for learner, exam in exams.items():
            own = {short_name(task) for task in exam["tasks"]}
            names = {task: _name_in_rules(short_name(task), own, renamed) for task in exam["tasks"]}
            for task, about in exam["tasks"].items():
                self.ids[names[task]] = task
                self.tasks[names[task]] = about
            for record in exam["scores"]:
                self.records[learner, names[record["task"]], side(record)].append(record)

    def values(self, learner: str, task: str, side: str, entry: str) -> Array:
        """Return one number for each seed (n,), seeds in order; the mean over twins if there are several.

        Raises:
            Undecidable: if there are none.
        """
        entry = "stochastic" if self.drawn and entry == "deterministic" else entry
        by_seed: dict[int, list[float]] = defaultdict(list)
        for record in self.records.get((learner, task, side), ()):
            if record.get("error") is None and record.get(entry) is not None:
                by_seed[record["seed"]].append(float(record[entry]))
        if not by_seed:
            of = f"{learner} on " if learner else ""
            raise Undecidable(f"there are no results of {of}{_side_in_words(task, side)}")
        found = np.array([np.mean(by_seed[seed]) for seed in sorted(by_seed)])
        is_score = entry in ("deterministic", "stochastic")
        return np.maximum(found, self.floor) if is_score and self.floor is not None else found

    def constant(self, task: str) -> float:
        """Return the score of the best constant action.

        Raises:
            Undecidable: if it is not known.
        """
        found = self.tasks.get(task, {}).get("constant")
        if found is None:
            raise Undecidable(f"the best constant action of {task} is not known")
        return float(found)


def _name_in_rules(task: str, own: Set[str], same: Mapping[str, str]) -> str:
    other = same.get(task, task)
    return task if other in own else other


def _side_in_words(task: str, side: str) -> str:
    return {"printed": task, "twin": f"twins of {task}"}.get(side, f"{task} with the reward {side}")
