"""Overlays on figures: values, policies and occupancies, worked out by exact analysis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from taskspec.abstraction.abstraction import abstraction, extract
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.display import number
from taskspec.exact import Model
from taskspec.figures.states import State
from taskspec.registry import load
from taskspec.solve import plans, solve
from taskspec.solve.backward import Plan
from taskspec.task.task import Task, TaskLike

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
        return action in self.policy.get(code, ())

    def only(self, *parts: str) -> Overlay:
        """Return some parts alone, with the present state."""
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

    Raises:
        SpecError: for another name (E713), without an exact model (E712) or scipy (E705).
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
    known = _Known(task, model or extract(task), wanted)
    shown = PARTS if abstraction(task) is None else ()
    return Overlay(**{part: getattr(known, part) for part in shown}, legend=dict(_legend(task, known)))


def _legend(task: Task, known: _Known) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield for each overlay its name, its scale if it has one, and its description."""
    wanted = known.wanted
    left = ""
    if task.horizon is not None:
        left = f" with all {task.horizon:,} steps to go"
    whose = "an optimal policy's" if task.annotations.expert is None else "the expert's"
    lacks = ""
    if wanted & {"expert", "occupancy"} and known.acting is None:
        lacks = ", for which there is no exact plan"
    if "values" in wanted:
        yield "values", ("", f"best return{left}")
    if "policy" in wanted:
        yield "policy", ("", f"best actions{left}")
    if "expert" in wanted and ("policy" not in wanted or task.annotations.expert is not None):
        memory = "" if task.annotations.memory is None else ", whatever it remembers"
        beside = ""
        if "policy" in wanted and not lacks:
            beside = ", as the best ones are"
        yield "expert" if "policy" in wanted else "policy", ("", f"{whose} actions at first{lacks or memory}{beside}")
    if "occupancy" in wanted:
        scale = f"up to {number(max(known.visits.values(), default=0.0), 4)} per episode"
        yield "occupancy", (scale, f"{whose} {'' if task.discount == 1 else 'discounted '}visits{lacks}")


@dataclass(frozen=True)
class _Known:
    """Results of an exact model for states, by code."""

    task: Task
    model: Model
    wanted: set[str]

    @cached_property
    def values(self) -> Mapping[int, float]:
        if "values" not in self.wanted:
            return {}
        acting = self.model.acting
        values = solve.best(self.model).value[acting]
        return dict(zip(self.model.codes[acting].tolist(), values.tolist(), strict=True))

    @cached_property
    def policy(self) -> Mapping[int, tuple[int, ...]]:
        if "policy" in self.wanted:
            return _policy(self.model, plans.optimal_plan(self.model)(0))
        if "expert" not in self.wanted or self.acting is None:
            return {}
        whole, plan = self.acting
        found: dict[int, set[int]] = {}
        for code, actions in _policy(whole, plan(0)).items():
            found.setdefault(self._without_memory(whole, code), set()).update(actions)
        return {code: tuple(sorted(actions)) for code, actions in found.items()}

    @cached_property
    def visits(self) -> Mapping[int, float]:
        """Expected visits to each state by code, summed over the expert's memory."""
        found: dict[int, float] = {}
        if self.acting is not None:
            whole, plan = self.acting
            for code, often in zip(whole.codes.tolist(), solve.occupancy(whole, plan).tolist(), strict=True):
                code = self._without_memory(whole, code)
                found[code] = found.get(code, 0.0) + often
        return found

    @cached_property
    def occupancy(self) -> Mapping[int, float]:
        if "occupancy" not in self.wanted:
            return {}
        most = max(self.visits.values(), default=0.0) or 1.0
        return {code: often / most for code, often in self.visits.items()}

    @cached_property
    def acting(self) -> tuple[Model, Plan] | None:
        """The plan of the expert, or of an optimal policy if there is none, and its model.

        They are those of the task with the memory of an expert that has one. None where the expert has no plan on a model.
        """
        if self.task.annotations.expert is None:
            return self.model, plans.optimal_plan(self.model)
        try:
            whole = self.model
            if self.task.annotations.memory is not None:
                whole = extract(self.task.remembering())
        except SpecError:  # too many states with the memory
            return None
        plan = plans.expert_plan(whole)
        if plan is None:
            return None
        return (whole, plan)

    def _without_memory(self, whole: Model, code: int) -> int:
        """Return the code of a state without what is remembered there, whose digits are the last ones."""
        return code // (whole.states.size // self.model.states.size)


def _policy(model: Model, table: Array) -> dict[int, tuple[int, ...]]:
    """Return actions (A, S) of positive probability, by code of the states in which some episode acts."""
    return {int(model.codes[i]): tuple(np.flatnonzero(table[:, i] > 0).tolist()) for i in np.flatnonzero(model.acting)}
