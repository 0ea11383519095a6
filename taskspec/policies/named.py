"""Policies by name. Every command that takes a policy takes these names."""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from functools import cached_property
from typing import NoReturn

import numpy as np

from taskspec import draws
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import suggest
from taskspec.base.extras import is_installed
from taskspec.lang.ir import Role
from taskspec.lang.types import Kind
from taskspec.lang.variates import WordLayout
from taskspec.model.model import Model, misused, refuse
from taskspec.policies.policy import Actions, EpisodeBatch, Tabulated, TaskPolicy, drawn
from taskspec.rollout.rollout import State, expert_actions
from taskspec.scores.returns import Given, Results, Return
from taskspec.solve import solve
from taskspec.solve.backward import Plan, rule_of
from taskspec.solve.plans import tables, uniform_plan
from taskspec.task.task import Component, Soft, Task

NAMES = {
    "random": "uniform over the action space",
    "expert": "the spec's own",
    "optimal": "one of the best actions, planned on the exact model",
    "soft(1)": "Boltzmann-rational at an inverse temperature, planned on the exact model",
    "epsilon(0.1)": "the expert, or the optimal policy without one, but random with a probability",
}
"""The names of policies, each with what it is; the numbers stand for any."""
_CALL = re.compile(r"(\w+)\((.+)\)")


class NamedPolicy(TaskPolicy):
    """A policy that knows the state; its actions are a function of the state, the time and random words.

    Attributes:
        words: the number of random words for one step.
    """

    words: int
    given: Given = None

    @abstractmethod
    def by_words(self, states: State, t: int, words: Array) -> Actions:
        """Return actions by component.

        Args:
            states: by component, (*shape, N).
            t: the number of steps so far.
            words: uint32 (words, N).
        """

    def choose(self, batch: EpisodeBatch) -> Actions:
        return self.by_words(batch.states, batch.t, batch.draws.words(self.words))

    def plan(self, model: Model) -> Plan:
        """Return its probabilities of actions (A, S) at each time on an exact model of its task.

        Raises:
            SpecError: E712, where they are unknown.
        """
        rule = rule_of(model, self.given)
        if rule is None:
            refuse(
                f"the policy '{self.name}' of {model.task.id} remembers, or draws from too many outcomes: it has no table"
            )
        return tables(model, rule)

    def tabulate(self, model: Model) -> Tabulated:
        return Tabulated(self.plan(model), "probabilities")

    @cached_property
    def results(self) -> Results:
        """Exact results of its task, with this policy in place of the expert."""
        return Results(self.task, expert=self.given)

    @cached_property
    def value(self) -> Return | None:
        return _exact_return(self.results, "expert")


def named(task: Task, name: str) -> NamedPolicy:
    """Return the policy of a name.

    Raises:
        SpecError: E712, where an exact model is needed and there is none; E713 for an unknown name, or one that this task does
            not have.
    """
    given = planned(name)
    if given is not None:
        return PlannedPolicy(task, name, given)
    match _parsed(name):
        case ("random", None):
            return RandomPolicy(task)
        case ("expert", None):
            return _expert(task)
        case ("epsilon", float(epsilon)) if 0 <= epsilon <= 1:
            return EpsilonPolicy(task, name, epsilon)
    unknown(name)


def planned(name: str) -> Given:
    """Return the policy planned on the exact model under a name, "optimal" or "soft(1)"; None for other names."""
    match _parsed(name):
        case ("optimal", None):
            return "optimal"
        case ("soft", float(beta)) if math.isfinite(beta):
            return Soft(beta)
    return None


def is_name(name: str) -> bool:
    """Return whether a policy of this kind exists, whatever its number."""
    return name.partition("(")[0] in {known.partition("(")[0] for known in NAMES}


def unknown(name: str, others: tuple[str, ...] = ()) -> NoReturn:
    """Raise E713 for an unknown name; `others` are further policies that a command takes, in words."""
    kinds = {known.partition("(")[0]: known for known in NAMES}
    kind = name.partition("(")[0]
    hint = f"for example: {kinds[kind]}" if kind in kinds else suggest(kind, kinds)
    misused(f"there is no policy '{name}'", hint or ", ".join((*NAMES, *others)))


def _parsed(name: str) -> tuple[str, float | None]:
    """Return the kind of a name and its number; None where it has none."""
    found = _CALL.fullmatch(name)
    try:
        return (found[1], float(found[2])) if found else (name, None)
    except ValueError:
        return name, None


def _expert(task: Task) -> NamedPolicy:
    if task.expert is None:
        misused(
            f"{task.id} gives no expert",
            "an `expert:` section says how it acts; `optimal` is planned on the exact model",
        )
    return ExpressedExpert(task) if isinstance(task.expert, tuple) else PlannedPolicy(task, "expert", None)


# -- kinds ------------------------------------------------------------------------------------------------------------


class RandomPolicy(NamedPolicy):
    """Uniformly random actions."""

    name = "random"

    def __init__(self, task: Task) -> None:
        unbounded = [c.name for c in task.action if not all(map(math.isfinite, (*c.low, *c.high)))]
        if unbounded:
            misused(f"random actions need a bounded range, which '{unbounded[0]}' has not", "give it `low` and `high`")
        self.task = task
        self.words = sum(c.type.size for c in task.action)

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        found = {}
        first = 0
        for c in self.task.action:
            found[c.name] = _uniform(c, words[first : first + c.type.size])
            first += c.type.size
        return found

    def plan(self, model: Model) -> Plan:
        return uniform_plan(model)

    @cached_property
    def value(self) -> Return | None:
        return _exact_return(self.results, "random")


def _uniform(c: Component, words: Array) -> Array:
    """Return uniform values of a component, (*shape, N), from one word for each number."""
    low, high = (np.array(ends)[:, None] for ends in (c.low, c.high))
    if c.is_finite:
        values = low.astype(np.int64) + draws.indices(words, (high - low + 1).astype(np.int64))
    else:
        values = low + (high - low) * draws.uniforms(words).astype(np.float64)
    kind = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}[c.type.kind]
    return values.astype(kind).reshape(*c.type.shape, words.shape[-1])


class ExpressedExpert(NamedPolicy):
    """An expert given by expressions over the state and the time."""

    name = "expert"

    def __init__(self, task: Task) -> None:
        assert isinstance(task.expert, tuple)
        self.task = task.remembering()
        self.layout = WordLayout.of(task.expert)
        self.words = self.layout.count

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        return expert_actions(self.task, states, t, self.layout, words)


class PlannedPolicy(NamedPolicy):
    """A policy planned on the exact model of the task or of its abstraction."""

    words = 1

    def __init__(self, task: Task, name: str, given: Given) -> None:
        self.name = name
        self.task = task
        self.given = given
        plan = self.results.expert_plan
        if plan is None:
            refuse(
                f"the policy '{name}' is planned on the exact model of {task.id}, which does not exist: {self.results.why_not}",
                self.results.remedy,
            )
        self._plan = plan

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        return decoded(self.results, drawn(probabilities_of(self.results, self._plan, states, t), words[0] * 2.0**-32))


class EpsilonPolicy(NamedPolicy):
    """The expert (or the optimal policy, if the spec gives none) with random actions at probability epsilon."""

    def __init__(self, task: Task, name: str, epsilon: float) -> None:
        self.name = name
        self.epsilon = epsilon
        self.given = "optimal" if task.expert is None else None
        self.base = named(task, self.given or "expert")
        self.task = self.base.task
        self.random = RandomPolicy(task)
        self.words = 1 + self.base.words + self.random.words

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        is_random = words[0] * 2.0**-32 < self.epsilon
        base = self.base.by_words(states, t, words[1 : 1 + self.base.words])
        random = self.random.by_words(states, t, words[1 + self.base.words :])
        return {name: np.where(is_random, random[name], base[name]) for name in base}

    def plan(self, model: Model) -> Plan:
        base = self.base.plan(model)
        uniform = self.epsilon / model.n_actions
        return lambda t: (1 - self.epsilon) * base(t) + uniform

    @cached_property
    def value(self) -> Return | None:
        if _exact_return(self.results, "expert") is None:
            return None
        model = self.results.model  # of the task with the expert's memory, where it has one
        assert model is not None
        return Return(solve.policy_return(model, self.plan(model)), tested=self.results.tested("expert"))


# -- on the exact model -----------------------------------------------------------------------------------------------


def probabilities_of(results: Results, plan: Plan, states: State, t: int) -> Array:
    """Return the probabilities (A, N) of a plan on the model of some results, in states of their task, (*shape, N)."""
    model = results.model
    assert model is not None
    known = states if results.abstraction is None else results.abstraction.map(states)
    return plan(t)[:, model.state_indices(known, next(iter(states.values())).shape[-1])]


def decoded(results: Results, indices: Array) -> Actions:
    """Return the actions by component of indices (N,) in the model of some results."""
    assert results.model is not None
    values = results.model.actions.decode(indices)
    return {name: value for (role, name), value in values.items() if role is Role.ACTION}


def _exact_return(results: Results, which: str) -> Return | None:
    """Return a return computed from the exact model; None without a model, and without SciPy, which models need."""
    if not is_installed("scipy") or results.model is None or results.enclosure(which) is None:
        return None
    return results.expert if which == "expert" else results.random
