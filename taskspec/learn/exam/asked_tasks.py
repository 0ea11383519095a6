"""The tasks that an exam asks, and their twins."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.ids import InstanceId
from taskspec.language import registry
from taskspec.language.modifiers import keeps_observers, modify
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.data.episodes import recorded
from taskspec.learn.documents.document_models import ExamDocument
from taskspec.learn.documents.rule_books import EXAM, file_of, read_exam

Modifiers = tuple[str, ...]
SUITE = "probes"
"""The suite of an exam, unless a suite or tasks are named."""
SUITES = ("derail", "probes")
"""The suites whose tasks can be named without theirs."""


def suites_of(suite: str | None, tasks: Sequence[TaskLike] | None) -> tuple[str, ...]:
    """Return the suites of an exam: the one that is named, or those in which tasks are looked for, or the probes."""
    if suite is not None:
        return (suite,)
    if tasks is not None:
        return SUITES
    return (SUITE,)


def tasks_of(suites: Sequence[str], wanted: Sequence[TaskLike] | None) -> list[Task]:
    """Return the tasks of an exam, in the variants in which a learner acts.

    Args:
        wanted: those to ask, by their names in one of the suites, or as anything that `taskspec.load` takes; None for those that
            each suite's `exam.yaml` names, or all where it names none.

    Raises:
        SpecError: E701 for what is none; E713 for an unknown suite.
    """
    known: dict[str, str] = {}
    for suite in reversed(suites):
        known |= {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if wanted is None:
        wanted = list(itertools.chain.from_iterable(map(names_in, suites)))
    tasks = []
    for task in wanted:
        if isinstance(task, str):
            tasks.append(registry.load(known.get(task, task)))
        else:
            tasks.append(registry.load(task))
    ids = [exam_id(task) for task in tasks]
    for i, name in enumerate(ids):
        if name in ids[:i]:
            raise SpecError([Diagnostic("E713", None, f"{name} is given twice", "an exam has each task once")])
    return tasks


def names_in(suite: str) -> list[str]:
    """Return the ids of the tasks that the exam of a suite asks."""
    known = {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if not known:
        suites = {e.suite for e in registry.known().values()}
        raise SpecError([Diagnostic("E713", None, f"there is no suite '{suite}'", suggest(suite, suites))])
    asked = described_of(suite).tasks
    return [known[name] for name in asked or known]


def described_of(suite: str) -> ExamDocument:
    """Return the suite's `exam.yaml`; an empty one where it has none."""
    path = file_of(suite, EXAM)
    if path is None:
        return ExamDocument(exam=1)
    described = read_exam(path).described
    assert isinstance(described, ExamDocument)
    return described


def same_tasks(suite: str) -> Mapping[str, str]:
    """Return tasks that count as others in the rules of a suite's exam, by their names; none where there is no such suite."""
    path = file_of(suite, EXAM)
    if path is None:
        return {}
    return read_exam(path).same


def exam_id(task: Task) -> str:
    """Return the name of a task in results: its id, with modifiers and those parameters that are not at their defaults."""
    values = {p.name: p.value for p in task.parameters if p.value != p.default}
    return str(InstanceId(task.id, dict(sorted(values.items())), tuple(map(str, task.modifiers))))


# Twins: the same task in other words, where a learner that is right earns the same, and one that is right by luck does not.

TRIED = 16
"""Seeds that twins are chosen from, at least."""
WAYS = ("permuted_actions={seed},per_state=true", "permuted_actions={seed}")
"""How actions are permuted: the first way is taken that keeps what those can earn who see observations alone."""
SHOWN = 8
"""Episodes of the expert that show its actions in the states that it visits."""


@lru_cache(maxsize=64)
def twins_of(task: Task, wanted: int) -> tuple[Modifiers, ...]:
    """Return the modifiers of each twin; none where the task has no twins.

    In finite tasks observations are renamed, and the actions of each state are permuted, by a seed; in all states by the same
    permutation where two states look alike, so that those who see observations alone can earn what they could. Seeds are chosen
    among the first ones: such that no constant action is the expert's, where that can be, and that from twin to twin its actions
    differ in as many states as possible. Other tasks are seen and steered by the symmetries that they declare.
    """
    way = _way(task)
    if way is None:
        return tuple((f"symmetry={each.name}",) for each in task.annotations.symmetries[:wanted])
    if not wanted:
        return ()
    known = {seed: _expert_actions(task, way, seed) for seed in range(1, max(TRIED, 2 * wanted) + 1)}
    varied = [seed for seed, actions in known.items() if (actions != actions[0]).any()]
    left = varied
    if len(varied) < wanted:
        left = list(known)
    chosen = [left[0]]
    while len(chosen) < wanted:
        differing = {}
        for seed in left:
            if seed not in chosen:
                differing[seed] = min(np.count_nonzero(known[seed] != known[other]) for other in chosen)
        chosen.append(max(differing, key=lambda seed: differing[seed]))
    return tuple(_modifiers(way, seed) for seed in chosen)


def _way(task: Task) -> str | None:
    """Return how the actions of a task are permuted; None where they or what is observed cannot be renamed."""
    try:
        return next((way for way in WAYS if keeps_observers(task, *_modifiers(way, 1))), None)
    except SpecError as error:
        if set(error.codes) <= {"E720"}:
            return None
        raise


def _modifiers(way: str, seed: int) -> Modifiers:
    return way.format(seed=seed), f"relabelled={seed}"


def _expert_actions(task: Task, way: str, seed: int) -> Array:
    twin = registry.role(modify(task, way.format(seed=seed)), "expert")
    policy = "expert"
    if twin.annotations.expert is None:
        policy = "optimal"
    shown = recorded(twin, policy, episodes=SHOWN, transitions=None, seed=0, jobs=1)
    return np.asarray(shown.acts)
