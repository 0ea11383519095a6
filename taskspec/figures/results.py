"""Overlays from exact analysis: optimal values, the optimal or the expert's policy, how often states are visited."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact import Model
from taskspec.exact.model.extract import extract
from taskspec.exact.planning import plans, solve
from taskspec.figures.overlay import Overlay
from taskspec.registry import load
from taskspec.task.task import Task, TaskLike

OVERLAYS = ("values", "policy", "expert", "occupancy")
"""Names of what can be laid over a figure."""


def overlay(task: TaskLike, names: Iterable[str]) -> Overlay:
    """What to lay over a task's figure.

    Args:
        task: one that has an exact model.
        names: of `values` (optimal, with the whole horizon left), `policy` (all optimal actions) or
            `expert` (its actions), and `occupancy` (of the expert where there is one, else of an
            optimal policy; the most visited state is 1). Values and actions are those of states in which
            some episode acts.

    Raises:
        SpecError: for another name (E713), without an exact model (E712) or scipy (E705).
    """
    wanted = set(names)
    for unknown in sorted(wanted - set(OVERLAYS)):
        raise SpecError((Diagnostic("E713", None, f"'{unknown}' is not an overlay", f"use {', '.join(OVERLAYS)}"),))
    if not wanted:
        return Overlay()
    task = load(task)
    if task.modifiers:
        message = "a figure shows a task without its modifiers, and results with them cannot be laid over it"
        raise SpecError((Diagnostic("E713", None, message),))
    model = extract(task)
    optimal = plans.optimal_plan(model)
    acting = plans.expert_plan(model) or optimal
    plan = optimal if "policy" in wanted else acting
    return Overlay(
        values=_values(model) if "values" in wanted else {},
        policy=_policy(model, plan(0)) if wanted & {"policy", "expert"} else {},
        occupancy=_visits(model, acting) if "occupancy" in wanted else {},
        legend=tuple(_legend(task, wanted)),
    )


def _legend(task: Task, wanted: set[str]) -> Iterator[str]:
    """What is laid over the figure, a line for each."""
    left = "" if task.horizon is None else f" with all {task.horizon:,} steps to go"
    on_grid = task.figure is not None and task.figure.kind == "grid"
    number, arrow = ("numbers", "arrows") if on_grid else ("V", "thick arrows")
    whose = "the expert's" if task.expert is not None else "an optimal policy's"
    if "values" in wanted:
        yield f"{number}: best return{left}"
    if "policy" in wanted:
        yield f"{arrow}: best actions{left}"
    elif "expert" in wanted:
        yield f"{arrow}: {whose} actions at first"
    if "occupancy" in wanted:
        yield f"shade: {whose} visits"


def _values(model: Model) -> dict[int, float]:
    """Best returns by code of the states in which some episode acts: in others there is nothing to come."""
    values = solve.solve(model).value
    return dict(zip(model.codes[model.acting].tolist(), values[model.acting].tolist(), strict=True))


def _policy(model: Model, table: np.ndarray[Any, Any]) -> dict[int, tuple[int, ...]]:
    """Actions (A, S) of positive probability, by code of the states in which some episode acts."""
    return {int(model.codes[i]): tuple(np.flatnonzero(table[:, i] > 0).tolist()) for i in np.flatnonzero(model.acting)}


def _visits(model: Model, plan: plans.Plan) -> dict[int, float]:
    """How often states are visited, by code; the most visited one 1."""
    total = solve.occupancy(model, plan)
    return dict(zip(model.codes.tolist(), (total / (total.max() or 1.0)).tolist(), strict=True))
