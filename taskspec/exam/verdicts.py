"""Verdicts: which capabilities a learner masters, from the interval of its mean score and not from the mean."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from taskspec.exam.bootstrap import estimate, mean
from taskspec.exam.results import CapabilityVerdict, Examined, Grade, Score, Told

MASTERED = 0.9
"""The score from which a task is mastered."""
WORST_FIRST: tuple[Grade, ...] = ("fails", "unsure", "masters")


def side(score: Mapping[str, Any]) -> str:
    """What a score is of: "printed", "twin", or the name of a probe."""
    return score["probe"] or ("printed" if score["twin"] is None else "twin")


def by_seed(scores: Sequence[Score], task: str, which: str) -> dict[int, float]:
    """The score of each seed on a task, or its mean over the twins; without the seeds that failed."""
    found = defaultdict[int, list[float]](list)
    for score in scores:
        if score["task"] == task and side(score) == which and score["deterministic"] is not None:
            found[score["seed"]].append(score["deterministic"])
    return {seed: sum(values) / len(values) for seed, values in sorted(found.items())}


def grade(low: float | None, high: float | None) -> Grade:
    """The verdict from an interval of the mean score."""
    if low is None or high is None:
        return "unsure"
    return "masters" if low >= MASTERED else "fails" if high < MASTERED else "unsure"


def told(values: Sequence[float], key: str) -> Told:
    """The mean of the scores of seeds, its interval, and the verdict."""
    if not values:
        return Told(verdict="unsure", mean=None, low=None, high=None)
    found = estimate(values, mean, key)
    low, high = (end if math.isfinite(end) else None for end in found.interval)
    return Told(verdict=grade(low, high), mean=found.value, low=low, high=high)


def verdicts(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> dict[str, CapabilityVerdict]:
    """The verdict of each capability: the worst of its tasks, as printed and on twins."""
    found = {}
    for capability in dict.fromkeys(about["capability"] for about in tasks.values()):
        names = [task for task, about in tasks.items() if about["capability"] == capability and not about.get("cannot")]
        if not names:
            continue
        printed = [told(list(by_seed(scores, task, "printed").values()), task) for task in names]
        known = {task: list(by_seed(scores, task, "twin").values()) for task in names}
        twins = [told(values, task) for task, values in known.items() if values]
        seeds = min(len(by_seed(scores, task, "printed")) for task in names)
        worst = _worst(printed)
        verdict = _worst([*printed, *twins])["verdict"]
        found[capability] = CapabilityVerdict(
            verdict=verdict, mean=worst["mean"], low=worst["low"], high=worst["high"], tasks=names, seeds=seeds,
            twins=_worst(twins) if twins else None,
        )  # fmt: skip
    return found


def _worst(found: Sequence[Told]) -> Told:
    return min(found, key=lambda t: (WORST_FIRST.index(t["verdict"]), -math.inf if t["mean"] is None else t["mean"]))
