"""Judge changes of a spec: what notices them (compiler, checks, examples, claims), and whether two tasks are the same."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.abstraction.verify import MOST, MOST_ENTRIES, Uncompared, difference
from taskspec.exact.check.report import check, set_aside
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model
from taskspec.exact.model.transitions import picked
from taskspec.exact.rules.examples import wrong_examples
from taskspec.exact.soundness.soundness import check_ranges
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.interval import NormalForms
from taskspec.language.expressions.ir import Read, draw_sites, draws, reads
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.source import Document, read_file
from taskspec.language.task.build import build
from taskspec.language.task.merge import merge, variant_names
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task
from tests.verification.spec_changes.mutants import Mutant, mutants

Class = Literal["error", "example", "claim", "warning", "equivalent", "range", "order", "silent"]
CLASSES: Mapping[Class, str] = {
    "error": "the changed spec is refused, or unsound",
    "example": "an example does not hold any more",
    "claim": "a claim does not hold any more, or cannot be decided",
    "warning": "the changed spec is warned about",
    "equivalent": "proved to be the same task",
    "range": "the same tasks; other parameter values are allowed",
    "order": "the same task; its labels are numbered otherwise",
    "silent": "nothing notices",
}
PART = 8  # mutants that a process is handed at once


@dataclass(frozen=True, slots=True)
class Judgement:
    """The class of a mutant, with the diagnostic that decides it; its place is left out, since nobody has written its text."""

    kind: Class
    code: str | None = None
    message: str | None = None

    @classmethod
    def by(cls, kind: Class, found: Diagnostic) -> Judgement:
        return cls(kind, found.code, found.message)


Tasks = Mapping[str | None, Task]  # the complete tasks of a spec, by variant


def tasks_of(document: Document) -> Tasks:
    """Return the tasks of a spec; raises SpecError when it has none, or one with mistakes that its own sections cause."""
    found = {}
    for variant in variant_names(document.data).values():
        if not merge(document, variant).missing:
            found[variant] = build(document, variant)
    return found


def judge(original: Document, tasks: Tasks, mutant: Mutant) -> Judgement:
    """Return what notices a mutant: the first of the stages that does, and of all that a check says what weighs most."""
    try:
        pairs = list(_changed(original, tasks, mutant.document()))
    except SpecError as error:
        return Judgement.by("error", error.diagnostics[0])
    if mutant.section == "parameters" and mutant.path[-1] in ("low", "high"):  # it decides the range of values alone
        wrong = next((diagnostic for _, task in pairs for diagnostic in _at_ends(task)), None)
        return Judgement("range") if wrong is None else Judgement.by("error", wrong)
    wrong = next((diagnostic for _, task in pairs for _, diagnostic in wrong_examples(task)), None)  # which costs least
    if wrong is not None:
        return Judgement.by("example", wrong)
    pairs = [pair for pair in pairs if not _are_same_everywhere(*pair)]
    if not pairs:
        return Judgement("equivalent")
    found: list[Diagnostic] = []
    for _, task in pairs:
        found += check(task, ranges=False).diagnostics
    if not found:
        for _, task in pairs:
            found += _at_ends(task)
    by_class = {_class_of(diagnostic): diagnostic for diagnostic in reversed(found)}
    for kind in ("error", "claim", "warning"):
        if kind in by_class:
            return Judgement.by(kind, by_class[kind])
    return Judgement("order" if mutant.renumbers else "silent")


def _at_ends(task: Task) -> list[Diagnostic]:
    return set_aside(task, check_ranges(task).diagnostics)[0]


@lru_cache(maxsize=8)
def _settings(task: Task) -> tuple[Mapping[str, Any], ...]:
    return check_ranges(task).cases


def _class_of(diagnostic: Diagnostic) -> Class:
    if diagnostic.severity == "warning":
        return "warning"
    return "claim" if diagnostic.code.startswith("E6") else "error"


def _changed(original: Document, tasks: Tasks, changed: Document) -> Iterator[tuple[Task, Task]]:
    """Yield the tasks whose data the change is part of, before and after it."""
    for variant, before in tasks.items():
        if merge(original, variant).data != merge(changed, variant).data:
            yield before, build(changed, variant)


def _are_same_everywhere(one: Task, other: Task) -> bool:
    """Return whether two tasks are the same for their parameters as they are, and for all others that are tried."""
    if not same_task(one, other):
        return False
    for values in _settings(one):
        try:
            pair = [build(x.source.document, x.source.variant, values, x.source.suite) for x in (one, other)]
            if not same_task(*pair):
                return False
        except SpecError:
            return False
    return True


def judgements(path: Path, jobs: int = 1) -> Iterator[tuple[Mutant, Judgement]]:
    """Yield what becomes of every mutant of a spec, in the order of the file; with one job, everything happens here."""
    made = _prepared(path)[2]
    with ExitStack() as stack:
        mapped: Any = map
        if jobs > 1:
            context = multiprocessing.get_context("spawn")  # what is forked from threads may wait for ever
            pool = stack.enter_context(ProcessPoolExecutor(jobs, context))
            mapped = partial(pool.map, chunksize=PART)
        numbers = range(len(made))
        yield from zip(made, mapped(_judge_number, [path] * len(made), numbers), strict=True)


def _judge_number(path: Path, number: int) -> Judgement:
    original, tasks, found = _prepared(path)
    return judge(original, tasks, found[number])


@lru_cache(maxsize=1)
def _prepared(path: Path) -> tuple[Document, Tasks, list[Mutant]]:
    """Return a spec, its tasks, and its mutants; read once in each process."""
    document = read_file(path)
    return document, tasks_of(document), list(mutants(document))


def same_task(one: Task, other: Task) -> bool:
    """Return whether two tasks are the same for everyone: spaces, episodes, observations and expert."""
    return _are_same(one.remembering(), other.remembering(), ranges=True)


def _are_same(one: Task, other: Task, ranges: bool) -> bool:
    """Return whether two tasks are the same; without `ranges`, those of states may differ where no episode goes."""
    if _shell(one, ranges) != _shell(other, ranges) or not _have_same_stand_ins(one, other):
        return False
    forms = NormalForms()
    if _shell(one, True) == _shell(other, True) and _forms(one, forms) == _forms(other, forms):
        return True
    return one.is_finite and other.is_finite and _have_same_episodes(one, other, forms)


def _shell(task: Task, ranges: bool) -> tuple[Any, ...]:
    """Return what a task is around its expressions, with or without the ranges of its state."""
    expert = None if isinstance(task.annotations.expert, tuple) else (task.annotations.expert,)
    about = (task.horizon, task.discount, task.modifiers, task.observation.space, task.observation.is_state, expert)
    parameters = [(p.name, p.kind, p.default, p.low, p.high, p.values) for p in task.parameters]
    state = [_declared(c, ranges) for c in task.state]
    seen = [_declared(c, ranges) for c in task.observation.components]
    return (*about, parameters, state, [_declared(c, True) for c in task.action], seen)


def _declared(c: Component, ranges: bool) -> tuple[Any, ...]:
    labels = c.domain and (c.domain.labels, c.domain.values, c.domain.value_type)
    bounds = (c.low, c.high) if ranges else ()
    return (c.name, c.type, labels, *bounds)


def _forms(task: Task, forms: NormalForms) -> list[int]:
    """Return the forms of all that a task computes."""
    found = forms.all([*task.process.initial, *task.first_observation])
    found += forms.all([*task.step_roots, *task.mask])
    expert = task.annotations.expert_nodes
    return found + forms.all([*task.observation.nodes, task.process.absorbing_reward, *expert])


def _have_same_stand_ins(one: Task, other: Task) -> bool:
    try:
        a = abstraction(one)
        b = abstraction(other)
    except SpecError:
        return False
    if a is None or b is None:
        return a is b
    forms = NormalForms()
    return forms.all(a.nodes) == forms.all(b.nodes) and _are_same(a.stand_in, b.stand_in, ranges=False)


def _have_same_episodes(one: Task, other: Task, forms: NormalForms) -> bool:
    """Return whether two finite tasks cannot be distinguished in any episode, for any actions.

    In every state that episodes reach, the outcomes of every action (next state, reward and end together, with their
    probabilities as rationals), the observations and the expert's actions are compared, all to the last bit.
    """
    for task in (one, other):
        steps = (*task.process.next, task.process.reward, task.process.terminal)
        seen = draw_sites(task.observation.nodes)
        for draw in draws((*task.process.initial, *steps)):
            outcomes = VARIATES[draw.base].outcomes
            if outcomes is None or outcomes.tail:
                return False
        if seen & draw_sites(steps):
            return False
    if forms.all([one.process.absorbing_reward]) != forms.all([other.process.absorbing_reward]):
        return False
    states = [Read(Role.STATE, c.name, c.type, c.least, c.most) for c in one.state]
    try:
        model = extract(one, True, MOST_ENTRIES)
        wrong = difference(
            model, states, extract(other, True, MOST_ENTRIES), isinstance(one.annotations.expert, tuple), as_paid=True
        )
        return wrong is None and _have_same_observations(model, other, forms)
    except (SpecError, Uncompared):
        return False


def _have_same_observations(model: Model, other: Task, forms: NormalForms) -> bool:
    """Return whether every state looks the same at every time; observations that draw must have the same form."""
    own = []
    others = []
    for a, b in zip(model.task.observation.nodes, other.observation.nodes, strict=True):
        if not draws((a, b)):
            own.append(a)
            others.append(b)
        elif forms.all([a]) != forms.all([b]):
            return False
    times = 1
    if TIME in reads([*own, *others]):
        times = (model.horizon or MOST) + 1
    if times * model.n_states > MOST and times > 1:
        return False
    for t in range(times):
        given = picked(model.reads(t), model.entered)
        if not all(np.all(a == b) for a, b in zip(evaluate(own, given), evaluate(others, given), strict=True)):
            return False
    return True
