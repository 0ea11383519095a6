"""Verdicts: which capabilities a learner masters; and flags: what is wrong at any scores."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Literal, TypeVar

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exam.results import CapabilityVerdict, Exam, Examined, Flag, Grade, MeanScore, Score
from taskspec.rollout.statistics import ALARM, CONFIDENCE, Difference, differences, rate_interval, seeds_interval
from taskspec.rules.score_rules import side

Name = TypeVar("Name", str, tuple[str, str])

# Verdicts: which capabilities a learner masters, from the share of seeds that pass and not from the mean.

MASTERED = 0.9
"""The score from which a seed passes a task."""
RATE = 0.75
"""The share of all seeds that pass where a task is mastered."""
FEWEST = 13
"""The fewest seeds that can show this, if all of them pass."""
WORST_FIRST: tuple[Grade, ...] = ("fails", "unsure", "passes", "masters")


def by_seed(scores: Sequence[Score], task: str, which: str) -> dict[int, float]:
    """Return the score of each seed on a task, or its mean over the twins; without the seeds that failed."""
    found = defaultdict[int, list[float]](list)
    for score in scores:
        if score["task"] == task and side(score) == which and score["deterministic"] is not None:
            found[score["seed"]].append(score["deterministic"])
    return {seed: sum(values) / len(values) for seed, values in sorted(found.items())}


def mean_score(values: Sequence[float], fixed: float | None) -> MeanScore:
    """Return the mean of the scores of seeds, the share that passes, their intervals, and the verdict.

    Args:
        fixed: the score of the best fixed action. Where that passes, mastery needs scores that are nearer to the expert's than
            to that.
    """
    if not values:
        return MeanScore(verdict="unsure", mean=None, low=None, high=None)
    passed = sum(value >= MASTERED for value in values)
    rate_low, rate_high = rate_interval(passed, len(values))
    verdict: Grade = "unsure"
    if rate_high < RATE:
        verdict = "fails"
    elif rate_low >= RATE:
        verdict = "masters"
        if fixed is not None and fixed >= MASTERED:
            above = sum(value - fixed > max(1 - value, ROUNDING) for value in values)
            if rate_interval(above, len(values))[0] < RATE:
                verdict = "passes"
    low, high = (end if math.isfinite(end) else None for end in seeds_interval(values))
    mean = sum(values) / len(values)
    return MeanScore(
        verdict=verdict, mean=mean, low=low, high=high, passed=passed, rate_low=rate_low, rate_high=rate_high
    )  # fmt: skip


def verdicts(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> dict[str, CapabilityVerdict]:
    """Return the verdict of each capability: the worst of its tasks, as printed and on twins."""
    found = {}
    for capability in dict.fromkeys(about["capability"] for about in tasks.values()):
        names = [task for task, about in tasks.items() if about["capability"] == capability and not about.get("cannot")]
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
            printed.append(mean_score(list(own.values()), fixed))
            if other:
                twins.append(mean_score(list(other.values()), fixed))
        found[capability] = CapabilityVerdict(
            **worst(printed) | {"verdict": worst([*printed, *twins])["verdict"]}, tasks=names, seeds=min(seeds),
            twins=worst(twins) if twins else None,
        )  # fmt: skip
    return found


def worst(found: Sequence[MeanScore]) -> MeanScore:
    """Return the worst of some mean scores: by its verdict, then by its mean."""

    def rank(each: MeanScore) -> tuple[int, float]:
        return WORST_FIRST.index(each["verdict"]), -math.inf if each["mean"] is None else each["mean"]

    return min(found, key=rank)


# Flags: what is wrong at any scores, and what has become worse.

ROUNDING = 1e-4
"""What a return may be above the optimum, as a share of it, because probabilities that a policy gives are rounded."""


def flags(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam | None) -> list[Flag]:
    """Return everything that is flagged: failures, impossible scores, twins that differ from their task, peeking, and
    regressions.

    Twins that differed in the baseline are not news: where demonstrations say nothing of some states, the names of actions decide
    what even a learner without mistakes does there.
    """
    found = [*_failed(tasks, scores), *_impossible(tasks, scores)]
    found += _apart(tasks, scores, "twin", "twin")
    found += _apart(tasks, scores, "peeks", "negated")
    if against is None:
        return found
    known = {flag["task"] for flag in against["flags"] if flag["kind"] == "twin"}
    new = [flag for flag in found if flag["kind"] != "twin" or flag["task"] not in known]
    return [*new, *_regressions(tasks, scores, against)]


def _failed(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> Iterable[Flag]:
    for task in tasks:
        of_task = [score for score in scores if score["task"] == task]
        errors = [score["error"] for score in of_task if score["error"] is not None]
        if errors:
            message = f"{len(errors)} of {len(of_task)} runs failed: {errors[0]}"
            yield Flag(kind="failed", task=task, message=message, effect=None, low=None, high=None)


def _impossible(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> Iterable[Flag]:
    """Flag returns above the exact optimum, by more than rounding, and than chance where they were simulated.

    Chance alone raises such a flag in less than `ALARM` of all exams.
    """
    deviations = NormalDist().inv_cdf(1 - ALARM / max(1, len(scores)))
    for task, about in tasks.items():
        best = about["optimal"]
        if best is None:
            continue
        unit = abs((about["expert"] or 0.0) - (about["random"] or 0.0)) or 1.0
        rounding = ROUNDING * max(abs(best), unit)
        excess: dict[float, int] = {}
        for score in scores:
            if score["task"] != task or score["return"] is None:
                continue
            error = score["half"] * unit / NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
            above = score["return"] - best
            if above > rounding + deviations * error:
                excess[above] = score["seed"]
        if excess:
            most = max(excess)
            message = (
                f"the return of seed {excess[most]} is {best + most:g}, and no policy has more than {best:g}: what is scored "
                "knows or changes what a policy cannot, such as the draws of the episodes that it is scored on"
            )
            yield Flag(kind="impossible", task=task, message=message, effect=most / unit, low=None, high=None)


def _apart(
    tasks: Mapping[str, Examined], scores: Sequence[Score], kind: Literal["twin", "peeks"], which: str
) -> Iterable[Flag]:
    """Flag tasks whose scores as printed differ from those of another side, on the seeds of both."""
    names = [task for task in tasks if by_seed(scores, task, "printed").keys() & by_seed(scores, task, which).keys()]
    rows: dict[tuple[int, str | None, int], dict[str, float]] = defaultdict(dict)
    for task in names:
        seeds = by_seed(scores, task, "printed").keys() & by_seed(scores, task, which).keys()
        twins = list(dict.fromkeys(score["twin"] for score in scores if score["task"] == task))
        for score in scores:
            value = score["deterministic"]
            if (
                score["task"] == task
                and score["seed"] in seeds
                and value is not None
                and side(score) in ("printed", which)
            ):
                rows[score["seed"], score["probe"], twins.index(score["twin"])][task] = value
    is_first = np.array([probe is None and twin == 0 for _, probe, twin in rows])
    for task, d in _differences(names, list(rows.values()), is_first):
        size = f"{abs(d.effect):.2f}"
        message = f"the score changes by {size} when a reward is negated that the learner is not to see: it looks at it"
        if kind == "twin":
            way = "lower" if d.effect > 0 else "higher"
            message = (
                f"on twins, where every return is the same, the score is {size} {way}: it depends on what states and "
                "actions are called"
            )
        yield _difference_flag(kind, task, message, d, len(names))


def _differences(
    names: Sequence[Name], rows: Sequence[Mapping[Name, float]], is_first: Array, only_below: bool = False
) -> list[tuple[Name, Difference]]:
    """Return the comparisons in which two samples of rows differ, each with its difference."""
    if not names:
        return []
    table = np.array([[row.get(name, np.nan) for name in names] for row in rows])
    found = differences(table, is_first, only_below)
    return [(name, d) for name, d in zip(names, found, strict=True) if d.is_real]


def _difference_flag(
    kind: Literal["twin", "peeks", "regression"], task: str, message: str, d: Difference, among: int
) -> Flag:
    noun = "comparison" if among == 1 else "comparisons"
    text = f"{message} (p = {d.p_value:.2g}, corrected for {among} {noun})"
    if d.is_together:
        text = f"{message} (p = {d.p_value:.2g} for all {among} comparisons together; this one differs most)"
    return Flag(kind=kind, task=task, message=text, effect=d.effect, low=d.low, high=d.high)


# Comparison with an earlier exam.


def _regressions(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> list[Flag]:
    """Flag tasks on which scores are below those of an earlier exam, on the twins that both have."""
    before = against["scores"]
    places = set(map(_place, scores)) & set(map(_place, before))
    rows: dict[tuple[bool, int], dict[tuple[str, str], float]] = defaultdict(dict)
    names = []
    for task, about in tasks.items():
        known = against["tasks"].get(task)
        if known is None or known["content_hash"] != about["content_hash"]:
            continue
        for which in ("printed", "twin"):
            now = by_seed([each for each in scores if _place(each) in places], task, which)
            then = by_seed([each for each in before if _place(each) in places], task, which)
            if not now or not then:
                continue
            names.append((task, which))
            for is_now, values in ((True, now), (False, then)):
                for seed, value in values.items():
                    rows[is_now, seed][task, which] = value
    is_first = np.array([is_now for is_now, _ in rows])
    found = []
    for (task, which), d in _differences(names, list(rows.values()), is_first, only_below=True):
        where = " on twins" if which == "twin" else ""
        message = f"the score{where} is {-d.effect:.2f} below that of the baseline"
        if d.effect < 0:
            found.append(_difference_flag("regression", task, message, d, len(names)))
    return found


def _place(score: Score) -> tuple[str, str | None]:
    return score["task"], score["twin"]


def check_comparable(against: Exam, folder: str, tasks: Mapping[str, str], terms: Mapping[str, int]) -> None:
    """Refuse (E713) a baseline that tells nothing about this exam.

    Args:
        tasks: content hashes by task.
        terms: steps and transitions.
    """
    for name, number in terms.items():
        if against[name] != number:  # type: ignore[literal-required]
            message = f"the exam in '{folder}' had {against[name]:,} {name}, this one has {number:,}"  # type: ignore[literal-required]
            raise SpecError([Diagnostic("E713", None, message, f"--{name} {against[name]}")])  # type: ignore[literal-required]
    if not any(about["content_hash"] == tasks.get(task) for task, about in against["tasks"].items()):
        raise SpecError(
            [Diagnostic("E713", None, f"the exam in '{folder}' was about other tasks, or they have changed since")]
        )
