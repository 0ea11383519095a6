"""Flags: what is wrong at any scores, and with what differs from an earlier exam (`taskspec.learn.exam.changes`)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Any, Literal

from taskspec.learn.documents.seed_scores import side
from taskspec.learn.exam.changes import changes, difference_flag
from taskspec.learn.exam.results import Exam, Examined, Flag, Score
from taskspec.learn.exam.verdicts import ROUNDING, by_seed
from taskspec.learn.statistics import ALARM, CONFIDENCE, compared


def flags(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam | None) -> list[Flag]:
    """Return everything that is flagged: failures, impossible scores, twins that differ from their task, peeking, and
    changes since an earlier exam.

    Twins that differed in the baseline are not news: where demonstrations say nothing of some states, the names of actions decide
    what even a learner without mistakes does there.
    """
    raised = [*_failed(tasks, scores), *_impossible(tasks, scores), *_reseeded(tasks, scores)]
    raised += _apart(tasks, scores, "twin", "twin")
    raised += _apart(tasks, scores, "peeks", "negated")
    if against is None:
        return raised
    known = {flag["task"] for flag in against["flags"] if flag["kind"] == "twin"}
    new = [flag for flag in raised if flag["kind"] != "twin" or flag["task"] not in known]
    return [*new, *changes(tasks, scores, against)]


def _failed(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> Iterable[Flag]:
    for task in tasks:
        of_task = [score["error"] for score in scores if score["task"] == task]
        errors = [error for error in of_task if error is not None]
        if errors:
            message = f"{len(errors)} of {len(of_task)} runs failed: {errors[0]}"
            yield Flag(kind="failed", task=task, message=message, effect=None, low=None, high=None)


def _reseeded(tasks: Mapping[str, Examined], scores: Sequence[Score]) -> Iterable[Flag]:
    """Flag the task on which most resets give a seed that was given before: its episodes have the same random numbers."""
    shares = dict.fromkeys(tasks, 0.0)
    for score in scores:
        shares[score["task"]] = max(shares[score["task"]], score.get("reseeded") or 0.0)
    task = max(shares, key=lambda name: shares[name])
    if shares[task] > 0.5:
        message = (
            f"{shares[task]:.0%} of all resets give a seed that was given before: episodes have the same random numbers"
        )
        flag = Flag(kind="seeds", task=task, message=message, effect=None, low=None, high=None)
        yield flag | {"advice": "env.reset(seed=seed) in each episode. Give a seed to the first reset alone."}


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
    rows: dict[tuple[bool, Any], dict[str, float]] = defaultdict(dict)
    names = []
    for task in tasks:
        own = [score for score in scores if score["task"] == task]
        seeds = by_seed(own, task, "printed").keys() & by_seed(own, task, which).keys()
        if seeds:
            names.append(task)
        twins = list(dict.fromkeys(score["twin"] for score in own))
        for score in own:
            value = score["deterministic"]
            if value is not None and score["seed"] in seeds and side(score) in ("printed", which):
                place = (score["seed"], score["peek"], twins.index(score["twin"]))
                rows[side(score) == "printed", place][task] = value
    for task, d in compared(rows, names).items():
        if not d.is_real:
            continue
        size = f"{abs(d.effect):.2f}"
        message = f"the score changes by {size} when a reward is negated that the learner is not to see: it looks at it"
        if kind == "twin":
            way = "lower" if d.effect > 0 else "higher"
            message = (
                f"on twins, where every return is the same, the score is {size} {way}: it depends on what states and "
                "actions are called"
            )
        yield difference_flag(kind, task, message, d, len(names))
