"""Judge all runs of an exam together: a known mistake that explains what was learned.

A mistake is named only if it explains everything, and what is right does not. Its values are reached, and not merely on the way;
they are clearly nearer than all that is right, by more than chance would have it, and are more than the fit may choose. No task
contradicts it, and where it does not differ from what is right, this is near. Mistakes that explain as much are ties. A wrong
name costs more than many that are missing.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskspec.learn.exam.operators import FEWEST, OPERATORS
from taskspec.learn.statistics import sign_flip_p_value

RIGHT = 0.15
"""What is this near to what is right, as a share of its spread, is right."""
NEAR = 0.2
CLEARER = 0.5
"""A mistake fits a task if its distance is at most `NEAR`, and at most `CLEARER` of that to what is right."""
WORSE = 0.1
"""It is far worse than what is right where it is farther by this, and more than twice as far."""
CONTRADICTED = 0.4
"""It is contradicted by a task that what is right explains, where it is far worse, and farther than this."""
ELSEWHERE = 0.25
"""On tasks where it does not differ from what is right, this is near."""
SAME = 0.05
"""Mistakes whose distances differ by less than this, on the tasks where they differ, cannot be told apart."""
FEWEST_FITTED = 2
"""Tasks that a mistake fits, at least, where its fit chooses a number on each."""
CHANCE = 0.05
"""The probability with which chance alone makes a mistake so much nearer than what is right on the runs (a permutation test)."""
MOST_TIES = 3
"""Mistakes that are named together, at most."""
LISTED = 3
"""Mistakes that are listed where none is named."""


@dataclass(frozen=True)
class Run:
    """One run of a learner on a task: distances by name, and how many values tell each name from what is right."""

    task: str
    distances: Mapping[str, float]
    values: Mapping[str, int]


@dataclass(frozen=True)
class Judgement:
    """Explanation of the runs of an exam.

    Attributes:
        names: the mistakes that explain them equally well, or one name that is none; empty if nothing known does.
        distance: that of the first of them, in the mean over tasks.
        right: that of what is right.
        nearest: the nearest mistakes that are nearer than what is right, with their distances: the mean over the tasks where
            they differ from it.
    """

    names: tuple[str, ...]
    distance: float
    right: float
    nearest: tuple[tuple[str, float], ...]


def judged(runs: Sequence[Run], good: Sequence[str], is_finished: bool = False) -> Judgement:
    """Return what explains runs.

    Args:
        runs: in each a distance to what is right, and to the mistakes that differ from it there.
        good: names that are no mistake, the right one first.
        is_finished: whether a task that neither explains counts as two, as for clones, which need few steps.
    """
    known = _Pooled(runs, good, is_finished)
    of_best = known.overall(known.best)
    ranked = sorted(known.wrong, key=known.overall)
    nearer = [name for name in ranked if known.overall(name) < of_best]
    nearest = tuple((name, known.distance(name)) for name in nearer[:LISTED])
    named = [name for name in ranked if known.explains(name)]
    fitted = [known.distance(name) for name in named if known.is_vague(name) and OPERATORS[name].free]
    least = min(fitted, default=np.inf)
    telling = [name for name in named if not known.is_vague(name) and known.distance(name) < least + SAME]
    if telling:
        named = telling
    if named:
        first = named[0]
        ties = [name for name in ranked if name == first or known.ties(first, name)]
        if len(ties) <= MOST_TIES:
            return Judgement(tuple(ties), known.overall(first), of_best, nearest)
    elif of_best <= RIGHT:
        return Judgement((known.best,), of_best, known.overall(good[0]), nearest)
    return Judgement((), of_best, of_best, nearest)


class _Pooled:
    """Medians of the runs of each task. A run that went wrong may be near to anything: one of several decides nothing."""

    def __init__(self, runs: Sequence[Run], good: Sequence[str], is_finished: bool) -> None:
        self.runs = runs
        self.good = good
        self.is_finished = is_finished
        self.by_task: dict[str, list[Run]] = {}
        for run in runs:
            self.by_task.setdefault(run.task, []).append(run)

    @cached_property
    def medians(self) -> dict[str, dict[str, float]]:
        """Return distances by task, of the names that at least half of its runs have."""
        by_task: dict[str, dict[str, float]] = {}
        for task, runs in self.by_task.items():
            by_name: dict[str, list[float]] = defaultdict(list)
            for run in runs:
                for name, distance in run.distances.items():
                    by_name[name].append(distance)
            by_task[task] = {}
            for name, distances in by_name.items():
                if 2 * len(distances) >= len(runs):
                    by_task[task][name] = float(np.median(distances))
        return by_task

    @cached_property
    def wrong(self) -> list[str]:
        """Return the mistakes that differ from what is right on some task."""
        names = dict.fromkeys(itertools.chain.from_iterable(self.medians.values()))
        return [name for name in names if name not in self.good]

    @cached_property
    def best(self) -> str:
        """Return the name that is no mistake and is nearest to all runs."""
        right = self.good[0]

        def distance(name: str) -> float:
            return _mean(medians.get(name, medians[right]) for medians in self.medians.values())

        known = set(itertools.chain.from_iterable(self.medians.values()))
        return min((name for name in self.good if name in known), key=distance)

    def of_good(self, task: str) -> float:
        medians = self.medians[task]
        return medians.get(self.best, medians[self.good[0]])

    @staticmethod
    def needs_others(name: str) -> bool:
        """Return whether values have to be right on tasks where a mistake says nothing.

        A pattern may say nothing about values that have it; one of random outcomes says nothing where there are none.
        """
        operator = OPERATORS.get(name)
        return operator is None or operator.recognise is None or operator.varies

    @staticmethod
    def is_vague(name: str) -> bool:
        """Return whether any other mistake that explains the same says more."""
        return name in OPERATORS and OPERATORS[name].vague

    def tasks(self, name: str) -> list[str]:
        """Return the tasks on which a mistake differs from what is right."""
        return [task for task, medians in self.medians.items() if name in medians]

    def distance(self, name: str) -> float:
        """Return the distance of a mistake on these."""
        return _mean(self.medians[task][name] for task in self.tasks(name))

    def overall(self, name: str) -> float:
        """Return the distance over all tasks: that of what is right where a mistake does not differ from it."""
        return _mean(medians.get(name, self.of_good(task)) for task, medians in self.medians.items())

    def explains(self, name: str) -> bool:
        """Return whether a mistake explains all runs, and what is right does not.

        Tasks that both explain tell nothing. On tasks that neither explains the values are not finished: fewer than those that
        the mistake fits; one on which it is far worse than what is right counts as two. Where its fit chooses a number of each
        task, those on which it says nothing count as well.
        """
        fitted = []
        unfinished = 0
        for task in self.tasks(name):
            distance = self.medians[task][name]
            of_good = self.of_good(task)
            is_far_worse = distance > 2 * of_good + WORSE
            if distance <= NEAR and distance <= CLEARER * of_good and of_good - distance >= SAME:
                fitted.append(task)
            elif of_good > NEAR:
                unfinished += 1 + (is_far_worse or self.is_finished)
            elif is_far_worse and distance > CONTRADICTED:
                return False
            elif is_far_worse:
                unfinished += 1
        others = [self.of_good(task) for task, medians in self.medians.items() if name not in medians]
        if others and self.needs_others(name) and _mean(others) > ELSEWHERE:
            return False
        if name in OPERATORS and OPERATORS[name].free:
            unfinished += sum(of_good > NEAR for of_good in others)
            if len(fitted) < FEWEST_FITTED:
                return False
        if len(fitted) <= unfinished:
            return False
        return self._values(name, fitted) >= FEWEST and self._chance(name, fitted) <= CHANCE

    def _values(self, name: str, tasks: Sequence[str]) -> int:
        """Return how many values tell a mistake from what is right, less those that its fit chooses."""
        operator = OPERATORS.get(name)
        total = 0
        for task in tasks:
            told = [run.values.get(name, FEWEST) for run in self.by_task[task] if name in run.distances]
            if operator is not None and operator.varies:
                total += sum(told)
            elif operator is not None:
                total += max(told) - operator.free
            else:
                total += max(told)
        return total

    def _chance(self, name: str, tasks: Sequence[str]) -> float:
        """Return the p-value of a mistake being nearer than all that is right on the runs: signs of the gains are flipped."""
        gains = []
        for run in self.runs:
            if run.task in tasks and name in run.distances:
                of_good = min(run.distances[each] for each in run.distances.keys() & self.good)
                gains.append(of_good - run.distances[name])
        return sign_flip_p_value(gains)

    def ties(self, first: str, other: str) -> bool:
        """Return whether another mistake explains the runs as well as the first one."""
        if self.is_vague(other) or self.distance(other) > NEAR:
            return False
        differences = []
        for task, medians in self.medians.items():
            of_first = medians.get(first, self.of_good(task))
            of_other = medians.get(other, self.of_good(task))
            if of_first != of_other:
                differences.append(of_other - of_first)
        return not differences or _mean(differences) < SAME


def _mean(numbers: Iterable[float]) -> float:
    return float(np.mean(list(numbers)))
