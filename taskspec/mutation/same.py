"""Whether two specs mean the same task: by their cores in a normal form, or by everything that can happen in their episodes.

Nothing is sampled and nothing rounded. Where neither is a proof, the answer is no.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import abstraction
from taskspec.abstraction.homomorphism import MOST, MOST_ENTRIES, Uncompared, difference
from taskspec.base.diagnostics import SpecError
from taskspec.lang.batch import evaluate
from taskspec.lang.interval import NormalForms
from taskspec.lang.ir import Read, Role, draws, reads
from taskspec.lang.variates import VARIATES
from taskspec.model.extract import extract
from taskspec.model.model import Model
from taskspec.model.transitions import TIME
from taskspec.task.task import Component, Task


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
    expert = None if isinstance(task.expert, tuple) else (task.expert,)
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
    found = forms.all([*task.initial, *task.first_observation])
    found += forms.all([*task.next, task.reward, task.terminal, *task.next_observation])
    expert = task.expert if isinstance(task.expert, tuple) else ()
    return found + forms.all([*task.observation.nodes, task.absorbing_reward, *expert])


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
    """Return whether two finite tasks cannot be told apart in any episode, whatever is done in it.

    In every state that episodes reach, the outcomes of every action (next state, reward and end together, with their
    probabilities as rationals), the observations and the expert's actions are compared, all to the last bit.
    """
    for task in (one, other):
        steps = (*task.next, task.reward, task.terminal)
        seen = {d.site for d in draws(task.observation.nodes)}
        for draw in draws((*task.initial, *steps)):
            outcomes = VARIATES[draw.base].outcomes
            if outcomes is None or outcomes.tail:
                return False
        if seen & {d.site for d in draws(steps)}:
            return False
    if forms.all([one.absorbing_reward]) != forms.all([other.absorbing_reward]):
        return False
    states = [Read(Role.STATE, c.name, c.type, c.least, c.most) for c in one.state]
    try:
        model = extract(one, True, MOST_ENTRIES)
        wrong = difference(
            model, states, extract(other, True, MOST_ENTRIES), isinstance(one.expert, tuple), as_paid=True
        )
        return wrong is None and _have_same_observations(model, other, forms)
    except (SpecError, Uncompared):
        return False


def _have_same_observations(model: Model, other: Task, forms: NormalForms) -> bool:
    """Return whether every state looks the same at every time; observations that draw must have the same form."""
    pairs = list(zip(model.task.observation.nodes, other.observation.nodes, strict=True))
    drawn = [pair for pair in pairs if draws(pair)]
    if forms.all([a for a, _ in drawn]) != forms.all([b for _, b in drawn]):
        return False
    own = [a for a, b in pairs if not draws((a, b))]
    others = [b for a, b in pairs if not draws((a, b))]
    times = 1
    if TIME in reads([*own, *others]):
        times = (model.horizon or MOST) + 1
    if times * model.n_states > MOST and times > 1:
        return False
    for t in range(times):
        given = {
            key: value[..., model.entered] if value.shape[-1] > 1 else value for key, value in model.reads(t).items()
        }
        if not all(np.all(a == b) for a, b in zip(evaluate(own, given), evaluate(others, given), strict=True)):
            return False
    return True
