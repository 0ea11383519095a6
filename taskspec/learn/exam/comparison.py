"""Learners side by side, as Agarwal et al. (2021) compare them: all runs on all tasks count, and not a table of means.

Each run is one seed on one task. Intervals are Student's, with the standard error of a jackknife that leaves out one seed of one
task at a time. In simulations of three tasks with 5 or 15 seeds they contained the truth in 92 to 96 % of cases; on a single task
on which a seed succeeds or fails they are too narrow.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special
from typing_extensions import TypedDict

from taskspec.base.arrays import Array
from taskspec.base.display import fixed, interval
from taskspec.learn.exam.curves import steps_to
from taskspec.learn.exam.results import Exam
from taskspec.learn.exam.verdicts import MASTERED, by_seed
from taskspec.learn.statistics import CONFIDENCE

LEVELS = tuple(round(0.1 * i, 1) for i in range(-2, 11))
"""Scores at which performance profiles are given."""


class Estimated(TypedDict):
    """A number and its 95 % interval."""

    value: float
    low: float
    high: float


class LearnerSummary(TypedDict):
    """One of several learners.

    Attributes:
        iqm: the interquartile mean of the scores of all runs.
        profile: for each of `LEVELS` the share of runs with a score above it.
        reaching: the share of runs whose learning curve reaches 0.9.
        steps: the median of the steps that these needed; None if none did.
    """

    learner: str
    iqm: Estimated
    profile: list[float]
    reaching: float
    steps: float | None


class PairComparison(TypedDict):
    """Two learners: the probability that a run of the first has a higher score than one of the second on the same task."""

    first: str
    second: str
    probability: Estimated


class LearnersComparison(TypedDict):
    """Learners side by side, on the tasks that all of them were examined on."""

    tasks: list[str]
    learners: list[LearnerSummary]
    pairs: list[PairComparison]


def compare(exams: Mapping[str, Exam]) -> LearnersComparison:
    """Return learners side by side, on the tasks that all of them have scores on, as printed.

    Source: Agarwal, Schwarzer, Castro, Courville and Bellemare (2021), Deep reinforcement learning at the edge of the
    statistical precipice.

    Args:
        exams: results by the name of the learner.
    """
    first = next(iter(exams.values()))
    tasks = []
    runs: dict[str, list[Array]] = defaultdict(list)
    for task in first["tasks"]:
        of_task = {name: by_seed(exam["scores"], task, "printed") for name, exam in exams.items()}
        if all(of_task.values()):
            tasks.append(task)
            for name, scores in of_task.items():
                runs[name].append(np.array(list(scores.values())))
    if not tasks:
        return LearnersComparison(tasks=[], learners=[], pairs=[])
    summaries = [_summary(name, exam, runs[name], tasks) for name, exam in exams.items()]
    pairs = []
    names = list(exams)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            estimate = _estimated(_probability, runs[one], runs[other], most=1.0)
            pairs.append(PairComparison(first=one, second=other, probability=estimate))
    return LearnersComparison(tasks=tasks, learners=summaries, pairs=pairs)


def _summary(name: str, exam: Exam, runs: Sequence[Array], tasks: Sequence[str]) -> LearnerSummary:
    scores = np.concatenate(runs)
    profile = [float(np.mean(scores > level)) for level in LEVELS]
    needed = []
    for score in exam["scores"]:
        is_printed = score["twin"] is None and score["peek"] is None
        if score["task"] in tasks and is_printed and score["curve"]:
            needed.append(steps_to(score["curve"], MASTERED))
    reached = [steps for steps in needed if steps is not None]
    share = 0.0
    if needed:
        share = len(reached) / len(needed)
    return LearnerSummary(
        learner=name, iqm=_estimated(_iqm, runs, kept=0.5), profile=profile, reaching=share,
        steps=float(np.median(reached)) if reached else None,
    )  # fmt: skip


def _iqm(runs: Sequence[Array]) -> float:
    scores = np.sort(np.concatenate(runs))
    cut = len(scores) // 4
    return float(scores[cut : len(scores) - cut].mean())


def _probability(first: Sequence[Array], second: Sequence[Array]) -> float:
    """Return the mean over tasks of P(X > Y) + P(X = Y) / 2."""
    each = []
    for x, y in zip(first, second, strict=True):
        difference = x[:, None] - y
        each.append(np.mean(difference > 0) + np.mean(difference == 0) / 2)
    return float(np.mean(each))


def _estimated(
    statistic: Callable[..., float], *samples: Sequence[Array], kept: float = 1.0, most: float = math.inf
) -> Estimated:
    """Return a statistic of the runs of one learner or two, with its interval.

    Source: Tukey and McLaughlin (1963), for the degrees of freedom of a trimmed mean.

    Args:
        kept: the share of runs that the statistic is a mean of.
        most: the largest value that the statistic can have; the smallest is then 0.
    """
    value = statistic(*samples)
    variance = 0.0
    freedom = 0.0
    for k, sample in enumerate(samples):
        freedom += kept * sum(map(len, sample)) - len(sample)
        for task, runs in enumerate(sample):
            without = []
            for i in range(len(runs)):
                rest = [*sample[:task], np.delete(runs, i), *sample[task + 1 :]]
                without.append(statistic(*samples[:k], rest, *samples[k + 1 :]))
            variance += (len(runs) - 1) * float(np.var(without))
    half = math.sqrt(variance) * float(special.stdtrit(max(1.0, freedom), 0.5 + CONFIDENCE / 2))
    low = value - half
    if most < math.inf:
        low = max(0.0, low)
    return Estimated(value=value, low=low, high=min(most, value + half))


def lines(comparison: LearnersComparison) -> list[list[Any]]:
    """Return a row of texts for each learner: name, IQM with its interval, share of runs above 0.5 and 0.9, steps to 0.9."""
    rows = []
    for each in comparison["learners"]:
        iqm = each["iqm"]
        above = dict(zip(LEVELS, each["profile"], strict=True))
        steps = ""
        if each["steps"] is not None:
            steps = f"{each['steps']:,.0f} ({each['reaching']:.0%} of runs)"
        shown = f"{fixed(iqm['value'], 2)} {interval(iqm['low'], iqm['high'])}"
        rows.append([each["learner"], shown, f"{above[0.5]:.0%}", f"{above[0.9]:.0%}", steps])
    return rows
