"""Overlays from exact analysis: optimal values, the optimal or the expert's policy, how often states are visited."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact import Model
from taskspec.exact.model.extract import extract
from taskspec.exact.planning import plans, solve
from taskspec.figures.overlay import Overlay
from taskspec.registry import load
from taskspec.task.task import TaskLike

Array = np.ndarray[Any, Any]
OVERLAYS = ("values", "policy", "expert", "occupancy")


def overlay(task: TaskLike, names: Iterable[str]) -> Overlay:
    """What to lay over a task's figure.

    Args:
        task: one that has an exact model.
        names: of `values` (optimal, with the whole horizon left), `policy` (all optimal actions) or
            `expert` (its actions), and `occupancy` (of the expert where there is one, else of an
            optimal policy; the most visited state is 1).

    Raises:
        SpecError: for another name (E713), without an exact model (E712) or scipy (E705).
    """
    wanted = set(names)
    for unknown in sorted(wanted - set(OVERLAYS)):
        raise SpecError((Diagnostic("E713", None, f"'{unknown}' is not an overlay", f"use {', '.join(OVERLAYS)}"),))
    if not wanted:
        return Overlay()
    model = extract(load(task))
    optimal = plans.optimal_plan(model)
    acting = plans.expert_plan(model) or optimal
    plan = optimal if "policy" in wanted else acting
    return Overlay(
        values=_by_code(model, solve.solve(model).value) if "values" in wanted else {},
        policy=_policy(model, plan(0)) if wanted & {"policy", "expert"} else {},
        occupancy=_by_code(model, _visits(model, acting)) if "occupancy" in wanted else {},
    )


def _by_code(model: Model, values: Array) -> dict[int, float]:
    return dict(zip(model.codes.tolist(), values.tolist(), strict=True))


def _policy(model: Model, table: Array) -> dict[int, tuple[int, ...]]:
    """Actions (A, S) of positive probability, by code of the state."""
    return {int(code): tuple(np.flatnonzero(table[:, i] > 0).tolist()) for i, code in enumerate(model.codes)}


def _visits(model: Model, plan: plans.Plan) -> Array:
    total = solve.occupancy(model, plan)
    return np.asarray(total / (total.max() or 1.0))
