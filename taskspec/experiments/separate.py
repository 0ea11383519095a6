"""Search: the smallest task of a family on which one learner does worse than another, or than right learners do.

Many instances are tried with two seeds, those that differ most again with more seeds, and the best of them on fresh seeds,
before anything is printed: the best of hundreds is lucky. Then the task is shrunk while the difference holds, and tested on fresh
seeds again.
"""

from __future__ import annotations

import json
import math
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.display import fixed, interval
from taskspec.base.limits import also
from taskspec.base.limits import written as written_limits
from taskspec.exam.case import Case, ExamTerms, Source
from taskspec.exam.examinee import learner_of, train_at
from taskspec.exam.learned import Learned
from taskspec.exam.trial import results_of
from taskspec.exchange.freeze import freeze
from taskspec.exchange.tables import FrozenTask
from taskspec.experiments.experiment_file import ExperimentFile
from taskspec.experiments.instances import Instance, expand
from taskspec.experiments.references import monte_carlo, q_learning
from taskspec.experiments.shrink import shrink
from taskspec.jobs.running import Workers
from taskspec.learners import CannotLearn
from taskspec.policies.values import observed_value
from taskspec.rollout.statistics import ALARM, Difference, differences, seeds_interval
from taskspec.scores.returns import Results
from taskspec.task.schema.experiments import Sample
from taskspec.task.task import Task

EPISODES = 1000
"""Of policies whose returns cannot be computed."""
GAP = 0.3
"""The smallest difference of mean scores that is looked for."""
KEPT_GAP = 0.7
"""The share of a difference that a smaller task keeps."""
MASTERED = 0.7
"""The least score of right learners on tasks that count; the optimum may know the time, which they do not see."""
SCREENING = (0, 1)
CHECKING = (100, 101, 102, 103, 104)
SHRINKING = (200, 201, 202, 203)
FRESH = 20
"""Seeds of the rounds; those on which a difference is tested are new each time."""
CHUNK = 8
"""Tasks that are tried between looks at the time."""
TESTS = 6
"""How often a difference is tested at most; test k is at the level `ALARM` / 2^k, so that all together err in less than 1 %."""
SECONDS = 60.0
"""That one task may take."""


@dataclass(frozen=True)
class Contestant:
    """A learner, as other processes find it: by its place, or as a function of this package."""

    name: str
    learns_from: tuple[Source, ...]
    place: str | None = None
    content: str = ""
    function: Callable[[Any], Any] | None = None


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
    task: FrozenTask | Instance | None = None
    p_value: float = 1.0
    tried: int = 0
    path: tuple[str, ...] = ()
    is_complete: bool = False

    @property
    def intervals(self) -> list[tuple[float, float, float]]:
        """Mean score and its 95 % interval of both learners."""
        found = []
        for values in self.scores:
            low, high = seeds_interval(values)
            found.append((float(np.mean(values)), low, high))
        return found


def contestant(learner: str) -> Contestant:
    """Return the learner of `file.py:train`, or of a name.

    Raises:
        SpecError: E710, E711, E713 for what is none.
    """
    who = learner_of(learner)
    return Contestant(learner.rpartition("/")[2], who.learns_from, who.place, who.content)


RIGHT = (
    Contestant("right Q-learning", ("reward",), function=q_learning),
    Contestant("right Monte-Carlo control", ("reward",), function=monte_carlo),
)
"""Learners that master a task on which others can be wrong."""


# -- races: one job -----------------------------------------------------------------------------------------------------


def race(
    subject: FrozenTask | Instance, contestants: Sequence[Contestant], seeds: Sequence[int], steps: int, limits: str
) -> list[list[float] | None]:
    """Return the scores of learners on one task, each with each seed; None for who cannot learn it, and where nothing can be won.

    An instance is raced as tables, where it has some.
    """
    with also(limits):
        results = results_of(_task(subject), EPISODES)
        random = results.random
        best = results.optimal
        if random is None or best is None or not best.value - random.value > 1e-6:
            return [None] * len(contestants)
        unit = best.value - random.value
        found: list[list[float] | None] = []
        for one in contestants:
            try:
                returns = [_return(one, results, seed, steps) for seed in seeds]
                found.append([max(-1.0, (value - random.value) / unit) for value in returns])
            except CannotLearn:
                found.append(None)
        return found


def _return(one: Contestant, results: Results, seed: int, steps: int) -> float:
    """Return the expected return of what a learner learns with a seed."""
    train = one.function
    if train is None:
        assert one.place is not None
        train = train_at(one.place, one.content)
    learned = train(Case(results.task, (seed,), ExamTerms(steps, one.learns_from)))
    if getattr(train, "together", False):
        (learned,) = learned
    policy = learned.policy if isinstance(learned, Learned) else learned
    return observed_value(results, policy, seed).deterministic.value


def _task(subject: FrozenTask | Instance) -> Task:
    tables = _tables(subject)
    if tables is None:
        assert isinstance(subject, Instance)
        return subject.load()
    return tables.task()


def _tables(subject: FrozenTask | Instance) -> FrozenTask | None:
    if isinstance(subject, FrozenTask):
        return subject
    try:
        return freeze(subject.load())
    except SpecError as error:
        if {d.code for d in error.diagnostics} == {"E712"}:
            return None
        raise


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
    first: Contestant
    second: Contestant | None = None
    seed: int = 0
    steps: int = 3000
    minutes: float = 3.0
    workers: int | None = None
    progress: Callable[[str], None] = print
    best: Separation = field(default_factory=Separation)

    def run(self) -> Separation:
        """Return what was found; after Ctrl-C, what was found until then."""
        self.deadline = time.monotonic() + 60 * self.minutes
        self.pair = (self.first, self.second or RIGHT[0])
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
        for instances in self._rounds():
            for found in self._finalists(instances):
                if self._test(found):
                    self._shrink(found)
                    return
                if self.tests >= TESTS:
                    return
            if self._is_over():
                return

    def _rounds(self) -> Iterator[list[Instance]]:
        """Yield the instances of each round: the family with another seed of its samples."""
        known: set[str] = set()
        number = 0
        while True:
            expanded = expand(_sampled(self.family, 1_000_003 * self.seed + number))
            expanded.raise_if_wrong()
            new = [each for each in expanded.instances if each.problem is None and each.id not in known]
            if not new:
                return
            known.update(each.id for each in new)
            yield new
            number += 1

    def _finalists(self, instances: Sequence[Instance]) -> Iterator[FrozenTask | Instance]:
        """Yield instances on which the learners differ with more seeds as well."""
        gaps: list[float] = []
        while len(gaps) < len(instances) and not self._is_over():
            gaps += self._gaps(instances[len(gaps) : len(gaps) + CHUNK], SCREENING, ())
        self.tried += len(gaps)
        order = sorted(range(len(gaps)), key=lambda i: -abs(gaps[i]))
        apart = [instances[i] for i in order if abs(gaps[i]) >= GAP]
        self.progress(f"{self.tried} tasks tried; the learners differ on {len(apart)} of the last {len(gaps)}")
        for i in range(0, len(apart), CHUNK):
            chunk = apart[i : i + CHUNK]
            again = self._gaps(chunk, CHECKING)
            for k in sorted(range(len(chunk)), key=lambda k: -abs(again[k])):
                if abs(again[k]) >= GAP:
                    yield _tables(chunk[k]) or chunk[k]
            if self._is_over():
                return

    def _gaps(
        self, subjects: Sequence[FrozenTask | Instance], seeds: Sequence[int], judges: Sequence[Contestant] = RIGHT
    ) -> list[float]:
        """Return the mean score of the first learner minus that of the second; 0 where a judge does not master the task."""
        gaps = []
        races = [(subject, tuple(seeds)) for subject in subjects]
        for first, second, *judged in self._races(races, (*self.pair, *judges)):
            if self.second is None:
                judged.append(second)
            is_mastered = all(each is None or min(each) >= MASTERED for each in judged)
            if first is None or second is None or not is_mastered:
                gaps.append(0.0)
            else:
                gaps.append(float(np.mean(first) - np.mean(second)))
        return gaps

    def _races(
        self, races: Sequence[tuple[FrozenTask | Instance, tuple[int, ...]]], contestants: Sequence[Contestant]
    ) -> list[list[list[float] | None]]:
        """Return the scores of learners in several races, each of one task and some seeds."""
        limits = written_limits()
        calls = [(subject, tuple(contestants), seeds, self.steps, limits) for subject, seeds in races]
        endings = self.pool.map(race, calls, SECONDS)
        failed = [ending for ending in endings if ending.status != "done"]
        if len(failed) == len(endings):
            raise spec_error("E713", f"a learner fails on every task: {failed[0].message}")
        lost: list[list[float] | None] = [None] * len(contestants)
        return [lost if ending.result is None else json.loads(ending.result) for ending in endings]

    def _test(self, subject: FrozenTask | Instance) -> bool:
        """Test a difference on fresh seeds, and keep the task if it is there."""
        self.tests += 1
        one: list[float] = []
        other: list[float] = []
        fresh = range(self.next_seed, self.next_seed + FRESH)
        self.next_seed += FRESH
        for scores in self._races([(subject, (seed,)) for seed in fresh], self.pair):
            if scores[0] is None or scores[1] is None:
                return False
            one += scores[0]
            other += scores[1]
        found = _difference((one, other))
        if abs(found.effect) < GAP or found.p_value > ALARM / 2**self.tests:
            return False
        worse, better = self.pair
        if found.effect > 0:
            worse, better = better, worse
            one, other = other, one
        self.best = Separation(
            worse.name, better.name, (tuple(one), tuple(other)), subject, found.p_value, self.tried,
            (*self.best.path, _size(subject)),
        )  # fmt: skip
        self.progress(f"{self.best.worse} is worse by {abs(found.effect):.2f} on a task of {_size(subject)}")
        return True

    def _shrink(self, found: FrozenTask | Instance) -> None:
        """Keep the smallest version of a task that still separates, on fresh seeds."""
        if isinstance(found, FrozenTask):
            (gap,) = self._gaps([found], SHRINKING)

            def holds(tasks: Sequence[FrozenTask]) -> list[bool]:
                answers = []
                for each in self._gaps(tasks, SHRINKING):
                    answers.append(each * gap > 0 and abs(each) >= max(GAP, KEPT_GAP * abs(gap)))
                return answers

            path = shrink(found, holds, self._is_over)
            while len(path) > 1 and self.tests < TESTS and not self._test(path[-1]):
                path = path[: len(path) // 2]  # shrunk too far
        self.best = replace(self.best, is_complete=not self._is_over())


def _difference(scores: Sequence[Sequence[float]]) -> Difference:
    table = np.array([[value] for values in scores for value in values])
    is_first = np.arange(len(table)) < len(scores[0])
    return differences(table, is_first)[0]


def _size(subject: FrozenTask | Instance) -> str:
    if isinstance(subject, Instance):
        return subject.id
    counts = ((len(subject.states), "state"), (len(subject.actions), "action"), (subject.horizon or math.inf, "step"))
    return ", ".join(f"{count:g} {noun}{'' if count == 1 else 's'}" for count, noun in counts)


def finding(separation: Separation, family: str) -> FrozenTask:
    """Return the task of a separation with what was found in its text, and its exact returns as claims.

    Args:
        family: its name, for the text.
    """
    tables = separation.task
    assert isinstance(tables, FrozenTask)
    fresh = freeze(tables.task())
    (worse, low, high), (better, least, most) = separation.intervals
    description = (
        f"{separation.worse} scores {fixed(worse, 2)} {interval(low, high)} here, and {separation.better} {fixed(better, 2)} "
        f"{interval(least, most)}: means of {FRESH} fresh seeds, with 95 % intervals, where random actions have 0 and the "
        "optimum 1. "
        f"Exact permutation test: p = {separation.p_value:.2g}. Found among {separation.tried} instances of {family}."
    )
    text = {
        "title": "A task that separates two learners",
        "summary": f"{separation.worse} is worse than {separation.better} here.",
        "description": "\n".join(textwrap.wrap(description, 110)),
        "capability": "separation",
    }
    states = tuple(f"s{i}" for i in range(len(fresh.states)))
    actions = tuple(f"a{i}" for i in range(len(fresh.actions)))
    return replace(fresh, name="Separates", states=states, actions=actions, text=text)


def _sampled(family: ExperimentFile, seed: int) -> ExperimentFile:
    """Return a family with another seed of each sample."""
    entries = []
    for entry in family.experiment.tasks:
        given = entry.sample
        if given is not None:
            count = given if isinstance(given, int) else given.count
            given = Sample(count=count, seed=seed)
        entries.append(entry.model_copy(update={"sample": given}))
    return replace(family, experiment=family.experiment.model_copy(update={"tasks": entries}))
