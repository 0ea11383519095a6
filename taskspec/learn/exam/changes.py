"""Differences from an earlier exam: flags of scores that fell and of other numbers that changed, and near misses."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.learn.documents.seed_scores import short_name, side
from taskspec.learn.exam.curves import area
from taskspec.learn.exam.results import Exam, Examined, Flag, Score
from taskspec.learn.exam.verdicts import best_score, by_seed
from taskspec.learn.statistics import ALARM, Difference, compared

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


def difference_flag(
    kind: Literal["twin", "peeks", "regression", "changed"], task: str, message: str, d: Difference, among: int
) -> Flag:
    """Return the flag of a difference, which is one `among` several comparisons."""
    text = f"{message} (p = {d.p_value:.2g}, corrected for {plural(among, 'comparison')})"
    if d.is_together:
        text = f"{message} (p = {d.p_value:.2g} for all {among} comparisons together; this one differs most)"
    return Flag(kind=kind, task=task, message=text, effect=d.effect, low=d.low, high=d.high)


def differs(exam: Exam, against: Exam, tasks: Iterable[str]) -> bool:
    """Return whether any of the numbers that are compared differs from that of an earlier exam, on some tasks."""
    columns, rows = _numbers({task: exam["tasks"][task] for task in tasks}, exam["scores"], against)
    return any(d.is_real for d in compared(rows, columns).values())


def changes(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> list[Flag]:
    """Flag tasks on which scores are below those of an earlier exam, or other numbers differ, on the twins that both have.

    All numbers on all tasks are tested together, then each of them. A task gets one flag for its score, and one for the rest.
    """
    columns, rows = _numbers(tasks, scores, against)
    only_below = [name == SCORE for _, _, name in columns]
    found: dict[tuple[str, bool], list[tuple[str, Difference]]] = defaultdict(list)
    for (task, which, name), d in compared(rows, columns, only_below).items():
        if d.is_real:
            where = ""
            if which == "twin":
                where = " on twins"
            way = "below" if d.effect < 0 else "above"
            message = f"the {name}{where} is {abs(d.effect):.2f} {way} that of the baseline"
            found[task, name == SCORE].append((message, d))
    flagged = []
    for (task, is_regression), changes in found.items():
        messages, differences = zip(*changes, strict=True)
        surest = min(differences, key=lambda d: d.p_value)
        kind: Literal["regression", "changed"] = "changed"
        if is_regression:
            kind = "regression"
        flagged.append(difference_flag(kind, task, "; ".join(messages), surest, len(columns)))
    if not flagged:
        flagged += _farther(tasks, scores, against)
    return flagged


def _farther(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> Iterable[Flag]:
    """Flag learned values that are farther from the right ones than those of an earlier exam, in the mean over tasks.

    In this number many small changes add up, each too small for a flag.
    """
    same = _same_tasks(tasks, against)
    now = _distances(same, scores)
    before = _distances(same, against["scores"])
    if not now or not before:
        return
    common = sorted(set.intersection(*map(set, [*now.values(), *before.values()])))
    if not common:
        return
    rows = {}
    for is_now, by_exam in ((True, now), (False, before)):
        for seed, of_tasks in by_exam.items():
            rows[is_now, seed] = {"": -float(np.mean([of_tasks[task] for task in common]))}
    (d,) = compared(rows, [""], only_below=True).values()
    if d.is_real and d.p_value <= ALARM / 2:
        gains = {}
        for task in common:
            mean_now = np.mean([each[task] for each in now.values()])
            mean_before = np.mean([each[task] for each in before.values()])
            gains[task] = mean_now - mean_before
        message = (
            f"the learned values are {-d.effect:.2f} farther from the right ones than those of the baseline, in the mean over "
            f"{len(common)} tasks"
        )
        yield difference_flag("changed", max(gains, key=lambda task: gains[task]), message, d, 1)


def _distances(tasks: Iterable[str], scores: Sequence[Score]) -> dict[int, dict[str, float]]:
    """Return the distance of learned values to the right ones by seed and task, as printed."""
    found: dict[int, dict[str, float]] = defaultdict(dict)
    for score in scores:
        distances = score.get("operators")
        if distances and score["task"] in tasks and side(score) == "printed":
            found[score["seed"]][score["task"]] = distances["right"]
    return found


SEEN = 0.2
"""The smallest drop of a mean score that is worth a line where it is no flag."""
COPIES = (2, 3, 4, 6)
"""How often the seeds are repeated, to see how many would tell."""


def almost(tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam) -> list[str]:
    """Return a line about the largest drop of a score that is no flag: its p-value, and how many seeds would tell."""
    columns, rows = _numbers(tasks, scores, against)
    is_score = [column for column in columns if column[2] == SCORE]
    if not is_score:
        return []
    differences = compared(rows, is_score, True)
    open_ones = {column: d for column, d in differences.items() if not d.is_real}
    column = min(open_ones, key=lambda each: open_ones[each].effect, default=is_score[0])
    d = open_ones.get(column)
    if d is None or d.effect > -SEEN:
        return []
    text = f"{short_name(column[0])}: the score is {-d.effect:.2f} below that of the baseline (p = {d.p_value:.2g})"
    seeds = _enough(column, rows, len(columns))
    if seeds is None:
        return [text]
    return [f"{text}; about {seeds} seeds of both would tell"]


def _enough(column: Column, rows: Mapping[tuple[bool, Any], Mapping[Column, float]], among: int) -> int | None:
    """Return how many seeds of both exams would flag a difference of this size, if further seeds are like these."""
    known = {key: row for key, row in rows.items() if column in row}
    now = sum(is_now for is_now, _ in known)
    fewest = min(now, len(known) - now)
    for copies in COPIES:
        repeated = {}
        for copy in range(copies):
            for (is_now, seed), row in known.items():
                repeated[is_now, (seed, copy)] = row
        (d,) = compared(repeated, [column], True).values()
        if d.p_value * among <= ALARM:
            return copies * fewest
    return None


def _numbers(
    tasks: Mapping[str, Examined], scores: Sequence[Score], against: Exam
) -> tuple[list[Column], dict[tuple[bool, Any], dict[Column, float]]]:
    """Return what is compared with an earlier exam, and its values by exam (True: this one) and seed."""
    places = set(map(_place, scores)) & set(map(_place, against["scores"]))
    both = {True: scores, False: against["scores"]}
    columns = []
    rows: dict[tuple[bool, Any], dict[Column, float]] = defaultdict(dict)
    for task in _same_tasks(tasks, against):
        of_task = {place for place in places if place[0] == task}
        own = {}
        for is_now, of_exam in both.items():
            own[is_now] = [score for score in of_exam if _place(score) in of_task]
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


def _same_tasks(tasks: Mapping[str, Examined], against: Exam) -> list[str]:
    """Return the tasks that an earlier exam had, too, and that have not changed since."""
    found = []
    for task, about in tasks.items():
        known = against["tasks"].get(task)
        if known is not None and known["content_hash"] == about["content_hash"]:
            found.append(task)
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
        raise spec_error("E713", f"the exam in '{folder}' was about other tasks, or they have changed since")
