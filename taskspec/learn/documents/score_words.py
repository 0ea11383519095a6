"""The vocabulary of rules over scores: numbers of tasks and learners, sides of a task, functions, quantifiers, and names."""

from __future__ import annotations

from dataclasses import dataclass, field

from taskspec.exact.rules.evaluator import Word
from taskspec.learn.statistics import Statistic


@dataclass(frozen=True, slots=True)
class OverSeeds:
    """A number over the seeds of a task: the entry of a result that it is made of, and the statistic."""

    word: Word
    entry: str
    statistic: Statistic


_ROWS: tuple[tuple[str, str, Statistic, str], ...] = (
    ("score", "deterministic", "mean", "Mean score of the best actions of the policy; 0 is random, 1 the expert."),
    ("sampled", "stochastic", "mean", "Mean score of the policy that samples its actions."),
    ("sd", "deterministic", "sd", "Standard deviation of the scores between seeds."),
    ("median", "deterministic", "median", "Score that half of the seeds reach."),
    ("highest", "deterministic", "highest", "Score of the best of the seeds that were run."),
    ("lowest", "deterministic", "lowest", "Score of the worst of the seeds that were run."),
    ("starc", "starc", "mean", "Mean distance of the learned reward to the true one, up to shaping and scale."),
    ("explained", "explained", "mean", "How much a critic explains of the values of its policy: 1 all, 0 or less nothing."),
    ("spent", "spent", "mean", "Share of the budget of steps that was taken."),
    ("tried", "tried", "mean", "Share of actions that were tried in training, where there was time to."),
    ("agrees", "agrees", "mean", "Share of the last training steps whose usual action is that of the policy."),
    ("at_ends", "at_ends", "mean", "Error of learned values of steps that end the episode: they should be rewards."),
    ("before_ends", "before_ends", "mean", "Error of steps that go on, from rewards and values of what follows."),
    ("left", "left", "lowest", "Share of both that four times the steps leave, of the seed with the least."),
    ("moved", "moved", "mean", "How far learned values are from their first ones, as a share of the spread of right ones."),
    ("apart", "apart", "mean", "Distance of the policy to the demonstrated actions, 0 to 1: their total variation."),
    ("regret", "reward_regret", "mean", "Mean score that is lost by optimising the learned reward exactly."),
)  # fmt: skip
NUMBERS: dict[str, OverSeeds] = {}
for _name, _entry, _statistic, _doc in _ROWS:
    NUMBERS[_name] = OverSeeds(Word(_name, f"{_name}(task)", _doc), _entry, _statistic)
"""Each takes a task, where there are several learners a learner before it, and one of `SIDES` behind it."""

FIXED: dict[str, Word] = {"constant": Word("constant", "constant(task)", "Score of the best constant action.")}
"""Numbers of a task that no seed changes."""

ABOUT_LEARNER: dict[str, tuple[Word, tuple[str, ...]]] = {
    "learns_from": (
        Word("learns_from", "learns_from(source)", "1 where the learner is granted this, else 0."),
        ("reward", "demonstrations", "preferences"),
    ),
    "used": (
        Word("used", "used(amount)", "Mean number that a training run used."),
        ("steps", "demonstrations", "comparisons"),
    ),
}
"""Numbers of a learner, each with the names that it takes; in rules about one learner alone."""

SIDES: dict[str, str] = {
    "printed": "the task as printed; the default",
    "twin": "its twins: states renamed, actions permuted, or a symmetry of the task; mean over all of them",
    "negated": "the task as printed, with the reward that is withheld negated",
    "extended": "the task as printed, trained four times as long, which is done where values may not be finished",
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
    "mean": "The mean of a number over those that have it: `mean(score(t) for t in tasks) > 0`.",
}


@dataclass(frozen=True)
class RuleNames:
    """Names for rules: tasks, learners (none if the results are those of one), groups of either, tasks at other values."""

    tasks: tuple[str, ...]
    learners: tuple[str, ...] = ()
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    instances: tuple[str, ...] = ()

    @property
    def all_groups(self) -> dict[str, tuple[str, ...]]:
        """The members of all groups by name; `tasks` and `learners` need not be declared."""
        groups = {"tasks": self.tasks}
        if self.learners:
            groups["learners"] = self.learners
        return self.groups | groups
