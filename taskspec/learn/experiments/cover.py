"""The smallest set of tasks that separates every mistake of a zoo of learners from its right version.

The tasks of a family are tried in rounds, each with two seeds, and those that separate a mistake again with five more, until two
rounds made the set no smaller. The tasks of the set are then tested on fresh seeds; where a difference is not found again, the
next smallest set is tested. Every race is a stored job: a search that was stopped goes on where it was.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Collector, SpecError, raise_if_errors, spec_error
from taskspec.base.display import fixed
from taskspec.base.jobs.engines import Workers
from taskspec.base.jobs.running import Running, run
from taskspec.base.jobs.store import Job, Store
from taskspec.base.limits import tell
from taskspec.base.limits import written as written_limits
from taskspec.exact.rollout.statistics import ALARM, differences
from taskspec.language.source import Document, read_file
from taskspec.language.source import Path as Place
from taskspec.language.task.schema.experiments import Zoo, check_document
from taskspec.learn.exam.trial import key_of
from taskspec.learn.experiments import races
from taskspec.learn.experiments.experiment_file import ExperimentFile, learner_place
from taskspec.learn.experiments.instances import Instance
from taskspec.learn.experiments.races import Contestant
from taskspec.learn.experiments.shrink import size
from taskspec.tools.exchange.freeze import freeze
from taskspec.tools.exchange.spec_text import spec_text, task_of_tables
from taskspec.tools.exchange.tables import FrozenTask

ROUNDS = 2
"""So many rounds that do not make the set smaller end the search."""
NODES = 100_000
"""Sets that are tried before a set counts as the smallest one."""
FRESH = range(1000, 1000 + races.FRESH)

Scores = Mapping[str, Sequence[float] | None]
"""The scores of learners on a task by name; None for who cannot learn it, and where nothing can be won."""


@dataclass(frozen=True)
class Mistake:
    """A learner with a mistake, and its right version."""

    wrong: Contestant
    right: Contestant

    @property
    def name(self) -> str:
        return self.wrong.name


def read_zoo(path: Path) -> list[Mistake]:
    """Return the mistakes of a zoo, from its file.

    Raises:
        SpecError: E710 when there is none, or with every mistake in it.
    """
    document = read_file(path)
    zoo, problems = check_document(document, Zoo)
    if problems or zoo is None:
        raise SpecError(problems)
    collector = Collector()
    found: dict[str, Mistake] = {}
    for i, entry in enumerate(zoo.learners):
        right = _contestant(document, ("learners", i, "right"), entry.right, collector)
        for k, name in enumerate(entry.mistakes):
            place = ("learners", i, "mistakes", k)
            wrong = _contestant(document, place, name, collector)
            if wrong is None or right is None:
                continue
            if wrong.name in found:
                message = f"two mistakes are called '{wrong.name}'"
                collector.add("E713", document.span(place), message, "name each function differently")
            found[wrong.name] = Mistake(wrong, right)
    raise_if_errors(collector.diagnostics)
    return list(found.values())


def _contestant(document: Document, place: Place, name: str, collector: Collector) -> Contestant | None:
    """Return a learner of a zoo; None where there is none, which is reported at its place."""
    try:
        return races.contestant(learner_place(Path(document.origin.name).parent, name))
    except SpecError as error:
        span = document.span(place)
        collector.extend(replace(each, span=span) for each in error.diagnostics)
    return None


@dataclass(frozen=True)
class CoverTask:
    """A task of the set.

    Attributes:
        scores: of every learner of the zoo on fresh seeds.
        separated: the mistakes that are worse than their right version here.
    """

    instance: Instance
    scores: Scores
    separated: frozenset[str]

    @cached_property
    def tables(self) -> FrozenTask | None:
        """The task as tables, where it has some."""
        return races.tables_of(self.instance)

    @property
    def size(self) -> str:
        """The numbers of states, actions and steps in words; the id of an instance without tables."""
        return races.size_of(self.tables or self.instance)

    def mean(self, learner: str) -> float | None:
        """Return the mean score of a learner; None for who cannot learn the task."""
        scores = self.scores[learner]
        return None if scores is None else float(np.mean(scores))

    def spec(self, name: str) -> str | None:
        """Return the text of a spec of tables, with what it separates in its description; None where there are no tables."""
        if self.tables is None:
            return None
        rows = []
        for learner in self.scores:
            mean = self.mean(learner)
            if mean is not None:
                rows.append(f"{learner} scores {fixed(mean, 2)}")
        description = (
            f"Means of {races.FRESH} fresh seeds, where random actions have 0 and the optimum 1: {', '.join(rows)}. "
            f"Found as {self.instance.id}."
        )
        summary = f"Separates {', '.join(sorted(self.separated))} from the right version."
        tables = freeze(task_of_tables(self.tables))
        return spec_text(tables.called(name, "A task that separates mistakes", summary, description))


@dataclass(frozen=True)
class Covering:
    """The tasks that separate the mistakes of a zoo.

    Attributes:
        tried: instances.
        is_complete: whether the search ended by itself, and not for lack of time.
    """

    mistakes: tuple[Mistake, ...]
    tasks: tuple[CoverTask, ...]
    tried: int
    is_complete: bool

    @property
    def missing(self) -> list[str]:
        """The mistakes that no task separates."""
        return [each.name for each in self.mistakes if not any(each.name in task.separated for task in self.tasks)]

    @property
    def learners(self) -> list[str]:
        """The names of all learners, each right version before its mistakes."""
        return list(dict.fromkeys(name for each in self.mistakes for name in (each.right.name, each.name)))

    def data(self) -> dict[str, Any]:
        """Return the result as JSON data."""
        tasks = []
        for each in self.tasks:
            tasks.append({"task": each.instance.id, "separates": sorted(each.separated), "scores": each.scores})
        return {"tasks": tasks, "missing": self.missing, "tried": self.tried, "is_complete": self.is_complete}


@dataclass
class CoverSearch:
    """A search for the smallest set of tasks that separates the mistakes of a zoo.

    Attributes:
        family: an experiment whose instances are tried.
        store: where the results of races are kept.
        seed: from which the instances are drawn.
        steps: of a training run.
        minutes: that the search may take; races that are stored take no time.
    """

    family: ExperimentFile
    mistakes: Sequence[Mistake]
    store: Store
    seed: int = 0
    steps: int = 3000
    minutes: float = 3.0
    workers: int | None = None
    instances: dict[str, Instance] = field(default_factory=dict)
    found: dict[str, frozenset[str]] = field(default_factory=dict)
    """By instance the mistakes that are worse there; of those that were tested, on fresh seeds."""
    tested: dict[str, CoverTask] = field(default_factory=dict)

    def run(self) -> Covering:
        """Return the set of tasks.

        Raises:
            SpecError: E713 where a learner fails on every task.
            Interrupted: Ctrl-C.
        """
        self.deadline = time.monotonic() + 60 * self.minutes
        by_name = {one.name: one for each in self.mistakes for one in (each.right, each.wrong)}
        self.learners = list(by_name.values())
        self.sizes: dict[str, tuple[int, ...]] = {}
        self.able: set[str] = set()
        with Workers(self.workers) as self.pool:
            is_complete = self._search()
            for test in range(1, races.TESTS + 1):
                new = [each for each in self._smallest() if each not in self.tested]
                if not new:
                    break
                self._test(new, ALARM / 2**test)
            self.found = {key: each.separated for key, each in self.tested.items()}
            chosen = tuple(self.tested[key] for key in self._smallest())
        return Covering(tuple(self.mistakes), chosen, len(self.instances), is_complete)

    def _search(self) -> bool:
        """Try the instances of rounds, and return whether that ended by itself."""
        best = (0, 0)
        idle = 0
        for instances in races.rounds(self.family, self.seed):
            for i in range(0, len(instances), races.CHUNK):
                if time.monotonic() > self.deadline:
                    return False
                self._try(instances[i : i + races.CHUNK])
            chosen = self._smallest()
            covered = frozenset[str]().union(*(self.found[key] for key in chosen))
            tell(f"{len(self.instances)} tasks tried; {len(chosen)} of them separate {len(covered)} mistakes")
            now = (len(covered), -len(chosen))
            idle = 0 if now > best else idle + 1
            best = max(best, now)
            if idle == ROUNDS:
                break
        return True

    def _try(self, instances: Sequence[Instance]) -> None:
        """Keep the instances on which mistakes show with a few seeds, and with some more."""
        self.instances |= {each.id: each for each in instances}
        screened = self._races({each.id: self.learners for each in instances}, races.SCREENING)
        wanted = {}
        for key, scores in screened.items():
            apart = [each for each in self.mistakes if _is_worse(scores, each)]
            if apart:
                wanted[key] = list({one.name: one for each in apart for one in (each.right, each.wrong)}.values())
        for key, scores in self._races(wanted, races.CHECKING).items():
            separated = frozenset(each.name for each in self.mistakes if _is_worse(scores, each))
            if separated:
                self.found[key] = separated
                tables = races.tables_of(self.instances[key])
                self.sizes[key] = (10**6,) if tables is None else size(tables)

    def _smallest(self) -> list[str]:
        order = sorted(self.found, key=lambda key: self.sizes[key])
        chosen = smallest_cover([self.found[key] for key in order])
        return [order[i] for i in chosen]

    def _test(self, keys: Sequence[str], level: float) -> None:
        """Test which mistakes are worse on instances, each on fresh seeds and at a level for all instances together."""
        scores = self._races(dict.fromkeys(keys, self.learners), FRESH)
        separated: dict[str, set[str]] = {key: set() for key in keys}
        for mistake in self.mistakes:
            where = [key for key in keys if _is_worse(scores[key], mistake, mastered=-np.inf)]
            if not where:
                continue
            wrong = [scores[key][mistake.name] for key in where]
            right = [scores[key][mistake.right.name] for key in where]
            table = np.vstack([np.array(wrong, float).T, np.array(right, float).T])
            is_first = np.arange(len(table)) < len(FRESH)
            for key, difference in zip(where, differences(table, is_first, only_below=True), strict=True):
                if difference.p_value <= level:
                    separated[key].add(mistake.name)
        for key in keys:
            self.tested[key] = CoverTask(self.instances[key], scores[key], frozenset(separated[key]))
            self.found[key] = self.tested[key].separated

    def _races(self, wanted: Mapping[str, Sequence[Contestant]], seeds: Sequence[int]) -> dict[str, Scores]:
        """Return the scores of learners on instances, from the store where they are known."""
        limits = written_limits()
        jobs: dict[tuple[str, str], Job] = {}
        for key, learners in wanted.items():
            instance = self.instances[key]
            for one in learners:
                content = [key, instance.content_hash, one.name, one.content, list(seeds), self.steps, limits]
                arguments = (instance, (one,), tuple(seeds), self.steps, limits)
                jobs[key, one.name] = Job(key_of("race", content), f"{one.name} on {key}", races.race, arguments)
        running = Running(seconds=races.SECONDS * len(seeds))
        results = run(jobs.values(), self.store, running, "races", self.pool)
        self.able |= {name for (_, name), job in jobs.items() if results[job.key].status == "done"}
        scores: dict[str, dict[str, Sequence[float] | None]] = {key: {} for key in wanted}
        for (key, name), job in jobs.items():
            result = results[job.key]
            if name not in self.able:
                raise spec_error("E713", f"{name} fails on all of the first tasks: {result.message}")
            scores[key][name] = None if result.value is None else result.value[0]
        return dict(scores)


def _is_worse(scores: Scores, mistake: Mistake, mastered: float = races.MASTERED) -> bool:
    """Return whether a mistake has a lower score on a task that its right version masters."""
    wrong = scores.get(mistake.name)
    right = scores.get(mistake.right.name)
    if wrong is None or right is None or min(right) < mastered:
        return False
    return float(np.mean(right) - np.mean(wrong)) >= races.GAP


def smallest_cover(sets: Sequence[frozenset[str]]) -> list[int]:
    """Return the indices of the fewest sets that have all elements together; of equally many, sets that come first are preferred.

    Of the sets that have the element that is in the fewest sets, one is taken; each is tried, with fewer sets than the best cover
    so far. After `NODES` of these, the best one so far is returned.
    """
    useful: list[int] = []
    for i, one in enumerate(sets):
        if one and not any(one <= sets[j] for j in useful):
            useful.append(i)
    best = _greedy(sets, useful)
    nodes = 0
    waiting: list[tuple[tuple[int, ...], frozenset[str]]] = [((), frozenset[str]().union(*sets))]
    while waiting and nodes < NODES:
        nodes += 1
        chosen, left = waiting.pop()
        if not left:
            if len(chosen) < len(best):
                best = sorted(chosen)
            continue
        most = max(len(sets[i] & left) for i in useful)
        if len(chosen) + -(-len(left) // most) >= len(best):
            continue
        rarest = min(sorted(left), key=lambda name: sum(name in sets[i] for i in useful))
        for i in reversed(useful):
            if rarest in sets[i]:
                waiting.append(((*chosen, i), left - sets[i]))
    return best


def _greedy(sets: Sequence[frozenset[str]], useful: Iterable[int]) -> list[int]:
    """Return sets that have all elements, each of them the one that adds most to those before."""
    left = frozenset[str]().union(*sets)
    chosen = []
    while left:
        best = max(useful, key=lambda i: len(sets[i] & left))
        chosen.append(best)
        left -= sets[best]
    return sorted(chosen)
