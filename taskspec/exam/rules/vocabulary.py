"""What rules may say beyond the language itself: numbers over the seeds of a task, and quantifiers over tasks and learners."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from taskspec.exact.claims.vocabulary import Word
from taskspec.exam.bootstrap import Array, Statistic, deviation, mean


def _highest(samples: Array) -> Array:
    found: Array = np.max(samples, axis=-1)
    return found


def _lowest(samples: Array) -> Array:
    found: Array = np.min(samples, axis=-1)
    return found


def _median(samples: Array) -> Array:
    found: Array = np.median(samples, axis=-1)
    return found


@dataclass(frozen=True, slots=True)
class OverSeeds:
    """A number over the seeds of a task: which entry of a result it is made of, and how."""

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
        _over_seeds("median", "deterministic", _median, "Score that half of the seeds reach."),
        _over_seeds("highest", "deterministic", _highest, "Score of the best seed."),
        _over_seeds("lowest", "deterministic", _lowest, "Score of the worst seed."),
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
"""Functions of numbers: how many they take, and what they are."""

QUANTIFIERS: dict[str, str] = {
    "all": "The condition holds for all: `all(score(t) > 0 for t in tasks)`.",
    "any": "It holds for at least one.",
    "most": "It holds for more than half.",
    "count": "The number for which it holds.",
}
ALL_TASKS, ALL_LEARNERS = "tasks", "learners"
"""Groups that are there without being written."""


@dataclass(frozen=True)
class RuleNames:
    """What a rule may name: tasks, learners (none where results are those of one), groups of either, tasks at other values."""

    tasks: tuple[str, ...]
    learners: tuple[str, ...] = ()
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    instances: tuple[str, ...] = ()

    def group(self, name: str) -> tuple[str, ...] | None:
        """The members of a group."""
        own = {ALL_TASKS: self.tasks} | ({ALL_LEARNERS: self.learners} if self.learners else {})
        return {**self.groups, **own}.get(name)

    @property
    def known_groups(self) -> tuple[str, ...]:
        return (ALL_TASKS, *((ALL_LEARNERS,) if self.learners else ()), *self.groups)
