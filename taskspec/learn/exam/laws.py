"""Laws of learning: changes of a task that keep what is best, so that a learner should do as well with them as without."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from taskspec.base.diagnostics import SpecError, suggest
from taskspec.language.modifiers import MODIFIERS, modify
from taskspec.language.modifiers.entry import Kept
from taskspec.language.task.task import Task
from taskspec.learn.exam.results import Exam, Flag, LawScore
from taskspec.learn.exam.verdicts import by_seed
from taskspec.learn.statistics import compared

__all__ = ["LAWS", "Law", "obeys"]

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Law:
    """A change of a task that should make no difference to a learner.

    Attributes:
        modifier: which change, by its name in the table of modifiers, which says what is kept, and where.
        argument: of the modifier; None for one that needs none, or that has one for each task.
        cause: what usually breaks the law.
    """

    name: str
    modifier: str
    argument: str | None
    cause: str

    @property
    def keeps(self) -> Kept:
        """The part of a task that the change keeps, after the table of modifiers."""
        return MODIFIERS[self.modifier].keeps

    def changed(self, task: Task) -> Task | None:
        """Change a task.

        Args:
            task: as printed.

        Returns:
            The task with the change; None where it does not apply, or does not keep what is best.
        """
        entry = MODIFIERS[self.modifier]
        given: dict[str, Any] = entry.sample(task)
        if self.argument is not None:
            given[entry.arguments[0].name] = self.argument
        try:
            other = modify(task, {self.modifier: given})
        except SpecError as error:
            if set(error.codes) <= {"E720"}:
                return None
            raise
        if other is task or not other.modifiers:
            return None
        arguments = {a.name: a.default for a in entry.arguments} | dict(other.modifiers[-1].arguments)
        if entry.kept(task, arguments) == "nothing":
            return None
        return other


LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        Law("relabelled", "relabelled", "1", "numbers of observations are used as sizes, or their order is"),
        Law("permuted_actions", "permuted_actions", "1", "ties are broken in favour of one action, such as action 0"),
        Law("symmetry", "symmetry", None, "observations or actions are treated by their names or signs"),
        Law("distractors", "distractors", None, "too little data or too large a network for observations that mean nothing"),
        Law("time_observed", "time_observed", None, "large numbers in observations that are not normalised"),
        Law("absorbing", "absorbing", None, "what is learned depends on where episodes end"),
        Law("delay", "delay", None, "a bootstrap: the reward of an action arrives in a later step"),
        Law("reward_at_end", "reward_at_end", None, "a bootstrap: the reward of an action arrives at the end"),
        Law("scale", "reward_scale", "10", "step sizes, clipped rewards or losses, or an entropy bonus of a fixed size"),
        Law("shift", "reward_shift", "1", "initial values of 0 are optimistic or pessimistic, or rewards are clipped"),
        Law("potential", "potential", None, "targets that do not telescope, or exploration that follows the reward"),
    )
}  # fmt: skip
"""Every law by its name."""


def obeys(*laws: str) -> Callable[[F], F]:
    """Declare, as a decorator of `train`, the laws that a learner obeys: exams flag it where it does not.

    Args:
        *laws: names of `LAWS`.

    Returns:
        The decorator.

    Raises:
        ValueError: there is no such law.
    """
    for name in laws:
        if name not in LAWS:
            raise ValueError(f"there is no law '{name}': {suggest(name, LAWS) or ', '.join(LAWS)}")

    def mark(train: F) -> F:
        train.obeys = laws  # type: ignore[attr-defined]
        return train

    return mark


@dataclass(frozen=True)
class Changed:
    """A task of an exam, and what a law makes of it; by their names in results."""

    law: str
    task: str
    name: str
    changed: Task


def changed_tasks(tasks: Mapping[str, Task], laws: Iterable[str], name_of: Callable[[Task], str]) -> list[Changed]:
    """Return what laws make of the tasks of an exam, where they apply.

    Args:
        name_of: the name of a task in results.
    """
    pairs = []
    for law in laws:
        for name, task in tasks.items():
            changed = LAWS[law].changed(task)
            if changed is not None:
                pairs.append(Changed(law, name, name_of(changed), changed))
    return pairs


def law_scores(changed: Sequence[Changed], as_written: Exam, others: Exam) -> list[LawScore]:
    """Return the scores with each change beside those without it, all compared together by exact permutation tests.

    Args:
        as_written: the exam of the tasks.
        others: that of the changed tasks, with the same seeds and budget.
    """
    places = {(each.law, each.task): each for each in changed}
    rows: dict[tuple[bool, int], dict[tuple[str, str], float]] = defaultdict(dict)
    means = {}
    for place, each in places.items():
        before = by_seed(as_written["scores"], each.task, "printed")
        after = by_seed(others["scores"], each.name, "printed")
        if before and after:
            means[place] = (float(np.mean(list(before.values()))), float(np.mean(list(after.values()))))
            for is_changed, values in ((True, after), (False, before)):
                for seed, value in values.items():
                    rows[is_changed, seed][place] = value
    known = compared(rows, list(means))
    kept = []
    for place, each in places.items():
        score = LawScore(law=each.law, task=each.task, modifier=str(each.changed.modifiers[-1]), error=None)
        if place in known:
            d = known[place]
            score["printed"], score["changed"] = means[place]
            score["p_value"] = d.p_value
            score["broken"] = d.is_real
        else:
            score["error"] = _why_not(others, each.name)
        kept.append(score)
    return kept


def _why_not(others: Exam, task: str) -> str:
    for score in others["scores"]:
        if score["task"] == task and score["error"] is not None:
            return score["error"]
    return others["tasks"][task]["cannot"] or "there are no scores"


def law_flags(scores: Iterable[LawScore], declared: Collection[str]) -> list[Flag]:
    """Return flags for the laws that a learner declares, and does not obey."""
    raised = []
    for score in scores:
        law = LAWS[score["law"]]
        if score["law"] not in declared or not score.get("broken"):
            continue
        effect = score["changed"] - score["printed"]
        message = (
            f"with {score['modifier']} the score is {score['changed']:.2f} instead of {score['printed']:.2f} "
            f"(p = {score['p_value']:.2g}), although the learner declares the law '{law.name}'. Usual cause: {law.cause}"
        )
        raised.append(Flag(kind="law", task=score["task"], message=message, effect=effect, low=None, high=None))
    return raised
