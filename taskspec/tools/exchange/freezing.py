"""The exact model of a task as tables: frozen, with all that its spec has, or for policies and files alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.exact.model.extract import extract, with_reward
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.policies.state_observations import StateObservations
from taskspec.exact.rules.evaluator import InvalidClaim, condition_over_states
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.outcomes import Number, Place, visited_table
from taskspec.language.expressions import syntax
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import BOOL
from taskspec.language.task import questions
from taskspec.language.task.task import Task
from taskspec.tools.exchange.frozen_task import FrozenTask, components_name, plain_names, separated

MOST_STATES = 1000
"""The largest number of states of a task that is frozen."""
TIME = "t"
"""The component that is added to states where the time matters."""


def freeze(task: Task) -> FrozenTask:
    """Write a task as tables, with its exact returns as claims, and remarks on what tables do not have.

    Raises:
        SpecError: E712 for a task that has no exact model, is too large, or whose observations are drawn.
    """
    model = extract(task, reachable=True)
    frozen = observable(model)
    results = Results(task, 1)
    claims = {}
    for name in ("optimal", "random", "worst"):
        value = getattr(results, name)
        if value is not None:
            claims[f"{name}_return"] = value.value
    text = {
        "title": f"{task.title or task.name}, frozen",
        "summary": f"{task.instance_id} as tables, without draws of constants.",
        "description": task.spec.description or "",
        "capability": task.capability or "",
    }
    return _with_measures(replace(frozen, text=text, claims=claims), model)


def observable(model: Model) -> FrozenTask:
    """Write a model as tables for policies, which act by what they observe.

    Raises:
        SpecError: E712 for a model that is too large, or whose observations are drawn.
    """
    task = model.task
    frozen = tables(model, MOST_STATES)
    if not task.observation.is_state:
        if frozen.seen is None:
            refuse(f"observations of {task.id} are not functions of the state")
        if model.is_timed and frozen.last is None:
            refuse(f"{task.id} depends on the time, which its observations leave out", "add the time to the state")
    return separated(frozen)


def _with_measures(frozen: FrozenTask, model: Model) -> FrozenTask:
    """Add the measures of the model's task; remark on those that have no table, such as one that alone depends on the time."""
    measures = {}
    for name in model.task.process.measures:
        try:
            paid = separated(tables(_paying(model, name), MOST_STATES))
        except SpecError:
            paid = None
        if paid is not None and paid.states == frozen.states:
            measures[name] = paid
        else:
            frozen = frozen.remarked(f"lost: the measure {name}, which has no table over these states")
    return replace(frozen, measures=measures)


def _paying(model: Model, measure: str) -> Model:
    """Return the model with a measure as its reward, as timed as it is."""
    paid = with_reward(model, model.task.process.measures[measure])
    if model.is_timed and not paid.is_timed:
        return replace(paid, steps=paid.steps * len(model.steps))
    return paid


def tables(model: Model, most: int) -> FrozenTask:
    """Write a model as tables of the states that some episode visits.

    States in which no episode acts stay as they are and pay nothing. Where the time matters, it becomes part of the state.

    Raises:
        SpecError: E712 for a model that is too large.
    """
    visited = visited_table(model, most)
    labels = {}
    places = np.array([s for _, s in visited.places], dtype=int)
    for name, holds in _conditions(model):
        labels[name] = frozenset(np.flatnonzero(holds[places]).tolist())
    values = tuple(_values(model, visited.places, visited.is_timed))
    absorbing: tuple[Number, ...] = ()
    remarks: tuple[str, ...] = ()
    paid = model.task.process.absorbing_reward
    if questions.reads_time([paid]) or questions.is_random([paid]):
        remarks = ("lost: the absorbing reward, which depends on the time or is drawn",)
    elif pays_after_ends(model.task):
        (each,) = evaluate([paid], model.reads())
        absorbing = tuple(np.broadcast_to(each, (model.n_states,))[places].tolist())
    return FrozenTask(
        name=f"Frozen{model.task.name}", states=_names([model.state(s) for _, s in visited.places], values, "s"),
        actions=_names([model.action(a) for a in range(model.n_actions)], (), "a"),
        start=visited.start, outcomes=visited.outcomes, horizon=model.horizon, discount=visited.discount, last=visited.last,
        values=values, seen=_observations(model, visited.places, visited.is_timed),
        labels=labels, absorbing=absorbing, remarks=remarks,
    )  # fmt: skip


def pays_after_ends(task: Task) -> bool:
    """Return whether a step after an end, where ends absorb, may pay anything."""
    return not task.process.never_ends and questions.constant(task.process.absorbing_reward) != 0


def _values(model: Model, places: Sequence[Place], is_timed: bool) -> Iterator[dict[str, int]]:
    columns: dict[str, Array] = {}
    for (_, name), value in model.reads().items():
        if name == TIME:
            continue
        flat = np.broadcast_to(value, (*value.shape[:-1], model.n_states))
        for at in np.ndindex(flat.shape[:-1]):
            columns["_".join([name, *map(str, at)])] = flat[at]
    for t, s in places:
        row = {name: int(column[s]) for name, column in columns.items()}
        if is_timed:
            row[TIME] = t
        yield row


def _names(parts: Sequence[dict[str, object]], values: Sequence[dict[str, int]], letter: str) -> tuple[str, ...]:
    """Names of states or actions: labels, or components with their values such as `x1_y0`."""
    names: list[str] = []
    for i, part in enumerate(parts):
        numbers: Mapping[str, object] = part
        if values:
            numbers = values[i]
        if len(part) == 1 and TIME not in numbers:
            names += map(str, part.values())
        else:
            names.append(components_name(numbers))
    return plain_names(names, letter)


def _conditions(model: Model) -> Iterator[tuple[str, Array]]:
    task = model.task
    if task.annotations.figure is not None:
        for name, node in task.annotations.figure.highlight.items():
            if node.type == BOOL:
                (holds,) = evaluate([node], model.reads())
                yield name, np.broadcast_to(holds, (model.n_states,))
    for number, claim in enumerate(task.annotations.claims, 1):
        for call in syntax.names(claim.expr):
            if isinstance(call, syntax.Call) and call.function in ("reachable", "probability") and call.args:
                try:
                    yield f"claim_{number}", condition_over_states(call.args[0], model)
                except InvalidClaim:
                    continue


def _observations(model: Model, places: Sequence[Place], is_timed: bool) -> tuple[tuple[float, ...], ...] | None:
    """Numbers that are observed in each place; None where the state is observed, or the place does not decide them."""
    seen = StateObservations(model)
    if model.task.observation.is_state or not seen.is_known or (seen.is_timed and not is_timed):
        return None
    rows_at = cache(lambda t: seen.matrix(t).tolist())
    return tuple(tuple(rows_at(t * seen.is_timed)[s]) for t, s in places)
