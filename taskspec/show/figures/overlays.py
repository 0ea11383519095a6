"""Overlays on figures: values, policies and occupancies, worked out by exact analysis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.display import number
from taskspec.exact import Model
from taskspec.exact.abstraction.abstraction import abstraction, extract
from taskspec.exact.model.extract import lasting
from taskspec.exact.solve import plans, solve
from taskspec.exact.solve.backward import Plan
from taskspec.language.registry import load
from taskspec.language.task.task import Task, TaskLike
from taskspec.show.figures.states import State

PARTS = ("values", "policy", "occupancy")
OVERLAYS = ("values", "policy", "expert", "occupancy")
"""The names of overlays."""


@dataclass(frozen=True)
class Overlay:
    """Results by code of the state (`model.space.Space` of the state's components).

    `values` are written beside states; `policy` gives the indices of the actions taken, whose
    transitions stand out; `occupancy` in [0, 1] shades the states that are visited. `legend` gives the scale of each of
    them and says what it is; how it is drawn, a figure knows.
    """

    values: Mapping[int, float] = field(default_factory=dict)
    policy: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    occupancy: Mapping[int, float] = field(default_factory=dict)
    legend: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    here: State | None = None  # the present state, for a frame of an episode
    seen: Mapping[int, State] = field(default_factory=dict)  # states of that episode by time, the present one included

    def chosen(self, code: int, action: int) -> bool:
        """Test whether an action is taken.

        Args:
            code: of the state.
            action: its index.

        Returns:
            False also where nothing is known of the state.
        """
        return action in self.policy.get(code, ())

    def only(self, *parts: str) -> Overlay:
        """Leave out all but some parts.

        Args:
            parts: names of `values`, `policy`, `occupancy` and `legend`.

        Returns:
            These, with the present state.
        """
        return Overlay(here=self.here, seen=self.seen, **{part: getattr(self, part) for part in parts})


def overlay(task: TaskLike, names: Iterable[str], model: Model | None = None) -> Overlay:
    """Return the overlays of a task's figure.

    Args:
        task: one that has an exact model. Of an abstraction nothing is drawn, as its states are not those of the figure.
        names: of `values` (optimal, with the whole horizon left), `policy` (all optimal actions) or
            `expert` (its actions), and `occupancy` (of the expert where there is one, else of an
            optimal policy; the most visited state is 1). Values and actions are those of states in which
            some episode acts.
        model: that of the task, where it is known already.

    Returns:
        Values, actions and visits by code of a state; those that were not asked for are empty.

    Raises:
        SpecError: for another name (E713), or without an exact model (E712).
    """
    wanted = set(names)
    for unknown in sorted(wanted - set(OVERLAYS)):
        raise spec_error("E713", f"'{unknown}' is not an overlay", f"use {', '.join(OVERLAYS)}")
    if not wanted:
        return Overlay()
    task = load(task)
    if task.modifiers:
        message = "a figure shows a task without its modifiers, and results with them cannot be laid over it"
        raise spec_error("E713", message)
    model = lasting(model or extract(task))
    acting = None
    if wanted & {"expert", "occupancy"}:
        acting = _acting(task, model)
    visits = {}
    if acting is not None and "occupancy" in wanted:
        visits = _visits(model, *acting)
    most = max(visits.values(), default=0.0)
    parts: dict[str, Any] = {}
    if "values" in wanted:
        values = solve.best(model).value[model.acting]
        parts["values"] = dict(zip(model.codes[model.acting].tolist(), values.tolist(), strict=True))
    if "policy" in wanted:
        parts["policy"] = _policy(model, plans.optimal_plan(model)(0))
    elif "expert" in wanted and acting is not None:
        parts["policy"] = _expert_policy(model, *acting)
    parts["occupancy"] = {code: often / (most or 1.0) for code, often in visits.items()}
    if abstraction(task) is not None:
        parts = {}
    return Overlay(**parts, legend=dict(_legend(task, wanted, acting is not None, most)))


def _legend(task: Task, wanted: set[str], acts: bool, most: float) -> Iterator[tuple[str, tuple[str, str]]]:
    left = ""
    if task.horizon is not None:
        left = f" with all {task.horizon:,} steps to go"
    whose = "an optimal policy's" if task.annotations.expert is None else "the expert's"
    lacks = ""
    if wanted & {"expert", "occupancy"} and not acts:
        lacks = ", for which there is no exact plan"
    if "values" in wanted:
        yield "values", ("", f"best return{left}")
    if "policy" in wanted:
        yield "policy", ("", f"best actions{left}")
    if "expert" in wanted and ("policy" not in wanted or task.annotations.expert is not None):
        memory = ", whatever it remembers" * (task.annotations.memory is not None)
        part = "policy"
        beside = ""
        if "policy" in wanted:
            part = "expert"
            beside = ", as the best ones are" * (not lacks)
        yield part, ("", f"{whose} actions at first{lacks or memory}{beside}")
    if "occupancy" in wanted:
        scale = f"up to {number(most, 4)} per episode"
        yield "occupancy", (scale, f"{whose} {'discounted ' * (task.discount != 1)}visits{lacks}")


def _acting(task: Task, model: Model) -> tuple[Model, Plan] | None:
    """Return the plan of the expert, or of an optimal policy without one, and its model, with the memory of the expert.

    None where the expert has no plan on a model.
    """
    if task.annotations.expert is None:
        return model, plans.optimal_plan(model)
    try:
        whole = model
        if task.annotations.memory is not None:
            whole = lasting(extract(task.remembering()))
    except SpecError:  # too many states with the memory
        return None
    plan = plans.expert_plan(whole)
    if plan is None:
        return None
    return (whole, plan)


def _expert_policy(model: Model, whole: Model, plan: Plan) -> dict[int, tuple[int, ...]]:
    by_code: dict[int, set[int]] = {}
    for code, actions in _policy(whole, plan(0)).items():
        by_code.setdefault(_without_memory(model, whole, code), set()).update(actions)
    return {code: tuple(sorted(actions)) for code, actions in by_code.items()}


def _visits(model: Model, whole: Model, plan: Plan) -> dict[int, float]:
    visits: dict[int, float] = {}
    for code, often in zip(whole.codes.tolist(), solve.occupancy(whole, plan).tolist(), strict=True):
        code = _without_memory(model, whole, code)
        visits[code] = visits.get(code, 0.0) + often
    return visits


def _without_memory(model: Model, whole: Model, code: int) -> int:
    return code // (whole.states.size // model.states.size)


def _policy(model: Model, table: Array) -> dict[int, tuple[int, ...]]:
    policy = {}
    for i in np.flatnonzero(model.acting):
        policy[int(model.codes[i])] = tuple(np.flatnonzero(table[:, i] > 0).tolist())
    return policy
