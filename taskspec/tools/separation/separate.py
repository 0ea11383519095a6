"""Search: the smallest task of a family on which one learner does worse than another, or than right learners do.

Many instances are tried with two seeds, those that differ most again with more seeds, and the best of them on fresh seeds,
before anything is printed: the best of hundreds is lucky. Then the task is shrunk while the difference holds, and tested on fresh
seeds again. The result is text on the terminal, a spec, or JSON data.
"""

from __future__ import annotations

import json
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import fixed, interval
from taskspec.base.limits import written as written_limits
from taskspec.learn.exam.examinee import Examinee
from taskspec.learn.experiments.experiment_file import ExperimentFile
from taskspec.learn.experiments.instances import Instance
from taskspec.learn.jobs.engines import Workers
from taskspec.learn.statistics import ALARM, differences, seeds_interval
from taskspec.show.terminal.styled_text import console, line
from taskspec.tools.exchange.freezing import freeze
from taskspec.tools.exchange.frozen_task import FrozenTask, numbered
from taskspec.tools.exchange.spec_text import spec_text, task_of_tables
from taskspec.tools.separation import races
from taskspec.tools.separation.races import Subject
from taskspec.tools.separation.shrink import shrink

KEPT_GAP = 0.7
"""The share of a difference that a smaller task keeps."""
SHRINKING = (200, 201, 202, 203)


@dataclass(frozen=True)
class Separation:
    """The result of a search.

    Attributes:
        worse, better: names of the learners; `worse` is empty where no difference was found.
        scores: of both on fresh seeds, from 0 for random actions to 1 for the optimum; the worse first.
        task: on which they differ: as tables, or an instance that has none.
        p_value: of an exact permutation test, at the level for the number of tests that were made.
        tried: instances.
        path: sizes on the way to the task: states, actions and steps.
        is_complete: whether the search ended by itself, and not for lack of time or by Ctrl-C.
    """

    worse: str = ""
    better: str = ""
    scores: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    task: Subject | None = None
    p_value: float = 1.0
    tried: int = 0
    path: tuple[str, ...] = ()
    is_complete: bool = False

    @property
    def intervals(self) -> list[tuple[float, float, float]]:
        """Mean score and its 95 % interval of both learners."""
        means = []
        for values in self.scores:
            means.append((float(np.mean(values)), *seeds_interval(values)))
        return means


# -- the search ---------------------------------------------------------------------------------------------------------


@dataclass
class Search:
    """A search for a task that separates two learners.

    Attributes:
        family: an experiment whose instances are tried.
        first, second: the learners; without a second one, the first is compared with right Q-learning. Only tasks count that two
            right learners of tables master, where these can learn them.
        seed: from which the instances are drawn.
        steps: of a training run.
        minutes: that the search may take.
        progress: is called with the progress in words.
    """

    family: ExperimentFile
    first: Examinee
    second: Examinee | None = None
    seed: int = 0
    steps: int = 3000
    minutes: float = 3.0
    workers: int | None = None
    progress: Callable[[str], None] = print
    best: Separation = field(default_factory=Separation)

    def run(self) -> Separation:
        """Return what was found; after Ctrl-C, what was found until then."""
        self.deadline = time.monotonic() + 60 * self.minutes
        self.pair = (self.first, self.second or races.RIGHT[0])
        self.tried = 0
        self.tests = 0
        self.next_seed = 1000
        with Workers(self.workers) as self.pool:
            try:
                self._search()
            except KeyboardInterrupt:
                self.best = replace(self.best, is_complete=False)
        return replace(self.best, tried=self.tried)

    def _is_over(self) -> bool:
        return time.monotonic() > self.deadline

    def _search(self) -> None:
        for instances in races.rounds(self.family, self.seed):
            for subject in self._finalists(instances):
                if self._test(subject):
                    self._shrink(subject)
                    return
                if self.tests >= races.TESTS:
                    return
            if self._is_over():
                return

    def _finalists(self, instances: Sequence[Instance]) -> Iterator[Subject]:
        gaps: list[float] = []
        while len(gaps) < len(instances) and not self._is_over():
            gaps += self._gaps(instances[len(gaps) : len(gaps) + races.CHUNK], races.SCREENING, ())
        self.tried += len(gaps)
        apart = [instances[i] for i in _largest_gaps(gaps)]
        self.progress(f"{self.tried} tasks tried; the learners differ on {len(apart)} of the last {len(gaps)}")
        for i in range(0, len(apart), races.CHUNK):
            chunk = apart[i : i + races.CHUNK]
            for k in _largest_gaps(self._gaps(chunk, races.CHECKING)):
                yield races.tables_of(chunk[k]) or chunk[k]
            if self._is_over():
                return

    def _gaps(
        self, subjects: Sequence[Subject], seeds: Sequence[int], judges: Sequence[Examinee] = races.RIGHT
    ) -> list[float]:
        """Return the mean score of the first learner minus that of the second; 0 where a judge does not master the task."""
        gaps = []
        wanted = [(subject, tuple(seeds)) for subject in subjects]
        for first, second, *judged in self._races(wanted, (*self.pair, *judges)):
            if self.second is None:
                judged.append(second)
            is_mastered = all(each is None or min(each) >= races.MASTERED for each in judged)
            gap = 0.0
            if first is not None and second is not None and is_mastered:
                gap = float(np.mean(first) - np.mean(second))
            gaps.append(gap)
        return gaps

    def _races(
        self, wanted: Sequence[tuple[Subject, tuple[int, ...]]], learners: Sequence[Examinee]
    ) -> list[list[list[float] | None]]:
        limits = written_limits()
        calls = []
        for subject, seeds in wanted:
            calls.append((subject, tuple(each.elsewhere() for each in learners), seeds, self.steps, limits))
        endings = self.pool.map(races.race, calls, races.SECONDS)
        if all(ending.status != "done" for ending in endings):
            raise spec_error("E713", f"a learner fails on every task: {endings[0].message}")
        scores: list[list[list[float] | None]] = []
        for ending in endings:
            if ending.result is None:
                scores.append([None] * len(learners))
            else:
                scores.append(json.loads(ending.result))
        return scores

    def _test(self, subject: Subject) -> bool:
        self.tests += 1
        one: list[float] = []
        other: list[float] = []
        fresh = range(self.next_seed, self.next_seed + races.FRESH)
        self.next_seed += races.FRESH
        for scores in self._races([(subject, (seed,)) for seed in fresh], self.pair):
            if scores[0] is None or scores[1] is None:
                return False
            one += scores[0]
            other += scores[1]
        table = np.array(one + other)[:, None]
        difference = differences(table, np.arange(len(table)) < len(one))[0]
        if abs(difference.effect) < races.GAP or difference.p_value > ALARM / 2**self.tests:
            return False
        worse, better = self.pair
        if difference.effect > 0:
            worse, better = better, worse
            one, other = other, one
        self.best = Separation(
            worse.name, better.name, (tuple(one), tuple(other)), subject, difference.p_value, self.tried,
            (*self.best.path, races.size_of(subject)),
        )  # fmt: skip
        self.progress(
            f"{self.best.worse} is worse by {abs(difference.effect):.2f} on a task of {races.size_of(subject)}"
        )
        return True

    def _shrink(self, subject: Subject) -> None:
        """Keep the smallest version of a task that still separates, on fresh seeds."""
        if isinstance(subject, FrozenTask):
            (gap,) = self._gaps([subject], SHRINKING)

            def holds(tasks: Sequence[FrozenTask]) -> list[bool]:
                answers = []
                for each in self._gaps(tasks, SHRINKING):
                    answers.append(each * gap > 0 and abs(each) >= max(races.GAP, KEPT_GAP * abs(gap)))
                return answers

            path = shrink(subject, holds, self._is_over)
            while len(path) > 1 and self.tests < races.TESTS and not self._test(path[-1]):
                path = path[: len(path) // 2]  # shrunk too far
        self.best = replace(self.best, is_complete=not self._is_over())


def _largest_gaps(gaps: Sequence[float]) -> list[int]:
    """Return where learners differ, the largest difference first."""
    apart = [i for i, gap in enumerate(gaps) if abs(gap) >= races.GAP]
    return sorted(apart, key=lambda i: -abs(gaps[i]))


def finding(separation: Separation, family: str) -> FrozenTask:
    """Return the task of a separation with what was found in its text, and its exact returns as claims.

    Args:
        family: its name, for the text.
    """
    tables = separation.task
    assert isinstance(tables, FrozenTask)
    fresh = freeze(task_of_tables(tables))
    (worse, low, high), (better, least, most) = separation.intervals
    description = (
        f"{separation.worse} scores {fixed(worse, 2)} {interval(low, high)} here, and {separation.better} {fixed(better, 2)} "
        f"{interval(least, most)}: means of {races.FRESH} fresh seeds, with 95 % intervals, where random actions have 0 and the "
        "optimum 1. "
        f"Exact permutation test: p = {separation.p_value:.2g}. Found among {separation.tried} instances of {family}."
    )
    text = {
        "title": "A task that separates two learners",
        "summary": f"{separation.worse} is worse than {separation.better} here.",
        "description": "\n".join(textwrap.wrap(description, 110)),
    }
    states = numbered("s", len(fresh.states))
    actions = numbered("a", len(fresh.actions))
    return replace(fresh, name="Separates", states=states, actions=actions, text=text)


def print_separation(separation: Separation) -> None:
    """Print the scores of both learners, and how the task was obtained."""
    worse = separation.worse
    better = separation.better
    out = console()
    out.print(line((worse, "bad"), " is worse than ", (better, "good"), f": {separation.path[-1]}"))
    width = max(len(worse), len(better))
    for name, (mean, low, high) in zip((worse, better), separation.intervals, strict=True):
        out.print(line(f"  {name:{width}}  {fixed(mean, 2):>5}  {interval(low, high)}"))
    seeds = f"{len(separation.scores[0])} fresh seeds, p = {separation.p_value:.2g}"
    out.print(line((f"  {seeds}; {separation.tried} tasks tried", "quiet")))
    if len(separation.path) > 1:
        out.print(line((f"  shrunk from {separation.path[0]}", "quiet")))
    if not separation.is_complete:
        out.print(line(("  the search was stopped before it ended", "quiet")))


def spec_of(separation: Separation, family: str) -> str | None:
    """Write the task as a spec of tables; None for an instance that has none."""
    if isinstance(separation.task, FrozenTask):
        return spec_text(finding(separation, family))
    return None


def record(separation: Separation) -> dict[str, Any]:
    """Write a separation as JSON data; its task as a spec, or by its id."""
    names = ("worse", "better", "scores", "p_value", "tried", "path", "is_complete")
    data: dict[str, Any] = {name: getattr(separation, name) for name in names}
    data["means"] = []
    if separation.worse:
        data["means"] = [dict(zip(("mean", "low", "high"), each, strict=True)) for each in separation.intervals]
    data["task"] = None
    if isinstance(separation.task, FrozenTask):
        data["task"] = spec_text(separation.task)
    elif separation.task is not None:
        data["task"] = separation.task.id
    return data
