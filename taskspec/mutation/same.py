"""Whether two specs mean the same task: by their cores in a normal form, or by everything that can happen in their episodes.

Nothing is sampled and nothing rounded. Where neither is a proof, the answer is no.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taskspec.abstraction.abstraction import abstraction
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Draw, Node, draws, reads
from taskspec.lang.normal import NormalForms
from taskspec.lang.variates import VARIATES
from taskspec.model.reach import visits
from taskspec.model.space import Reads
from taskspec.model.transitions import TIME, Steps, count, joint_outcomes, merge_outcomes
from taskspec.solve.enclosure import Inexact, Reader
from taskspec.solve.rational import ExactProbabilities
from taskspec.task.task import Component, Task

MOST = 5_000_000
"""Outcomes of steps that are compared, at the most."""
CHUNK = 20_000


def same_task(one: Task, other: Task) -> bool:
    """Return whether two tasks are the same for everyone: spaces, episodes, observations and expert."""
    one = one.remembering()
    other = other.remembering()
    return same_core(one, other) or same_episodes(one, other)


def shell(task: Task, ranges: bool = True) -> tuple[Any, ...]:
    """Return what a task is around its expressions, with or without the ranges of its state."""
    about = (task.horizon, task.discount, task.modifiers, task.observation.space, task.observation.is_state)
    known = [(p.name, p.kind, p.default, p.low, p.high, p.values) for p in task.parameters]
    state = [_declared(c, ranges) for c in task.state]
    seen = [_declared(c, ranges) for c in task.observation.components]
    return (*about, known, state, [_declared(c, True) for c in task.action], seen)


def _declared(c: Component, ranges: bool) -> tuple[Any, ...]:
    labels = c.domain and (c.domain.labels, c.domain.values, c.domain.value_type)
    return (c.name, c.type, labels, *((c.low, c.high) if ranges else ()))


# -- the core -----------------------------------------------------------------------------------------------------


def _forms(task: Task, forms: NormalForms) -> tuple[int, ...]:
    """Return the forms of all that a task computes."""
    groups = (task.initial, task.first_observation), ((*task.next, task.reward, task.terminal), task.next_observation)
    found = [number for group in groups for number in forms.all([node for nodes in group for node in nodes])]
    return (*found, *forms.all([*task.observation.nodes, task.absorbing_reward, *_expert_nodes(task)]))


def _expert_nodes(task: Task) -> tuple[Node, ...]:
    return task.expert if isinstance(task.expert, tuple) else ()


def same_core(one: Task, other: Task) -> bool:
    """Return whether two tasks compute the same, up to the order of operands that may change places."""
    forms = NormalForms()
    if shell(one) != shell(other) or _forms(one, forms) != _forms(other, forms) or not _same_experts(one, other):
        return False
    return _same_stand_ins(one, other, forms)


def _same_experts(one: Task, other: Task) -> bool:
    """Return whether two experts are of a kind, and the same where they are no expressions."""
    a = one.expert
    b = other.expert
    return isinstance(a, tuple) == isinstance(b, tuple) and (isinstance(a, tuple) or a == b)


def _same_stand_ins(one: Task, other: Task, forms: NormalForms) -> bool:
    try:
        a = abstraction(one)
        b = abstraction(other)
    except SpecError:
        return False
    if a is None or b is None:
        return a is b
    maps = [forms.all(each.nodes) for each in (a, b)]
    return maps[0] == maps[1] and (
        same_core(a.stand_in, b.stand_in) or same_episodes(a.stand_in, b.stand_in, ranges=False)
    )


# -- episodes -----------------------------------------------------------------------------------------------------


def same_episodes(one: Task, other: Task, ranges: bool = True) -> bool:
    """Return whether two finite tasks cannot be told apart in any episode, whatever is done in it.

    In every state that episodes reach, the start, the outcomes of every action (next state, reward and end
    together, with their probabilities as rationals), the observations and the expert's actions are compared, all to the
    last bit. Without `ranges`, those of the state may differ where no episode goes.
    """
    if shell(one, ranges) != shell(other, ranges) or not (one.is_finite and other.is_finite):
        return False
    forms = NormalForms()
    if not (_same_stand_ins(one, other, forms) and _same_experts(one, other)):
        return False
    try:
        return _same_finite(Steps(one), Steps(other), forms)
    except (SpecError, Inexact):
        return False


def _same_finite(one: Steps, other: Steps, forms: NormalForms) -> bool:
    if not all(map(_is_enumerable, (one, other))) or not _same(_starts(one), _starts(other)):
        return False
    found = visits(one)
    last = one.task.horizon or 0
    timed = one.uses_time or other.uses_time
    if timed and len(found.acting) * one.actions.size * one.branching * last > MOST:
        return False
    for t in range(last if timed else 1):
        if not all(_same(_rows(one, given), _rows(other, given)) for given in _points(one, found.acting, t)):
            return False
    return _same_seen(one, other, found.entered, forms) and _same_chosen(one, other, found.acting, forms)


def _step_nodes(task: Task) -> tuple[Node, ...]:
    return (*task.next, task.reward, task.terminal)


def _is_enumerable(steps: Steps) -> bool:
    task = steps.task
    cost = steps.states.size * steps.actions.size * max(1.0, steps.branching)
    found = draws((*_step_nodes(task), *task.initial))
    return max(cost, count(draws(task.initial), {})) <= MOST and all(map(_is_complete, found))


def _is_complete(draw: Draw) -> bool:
    """Return whether all outcomes of a draw are gone through."""
    outcomes = VARIATES[draw.base].outcomes
    return outcomes is not None and not outcomes.tail


def _points(steps: Steps, states: Array, t: int) -> Iterator[Reads]:
    """Yield what is read in some states with every action, a part at a time."""
    per_part = max(1, int(CHUNK // (steps.actions.size * max(1.0, steps.branching))))
    for low in range(0, len(states), per_part):
        some = states[low : low + per_part]
        here = np.tile(some, steps.actions.size)
        there = np.repeat(np.arange(steps.actions.size), len(some))
        yield {**steps.states.decode(here), **steps.actions.decode(there), TIME: np.full(len(here), t)}


def _starts(steps: Steps) -> list[Array]:
    """First states, each once, with their probabilities."""
    return _outcomes(steps.task.initial, {}, 1)


def _rows(steps: Steps, given: Reads) -> list[Array]:
    """Return every outcome of a step at some points once (point, next state, reward, end), with its probability."""
    return _outcomes(_step_nodes(steps.task), given, len(given[TIME]))


def _outcomes(roots: Sequence[Node], given: Reads, lanes: int) -> list[Array]:
    """Return columns of outcomes, the last one their probabilities, in a fixed order."""
    parts = []
    for values, point, weight in joint_outcomes(roots, given, lanes, ExactProbabilities(Reader())):
        rows = [row for v in values for row in v.reshape(-1, v.shape[-1])]
        parts.append([point, *rows, weight])
    *keys, weight = [np.concatenate(column) for column in zip(*parts, strict=True)]
    distinct, total = merge_outcomes(keys, weight)
    return [*distinct, total]


def _same(one: Sequence[Array], other: Sequence[Array]) -> bool:
    return len(one) == len(other) and all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def _same_seen(one: Steps, other: Steps, states: Array, forms: NormalForms) -> bool:
    """Return whether every state looks the same at every time; what is drawn must be drawn alike, and apart from the step."""
    for task in (one.task, other.task):
        if {d.site for d in draws(_step_nodes(task))} & {d.site for d in draws(task.observation.nodes)}:
            return False
    nodes = one.task.observation.nodes, other.task.observation.nodes
    return _same_values(one, other, nodes, states, forms, last=1)


def _same_chosen(one: Steps, other: Steps, states: Array, forms: NormalForms) -> bool:
    """Return whether the experts do the same in every state, and what is paid after the end is the same."""
    paid = [tuple(forms.all([s.task.absorbing_reward])) for s in (one, other)]
    nodes = _expert_nodes(one.task), _expert_nodes(other.task)
    return paid[0] == paid[1] and _same_values(one, other, nodes, states, forms, last=0)


def _same_values(
    one: Steps, other: Steps, nodes: tuple[Sequence[Node], Sequence[Node]], states: Array, forms: NormalForms, last: int
) -> bool:
    """Return whether some nodes have the same values in given states at all times; those that draw must have the same
    form.
    """
    pairs = list(zip(*nodes, strict=True))
    drawn = [pair for pair in pairs if draws(pair)]
    if drawn:
        a, b = zip(*drawn, strict=True)
        if forms.all(a) != forms.all(b):
            return False
    found = [node for pair in pairs if not draws(pair) for node in pair]
    horizon = one.task.horizon
    timed = TIME in reads(found)
    if timed and (horizon is None or len(states) * horizon > MOST):
        return False
    for t in range((horizon or 0) + last) if timed else (0,):
        given = dict(one.states.decode(states)) | {TIME: np.array([t])}
        values = [np.broadcast_to(v, (*v.shape[:-1], len(states))) for v in evaluate(found, given)]
        if not all(map(np.array_equal, values[::2], values[1::2])):
            return False
    return True
