"""Verdicts: which capabilities a learner masters; and flags: what is wrong whatever the scores are."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Literal

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exam.results import CapabilityVerdict, Exam, Examined, Flag, Grade, Score, Told
from taskspec.rollout.statistics import ALARM, CONFIDENCE, Difference, estimate, mean, paired, unpaired
from taskspec.rules.score_rules import side

# Verdicts: which capabilities a learner masters, from the interval of its mean score and not from the mean.

MASTERED = 0.9
"""The score from which a task is mastered."""
WORST_FIRST: tuple[Grade, ...] = ("fails", "unsure", "masters")


def by_seed(scores: Sequence[Score], task: str, which: str) -> dict[int, float]:
    """Return the score of each seed on a task, or its mean over the twins; without the seeds that failed."""
    found = defaultdict[int, list[float]](list)
    for score in scores:
        if score["task"] == task and side(score) == which and score["deterministic"] is not None:
            found[score["seed"]].append(score["deterministic"])
    return {seed: sum(values) / len(values) for seed, values in sorted(found.items())}


def grade(low: float | None, high: float | None) -> Grade:
    """Return the verdict from an interval of the mean score."""
    if low is None or high is None:
        return "unsure"
    return "masters" if low >= MASTERED else "fails" if high < MASTERED else "unsure"


def told(values: Sequence[float], key: str) -> Told:
    """Return the mean of the scores of seeds, its interval, and the verdict."""
    if not values:
        return Told(verdict="unsure", mean=None, low=None, high=None)
    found = estimate(values, mean, key)
    low, high = (end if math.isfinite(end) else None for end in found.interval)
    return Told(verdict=grade(low, high), mean=found.value, low=low, high=high)


def verdicts(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> dict[str, CapabilityVerdict]:
    """Return the verdict of each capability: the worst of its tasks, as printed and on twins."""
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


# Flags: what is wrong whatever the scores are, and what has become worse.

ROUNDING = 1e-4
"""What a return may be above the optimum, as a share of it, because probabilities that a policy gives are rounded."""
Found = tuple[str, Difference]
"""A task and a difference of scores on it."""


def flags(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam | None) -> list[Flag]:
    """Return everything that is flagged: failures, impossible scores, twins that differ from their task, peeking, and
    regressions.

    Twins that differed in the baseline are not news: where demonstrations say nothing of some states, the names of actions decide
    what even a learner without mistakes does there.
    """
    found = [*_failed(tasks, scores), *_impossible(tasks, scores)]
    twins = list(_compared(tasks, scores, "twin"))
    found += _real("twin", twins, _of_twins)
    found += _real("peeks", list(_compared(tasks, scores, "negated")), _of_peeking)
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


def _compared(tasks: Mapping[str, Examined], scores: Sequence[Score], which: str) -> Iterable[Found]:
    """Yield how much higher each task as printed is than another side of it, on the seeds of both."""
    for task in tasks:
        printed, other = (by_seed(scores, task, side) for side in ("printed", which))
        seeds = printed.keys() & other.keys()
        apart = paired([printed[s] for s in sorted(seeds)], [other[s] for s in sorted(seeds)], f"{task}, {which}")
        if apart is not None:
            yield task, apart


def _real(
    kind: Literal["twin", "peeks", "regression"], found: Sequence[Found], says: Callable[[Difference], str]
) -> list[Flag]:
    """Flags for the differences that stand out among all of their kind."""
    return [
        Flag(kind=kind, task=task, message=says(d), effect=d.effect, low=d.low, high=d.high)
        for task, d in found
        if d.is_real(len(found))
    ]


def _of_twins(apart: Difference) -> str:
    told = "lower" if apart.effect > 0 else "higher"
    return (
        f"on twins, where every return is the same, the score is {abs(apart.effect):.2f} {told}: it depends on what states and "
        "actions are called"
    )


def _of_peeking(apart: Difference) -> str:
    return f"the score changes by {abs(apart.effect):.2f} when a reward is negated that the learner is not to see: it looks at it"


# -- against a baseline -------------------------------------------------------------------------------------------


def _regressions(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> list[Flag]:
    found = []
    for task, about in tasks.items():
        before = against["tasks"].get(task)
        if before is None or before["content_hash"] != about["content_hash"]:
            continue
        for which in ("printed", "twin"):
            now, then = (by_seed(_common(s, o), task, which) for s, o in _both(scores, against["scores"]))
            apart = unpaired(list(now.values()), list(then.values()), f"{task}, {which}, against")
            if apart is not None:
                found.append((task, which, apart))
    worse = [(task, which, d) for task, which, d in found if d.effect < 0 and d.is_real(len(found))]
    return [
        Flag(kind="regression", task=task, message=_of_regression(which, d), effect=d.effect, low=d.low, high=d.high)
        for task, which, d in worse
    ]


def _both(now: Sequence[Score], then: Sequence[Score]) -> tuple[tuple[Sequence[Score], Sequence[Score]], ...]:
    return (now, then), (then, now)


def _common(scores: Sequence[Score], others: Sequence[Score]) -> list[Score]:
    """Return the scores on twins that both exams have."""
    known = {(score["task"], score["twin"]) for score in others}
    return [score for score in scores if (score["task"], score["twin"]) in known]


def _of_regression(which: str, apart: Difference) -> str:
    where = "" if which == "printed" else " on twins"
    return f"the score{where} is {-apart.effect:.2f} below that of the baseline"


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
