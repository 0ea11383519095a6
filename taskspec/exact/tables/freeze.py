"""A task's exact model as tables, in the rationals that its spec writes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.policies.adapters import ProbabilisticPolicy
from taskspec.exact.policies.policy import states_of
from taskspec.exact.rules.conditions import condition_over_states
from taskspec.exact.rules.evaluator import InvalidClaim
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.outcomes import Place, visited_table
from taskspec.exact.tables.frozen_task import FrozenTask, plain_names, separated
from taskspec.language.expressions import syntax
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import BOOL
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task

MOST_STATES = 1000
"""The largest number of states of a task that is frozen."""
TIME = "t"
"""The component that is added to states where the time matters."""


def freeze(task: Task) -> FrozenTask:
    """Write a task as tables, with its exact returns as claims; all actions are legal there.

    Args:
        task: a finite task whose observations are functions of the state.

    Returns:
        the tables, in the rationals of the spec.

    Raises:
        SpecError: E712 for a task that has no exact model, is too large, or whose observations are drawn.
    """
    task = with_all_actions(task)
    model = extract(task, reachable=True)
    frozen = tables(model, MOST_STATES)
    if not task.observation.is_state:
        if frozen.seen is None:
            refuse(f"observations of {task.id} are not functions of the state")
        if model.is_timed and frozen.last is None:
            refuse(f"{task.id} depends on the time, which its observations leave out", "add the time to the state")
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
    return separated(replace(frozen, text=text, claims=claims))


def tables(model: Model, most: int) -> FrozenTask:
    """Write a model as tables of the states that some episode visits.

    States in which no episode acts stay as they are and pay nothing. Where the time matters, it becomes part of the state.

    Args:
        model: an exact model.
        most: the largest number of states.

    Returns:
        the tables, without claims.

    Raises:
        SpecError: E712 for a model that is too large.
    """
    visited = visited_table(model, most)
    labels = {}
    for name, holds in _conditions(model):
        labels[name] = frozenset(i for i, (_, s) in enumerate(visited.places) if holds[s])
    values = tuple(_values(model, visited.places, visited.is_timed))
    return FrozenTask(
        name=f"Frozen{model.task.name}", states=_names([model.state(s) for _, s in visited.places], values, "s"),
        actions=_names([model.action(a) for a in range(model.n_actions)], (), "a"),
        start=visited.start, outcomes=visited.outcomes, horizon=model.horizon, discount=visited.discount, last=visited.last,
        values=values, seen=_observations(model, visited.places, visited.is_timed),
        labels=labels,
    )  # fmt: skip


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
        numbers = values[i] if values else part
        if len(part) == 1 and TIME not in numbers:
            names += map(str, part.values())
        else:
            names.append("_".join(f"{name}{value}" for name, value in numbers.items()))
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
    reader = ProbabilisticPolicy(model.task, np.asarray, 0)
    if model.task.observation.is_state or reader.is_noisy or (reader.sees_time and not is_timed):
        return None

    @cache
    def seen_at(t: int) -> list[tuple[float, ...]]:
        rows = reader.observe(states_of(model), t, np.random.default_rng(0))
        parts = list(rows.values()) if isinstance(rows, dict) else [rows]
        columns = [np.asarray(part, np.float64).reshape(model.n_states, -1) for part in parts]
        return list(map(tuple, np.hstack(columns).tolist()))

    return tuple(seen_at(t if reader.sees_time else 0)[s] for t, s in places)
