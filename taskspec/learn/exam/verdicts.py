"""Verdicts: which capabilities a learner masters, from the share of seeds that pass and not from the mean."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from taskspec.learn.documents.seed_scores import seed_means, side
from taskspec.learn.exam.results import CapabilityVerdict, Examined, Grade, MeanScore, Score, finite
from taskspec.learn.statistics import CONFIDENCE, rate_interval, seeds_interval

MASTERED = 0.9
"""The score from which a seed passes a task."""
RATE = 0.75
"""The share of all seeds that pass where a task is mastered."""
FEWEST = 13
"""The fewest seeds that can show this, if all of them pass."""
ROUNDING = 1e-4
"""What a return may be above the optimum, as a share of it, because probabilities that a policy gives are rounded."""
WORST_FIRST: tuple[Grade, ...] = ("fails", "unsure", "passes", "masters")


def best_score(score: Score) -> float | None:
    return score["deterministic"]


def by_seed(
    scores: Sequence[Score], task: str, which: str, number: Callable[[Score], float | None] = best_score
) -> dict[int, float]:
    """Return a number of each seed on a task, or its mean over the twins; without the seeds that have none."""
    return seed_means((score for score in scores if score["task"] == task and side(score) == which), number)


def mean_score(values: Sequence[float], fixed: float | None, looks: int = 1) -> MeanScore:
    """Return the mean of the scores of seeds, the share that passes, their intervals, and the verdict.

    Args:
        fixed: the score of the best fixed action. Where that passes, mastery needs scores that are nearer to the expert's than
            to that.
        looks: how often verdicts are looked at while seeds are added; each look has an equal share of the risk.
    """
    confidence = 1 - (1 - CONFIDENCE) / looks
    if not values:
        return MeanScore(verdict="unsure", mean=None, low=None, high=None)
    passed = sum(value >= MASTERED for value in values)
    rate_low, rate_high = rate_interval(passed, len(values), confidence)
    verdict: Grade = "unsure"
    if rate_high < RATE:
        verdict = "fails"
    elif rate_low >= RATE:
        verdict = "masters"
        if fixed is not None and fixed >= MASTERED:
            above = sum(value - fixed > max(1 - value, ROUNDING) for value in values)
            if rate_interval(above, len(values), confidence)[0] < RATE:
                verdict = "passes"
    low, high = map(finite, seeds_interval(values))
    mean = sum(values) / len(values)
    return MeanScore(
        verdict=verdict, mean=mean, low=low, high=high, passed=passed, rate_low=rate_low, rate_high=rate_high
    )  # fmt: skip


def verdicts(tasks: Mapping[str, Examined], scores: Sequence[Score], looks: int = 1) -> dict[str, CapabilityVerdict]:
    """Return the verdict of each capability: the worst of its tasks, as printed and on twins; `looks` as `mean_score` has it."""
    names_of: dict[str, list[str]] = {}
    for task, about in tasks.items():
        names = names_of.setdefault(about["capability"], [])
        if not about.get("cannot"):
            names.append(task)
    by_capability = {}
    for capability, names in names_of.items():
        if not names:
            continue
        printed = []
        twins = []
        seeds = []
        for task in names:
            fixed = tasks[task].get("fixed")
            own = by_seed(scores, task, "printed")
            other = by_seed(scores, task, "twin")
            seeds.append(len(own))
            printed.append(mean_score(list(own.values()), fixed, looks))
            if other:
                twins.append(mean_score(list(other.values()), fixed, looks))
        by_capability[capability] = CapabilityVerdict(
            **worst(printed) | {"verdict": worst([*printed, *twins])["verdict"]}, tasks=names, seeds=min(seeds),
            twins=worst(twins) if twins else None,
        )  # fmt: skip
    return by_capability


def worst(scores: Sequence[MeanScore]) -> MeanScore:
    """Return the worst of some mean scores: by its verdict, then by its mean."""

    def rank(each: MeanScore) -> tuple[int, float]:
        return WORST_FIRST.index(each["verdict"]), -math.inf if each["mean"] is None else each["mean"]

    return min(scores, key=rank)
