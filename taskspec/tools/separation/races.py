"""Races: learners on the tasks of a family, with scores from 0 for random actions to 1 for the best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import plural
from taskspec.base.limits import also
from taskspec.exact.model.extract import extract
from taskspec.exact.scores.returns import Results
from taskspec.language import registry
from taskspec.language.source import read_text
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import Sample
from taskspec.learn.exam.asked_tasks import names_in
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.exam.examinee import Examinee
from taskspec.learn.exam.learned import Learned
from taskspec.learn.exam.trial import results_of
from taskspec.learn.experiments.experiment_file import ExperimentFile, described, read
from taskspec.learn.experiments.instances import Instance, expand
from taskspec.learn.experiments.tabular_learners import monte_carlo, q_learning
from taskspec.learn.learners import CannotLearn
from taskspec.learn.observed_policies import observed_value
from taskspec.tools.exchange.freezing import observable
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.spec_text import task_of_tables

EPISODES = 1000
"""Of policies whose returns cannot be computed."""
GAP = 0.3
"""The smallest difference of mean scores that is looked for."""
MASTERED = 0.7
"""The least score of right learners on tasks that count; the optimum may know the time, which they do not see."""
SCREENING = (0, 1)
CHECKING = (100, 101, 102, 103, 104)
FRESH = 20
"""Seeds of the rounds; those on which a difference is tested are new each time."""
CHUNK = 8
"""Tasks that are tried between looks at the time."""
TESTS = 6
"""How often a difference is tested at most; test k is at the level `ALARM` / 2^k, so that all together err in less than 1 %."""
SECONDS = 60.0
"""That one race may take."""

Subject = FrozenTask | Instance
"""What learners are raced on."""


# -- learners -----------------------------------------------------------------------------------------------------------


RIGHT = (
    Examinee("right Q-learning", ("reward",), q_learning),
    Examinee("right Monte-Carlo control", ("reward",), monte_carlo),
)
"""Learners that master a task on which others can be wrong."""


# -- families -----------------------------------------------------------------------------------------------------------


def family_of(name: str) -> ExperimentFile:
    """Return the experiment of this path or name; for a suite, one with each of its tasks once.

    Raises:
        SpecError: E710 when there is none, or with every mistake in its shape.
    """
    if name not in {entry.suite for entry in registry.known().values()}:
        return read(name)
    tasks = "".join(f"  - task: {task}\n" for task in names_in(name))
    return described(read_text(f"experiment: 1\nname: {name}\ntasks:\n{tasks}", name))


def rounds(family: ExperimentFile, seed: int) -> Iterator[list[Instance]]:
    """Yield the instances of each round: the family with another seed of its samples, without those of earlier rounds."""
    known: set[str] = set()
    number = 0
    while True:
        expanded = expand(_sampled(family, 1_000_003 * seed + number))
        expanded.raise_if_wrong()
        new = []
        for instance in expanded.instances:
            if instance.problem is None and instance.id not in known:
                known.add(instance.id)
                new.append(instance)
        if not new:
            return
        yield new
        number += 1


def _sampled(family: ExperimentFile, seed: int) -> ExperimentFile:
    entries = []
    for entry in family.experiment.tasks:
        if entry.sample is not None:
            count = entry.sample
            if isinstance(count, Sample):
                count = count.count
            entry = entry.model_copy(update={"sample": Sample(count=count, seed=seed)})
        entries.append(entry)
    return replace(family, experiment=family.experiment.model_copy(update={"tasks": entries}))


# -- races: one job -----------------------------------------------------------------------------------------------------


def race(
    subject: Subject, learners: Sequence[Examinee], seeds: Sequence[int], steps: int, limits: str
) -> list[list[float] | None]:
    """Return the scores of learners on one task, each with each seed; None for who cannot learn it, and where nothing can be won.

    An instance is raced as tables, where it has some. The best is the optimum, or the expert where that is not known.
    """
    with also(limits):
        results = results_of(_task(subject), EPISODES)
        random = results.random
        best = results.optimal or results.expert
        if random is None or best is None or not best.value - random.value > 1e-6:
            return [None] * len(learners)
        unit = best.value - random.value
        scores: list[list[float] | None] = []
        for one in learners:
            try:
                returns = np.array([_return(one, results, seed, steps) for seed in seeds])
                scores.append(np.maximum(-1.0, (returns - random.value) / unit).tolist())
            except CannotLearn:
                scores.append(None)
        return scores


def _return(one: Examinee, results: Results, seed: int, steps: int) -> float:
    train = one.trainer()
    policy = train(Case(results.task, (seed,), ExamTerms(steps, one.learns_from)))
    if one.together:
        (policy,) = policy
    if isinstance(policy, Learned):
        policy = policy.policy
    return observed_value(results, policy, seed).deterministic.value


def _task(subject: Subject) -> Task:
    tables = tables_of(subject)
    if tables is not None:
        return task_of_tables(tables)
    assert isinstance(subject, Instance)
    return subject.load()


def tables_of(subject: Subject) -> FrozenTask | None:
    """Return a task as tables; None where it has none, or where learners would see other actions or observations."""
    if isinstance(subject, FrozenTask):
        return subject
    task = subject.load()
    if task.action_layout.form != "discrete":
        return None
    try:
        return observable(extract(with_all_actions(task), reachable=True))
    except SpecError as error:
        if set(error.codes) == {"E712"}:
            return None
        raise


def size_of(subject: Subject) -> str:
    """Return the numbers of states, actions and steps in words; the id of an instance."""
    if isinstance(subject, Instance):
        return subject.id
    steps = "inf steps"
    if subject.horizon is not None:
        steps = plural(subject.horizon, "step")
    return f"{plural(len(subject.states), 'state')}, {plural(len(subject.actions), 'action')}, {steps}"
