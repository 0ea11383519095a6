"""Flags: what is wrong at any scores, and what differs from an earlier exam."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Any, Literal

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact.rollout.statistics import ALARM, CONFIDENCE, Difference, compared
from taskspec.exact.rules.score_rules import side
from taskspec.learn.exam.curves import area
from taskspec.learn.exam.results import Exam, Examined, Flag, Score
from taskspec.learn.exam.verdicts import ROUNDING, best_score, by_seed

Number = Callable[[Score], float | None]
Column = tuple[str, str, str]
"""A number that is compared: its task, its side and its name."""


SCORE = "score"
COMPARED: dict[str, Number] = {
    SCORE: best_score,
    "score of drawn actions": lambda score: score["stochastic"],
    "mean of the learning curve": lambda score: area(score["curve"]),
    "value of the first states": lambda score: score.get("value"),
    "distance of the learned reward": lambda score: score["starc"],
    "score on a longer horizon": lambda score: score.get("longer"),
}
"""Numbers that are compared with those of an earlier exam, by name: the score must not be lower, the others not differ."""


def flags(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam | None) -> list[Flag]:
    """Return everything that is flagged: failures, impossible scores, twins that differ from their task, peeking, and
    changes since an earlier exam.

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
    return [*new, *_changes(tasks, scores, against)]


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
        yield _difference_flag(kind, task, message, d, len(names))


def _difference_flag(
    kind: Literal["twin", "peeks", "regression", "changed"], task: str, message: str, d: Difference, among: int
) -> Flag:
    if among == 1:
        noun = "comparison"
    else:
        noun = "comparisons"
    text = f"{message} (p = {d.p_value:.2g}, corrected for {among} {noun})"
    if d.is_together:
        text = f"{message} (p = {d.p_value:.2g} for all {among} comparisons together; this one differs most)"
    return Flag(kind=kind, task=task, message=text, effect=d.effect, low=d.low, high=d.high)


# Comparison with an earlier exam.


def differs(exam: Exam, against: Exam, tasks: Iterable[str]) -> bool:
    """Return whether any of the numbers that are compared differs from that of an earlier exam, on some tasks."""
    columns, rows = _numbers({task: exam["tasks"][task] for task in tasks}, exam["scores"], against)
    return any(d.is_real for d in compared(rows, columns).values())


def _changes(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> list[Flag]:
    """Flag tasks on which scores are below those of an earlier exam, or other numbers differ, on the twins that both have.

    All numbers on all tasks are tested together, then each of them. A task gets one flag for its score, and one for the rest.
    """
    columns, rows = _numbers(tasks, scores, against)
    only_below = [name == SCORE for _, _, name in columns]
    found: dict[tuple[str, bool], list[tuple[str, Difference]]] = defaultdict(list)
    for (task, which, name), d in compared(rows, columns, only_below).items():
        if d.is_real:
            if which == "twin":
                where = " on twins"
            else:
                where = ""
            way = "below" if d.effect < 0 else "above"
            message = f"the {name}{where} is {abs(d.effect):.2f} {way} that of the baseline"
            found[task, name == SCORE].append((message, d))
    flagged = []
    for (task, is_regression), changes in found.items():
        message = "; ".join(message for message, _ in changes)
        surest = min((d for _, d in changes), key=lambda d: d.p_value)
        kind: Literal["regression", "changed"] = "regression" if is_regression else "changed"
        flagged.append(_difference_flag(kind, task, message, surest, len(columns)))
    return flagged


def _numbers(
    tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam
) -> tuple[list[Column], dict[tuple[bool, Any], dict[Column, float]]]:
    """Return what is compared with an earlier exam, and its values by exam (True: this one) and seed."""
    places = set(map(_place, scores)) & set(map(_place, against["scores"]))
    both = {True: scores, False: against["scores"]}
    columns = []
    rows: dict[tuple[bool, Any], dict[Column, float]] = defaultdict(dict)
    for task, about in tasks.items():
        known = against["tasks"].get(task)
        if known is None or known["content_hash"] != about["content_hash"]:
            continue
        own = {is_now: [s for s in both[is_now] if s["task"] == task and _place(s) in places] for is_now in both}
        known_values: list[Any] = []  # numbers that say the same, such as both scores of deterministic policies
        for which, (name, number) in itertools.product(("printed", "twin"), COMPARED.items()):
            values = {is_now: by_seed(own[is_now], task, which, number) for is_now in both}
            if values[True] and values[False] and values not in known_values:
                column = (task, which, name)
                columns.append(column)
                known_values.append(values)
                for is_now, by_exam in values.items():
                    for seed, value in by_exam.items():
                        rows[is_now, seed][column] = value
    return columns, rows


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
