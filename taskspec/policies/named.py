"""Policies by name: what they do in many states at once, and what they earn.

Every command that takes a policy takes these names. What a policy draws is a function of random words that whoever asks it
gives: the same words, the same actions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn, Protocol

import numpy as np

from taskspec import draws
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import suggest
from taskspec.base.extras import is_installed
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.lang.variates.sample import WordLayout, batch_sampler
from taskspec.model.model import Model, misused, refuse
from taskspec.rollout.rollout import State, reads_of
from taskspec.scores.returns import Given, Results, Return
from taskspec.solve import solve
from taskspec.solve.plans import Plan, rule_of, tables, uniform_plan
from taskspec.task.task import Component, Soft, Task

Actions = Mapping[str, Array]
"""Actions by component, (*shape, N)."""

NAMES = {
    "random": "uniform over the action space",
    "expert": "the spec's own",
    "optimal": "one of the best actions, planned on the exact model",
    "soft(1)": "Boltzmann-rational at an inverse temperature, planned on the exact model",
    "epsilon(0.1)": "the expert, or the optimal policy without one, but random with a probability",
}
"""The names of policies, each with what it is; the numbers stand for any."""
_CALL = re.compile(r"(\w+)\((.+)\)")


class Named(Protocol):
    """A policy that knows the state.

    Attributes:
        name: what it is called.
        task: the task whose state it knows: that which it was asked for, with the expert's memory in its state where the policy
            has one (`Task.remembering`).
        words: how many random words it takes for a step.
    """

    name: str
    task: Task
    words: int

    def act(self, state: State, t: int, words: Array) -> Actions:
        """What it does.

        Args:
            state: components by name, (*shape, N).
            t: the steps taken so far in each of the N episodes.
            words: uint32 (words, N), fresh for each of them.
        """
        ...

    def plan(self, model: Model) -> Plan:
        """What it does in the states of an exact model of its task: probabilities (A, S) at each time.

        Raises:
            SpecError: E712, where that is not known.
        """
        ...

    @property
    def value(self) -> Return | None:
        """Its expected return, computed from the exact model; None where there is none."""
        ...


def named(task: Task, name: str) -> Named:
    """The policy of a name.

    Raises:
        SpecError: E712, where an exact model is needed and there is none; E713 for a name that is none, or that this task does
            not have.
    """
    given = planned(name)
    if given is not None:
        return _Planned(task, name, given)
    match _read(name):
        case ("random", None):
            return _Random(task)
        case ("expert", None):
            return _expert(task)
        case ("epsilon", float(chance)) if 0 <= chance <= 1:
            return _Epsilon(task, name, chance)
    unknown(name)


def planned(name: str) -> Given:
    """What is planned on the exact model under a name, "optimal" or "soft(1)"; None for other names."""
    match _read(name):
        case ("optimal", None):
            return "optimal"
        case ("soft", float(beta)) if math.isfinite(beta):
            return Soft(beta)
    return None


def unknown(name: str, others: tuple[str, ...] = ()) -> NoReturn:
    """Refuse (E713) a name; `others` are what a command takes besides, in words."""
    called = {known.partition("(")[0]: known for known in NAMES}
    kind = name.partition("(")[0]
    hint = f"for example: {called[kind]}" if kind in called else suggest(kind, called)
    misused(f"there is no policy '{name}'", hint or ", ".join((*NAMES, *others)))


def _read(name: str) -> tuple[str, float | None]:
    """A name of a policy, and its number, None where it has none."""
    found = _CALL.fullmatch(name)
    try:
        return (found[1], float(found[2])) if found else (name, None)
    except ValueError:
        return name, None


# -- kinds --------------------------------------------------------------------------------------------------------


class _Random:
    """Uniformly random actions."""

    name = "random"

    def __init__(self, task: Task) -> None:
        open_ended = [c.name for c in task.action if not all(map(math.isfinite, (*c.low, *c.high)))]
        if open_ended:
            misused(
                f"random actions need a bounded range, which '{open_ended[0]}' has not",
                "give it `low` and `high`",
            )
        self.task, self.words = task, sum(c.type.size for c in task.action)

    def act(self, state: State, t: int, words: Array) -> Actions:
        found, first = {}, 0
        for c in self.task.action:
            found[c.name] = _uniform(c, words[first : first + c.type.size])
            first += c.type.size
        return found

    def plan(self, model: Model) -> Plan:
        return uniform_plan(model)

    @cached_property
    def value(self) -> Return | None:
        return _computed(Results(self.task), "random")


def _uniform(c: Component, words: Array) -> Array:
    """Uniform values of a component, (*shape, N), from a word for each number."""
    low, high = (np.array(ends)[:, None] for ends in (c.low, c.high))
    if c.is_finite:
        values = low.astype(np.int64) + draws.indices(words, (high - low + 1).astype(np.int64))
    else:
        values = low + (high - low) * draws.uniforms(words).astype(np.float64)
    kind = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}[c.type.kind]
    return values.astype(kind).reshape(*c.type.shape, words.shape[-1])


def _expert(task: Task) -> Named:
    """The expert that the spec gives."""
    if task.expert is None:
        misused(
            f"{task.id} gives no expert",
            "an `expert:` section says how it acts; `optimal` is planned on the exact model",
        )
    return _Expressed(task) if isinstance(task.expert, tuple) else _Planned(task, "expert", None)


class _Expressed:
    """An expert given by expressions over the state and the time."""

    name = "expert"

    def __init__(self, task: Task) -> None:
        assert isinstance(task.expert, tuple)
        self.task, self.nodes, self.layout = task.remembering(), task.expert, WordLayout.of(task.expert)
        self.words = self.layout.count

    def act(self, state: State, t: int, words: Array) -> Actions:
        lanes = words.shape[-1]
        values = evaluate(self.nodes, reads_of(state, {}, t), batch_sampler(self.layout, words))
        return {
            c.name: np.broadcast_to(v, (*v.shape[:-1], lanes)) for c, v in zip(self.task.action, values, strict=True)
        }

    def plan(self, model: Model) -> Plan:
        return _plan_of(model, self.name, None)

    @cached_property
    def value(self) -> Return | None:
        return _computed(Results(self.task), "expert")


class _Planned:
    """A plan on the exact model, or on that of the abstraction."""

    words = 1

    def __init__(self, task: Task, name: str, given: Given) -> None:
        self.name, self.task, self.results = name, task, Results(task, expert=given)
        self.lookup = _Lookup(self.results, name)
        if self.results.expert_plan is None:
            _needs_model(name, self.results)
        self.given, self.chances = given, self.results.expert_plan

    def plan(self, model: Model) -> Plan:
        return _plan_of(model, self.name, self.given)

    def act(self, state: State, t: int, words: Array) -> Actions:
        model = self.lookup.model
        rising = np.cumsum(self.chances(t)[:, self.lookup.indices(state)], axis=0)
        drawn = words[0] * 2.0**-32 * rising[-1]
        return self.lookup.actions(np.minimum((rising <= drawn).sum(axis=0), model.n_actions - 1))

    @cached_property
    def value(self) -> Return | None:
        return _computed(self.results, "expert")


class _Epsilon:
    """The expert, or the optimum where the spec gives none, but uniformly random with a probability at every step."""

    def __init__(self, task: Task, name: str, chance: float) -> None:
        self.name, self.chance = name, chance
        self.base = named(task, "optimal" if task.expert is None else "expert")
        self.task = self.base.task
        self.stray = _Random(task)
        self.words = 1 + self.base.words + self.stray.words

    def act(self, state: State, t: int, words: Array) -> Actions:
        strays = words[0] * 2.0**-32 < self.chance
        base = self.base.act(state, t, words[1 : 1 + self.base.words])
        stray = self.stray.act(state, t, words[1 + self.base.words :])
        return {name: np.where(strays, stray[name], base[name]) for name in base}

    def plan(self, model: Model) -> Plan:
        base, even = self.base.plan(model), self.chance / model.n_actions
        return lambda t: (1 - self.chance) * base(t) + even

    @cached_property
    def value(self) -> Return | None:
        results = Results(self.task, expert="optimal" if self.task.expert is None else None)
        if _computed(results, "expert") is None:
            return None
        model = results.model  # of the task with the expert's memory, where it has one
        assert model is not None
        return Return(solve.policy_return(model, self.plan(model)), tested=results.tested("expert"))


# -- on the model -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Lookup:
    """Where states of the task are in the exact model, and what its actions are."""

    results: Results
    name: str

    @property
    def model(self) -> Model:
        found = self.results.model
        return _needs_model(self.name, self.results) if found is None else found

    def indices(self, state: State) -> Array:
        """The states' indices in the model, (N,)."""
        stand_in, model = self.results.abstraction, self.model
        known = state if stand_in is None else stand_in.map(state)
        return model.state_indices(known, next(iter(state.values())).shape[-1])

    def actions(self, indices: Array) -> Actions:
        """The model's actions of these indices (N,), by component."""
        return {
            name: value for (role, name), value in self.model.actions.decode(indices).items() if role is Role.ACTION
        }


def _plan_of(model: Model, name: str, given: Given) -> Plan:
    """The tables of an expert on a model."""
    rule = rule_of(model, given)
    if rule is None:
        refuse(f"the policy '{name}' of {model.task.id} remembers, or draws from too many outcomes: it has no table")
    return tables(model, rule)


def _needs_model(name: str, results: Results) -> NoReturn:
    refuse(
        f"the policy '{name}' is planned on the exact model of {results.task.id}, which does not exist: {results.why_not}",
        results.remedy,
    )


def _computed(results: Results, which: str) -> Return | None:
    """A return from the exact model; None where it would have to be simulated, or SciPy is missing, which exact models need."""
    if not is_installed("scipy") or results.model is None or results.enclosure(which) is None:
        return None
    return results.expert if which == "expert" else results.random
