"""The protocol of policies, and policies by name. Every command that takes a policy takes these names."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NoReturn

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import suggest
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.rollout.rollout import State, expert_actions
from taskspec.exact.scores.returns import Given, Results, Return
from taskspec.exact.solve import solve
from taskspec.exact.solve.backward import Plan, rule_of
from taskspec.exact.solve.plans import tables, uniform_plan
from taskspec.language import draws
from taskspec.language.expressions.types import Kind, Role, total_size
from taskspec.language.expressions.variates import WordLayout
from taskspec.language.task.legal import choices, legal_at_random
from taskspec.language.task.parts import Soft
from taskspec.language.task.spaces import SpaceLayout, pack_many
from taskspec.language.task.task import Task

Actions = Mapping[str, Array]
"""Actions by component, (*shape, N)."""
Asking = Literal["probabilities", "actions", "samples"]
"""The basis of a policy's value: its probabilities of actions, its actions if they never vary, or simulated episodes."""
TIE = 1e-9
"""Values of actions this close, as a share of the largest, are tied."""


@dataclass(frozen=True)
class SeededDraws:
    """Randomness that depends only on each episode's seed, uint64 (N,), and the step."""

    seeds: Array
    t: int

    def words(self, count: int) -> Array:
        return draws.lanes_block(self.seeds, draws.POLICY, self.t, count)

    def generator(self, lane: int) -> np.random.Generator:
        return np.random.Generator(np.random.Philox(key=[int(self.seeds[lane]), self.t]))


@dataclass(frozen=True)
class SharedDraws:
    """Randomness from one generator for all episodes."""

    rng: np.random.Generator
    lanes: int

    def words(self, count: int) -> Array:
        return self.rng.integers(0, 2**32, (count, self.lanes)).astype(np.uint32)

    def generator(self, lane: int) -> np.random.Generator:
        return self.rng


@dataclass(frozen=True)
class EpisodeBatch:
    """N episodes after the same number of steps.

    Attributes:
        t: the number of steps.
        states: by component, (*shape, N).
        observations: (N, *shape), a dict of them for a dict space; None for policies that do not use them.
        draws: the random numbers of this step.
        running: bool (N,), False for episodes that have ended.
    """

    t: int
    states: State
    observations: Any
    draws: SeededDraws | SharedDraws
    running: Array

    @classmethod
    def sharing(cls, t: int, states: State, observations: Any, rng: np.random.Generator) -> EpisodeBatch:
        """Return a batch of running episodes that share one generator."""
        lanes = next(iter(states.values())).shape[-1]
        return cls(t, states, observations, SharedDraws(rng, lanes), np.ones(lanes, np.bool_))


@dataclass(frozen=True, slots=True)
class Tabulated:
    """A policy on an exact model: probabilities of actions at each time, and what they rest on."""

    plan: Plan
    asked: Asking


def legal_rows(task: Task, states: State) -> Array | None:
    """Return which actions may be chosen in states by component, bool (N, A); None where all are legal, or states are unknown."""
    if not task.mask or not states:
        return None
    return choices(task, states).T


class TaskPolicy(ABC):
    """A policy of a task.

    Attributes:
        name: for messages and metadata.
        task: the task in which it acts; for an expert with memory, the task whose state includes the memory.
    """

    name: str
    task: Task

    @cached_property
    def actions(self) -> SpaceLayout:
        """The format of actions in the environment."""
        return self.task.action_layout

    @property
    def value(self) -> Return | None:
        """The expected return computed from an exact model; None where there is none."""
        return None

    @abstractmethod
    def choose(self, batch: EpisodeBatch) -> Actions:
        """Return actions by component."""

    def act(self, batch: EpisodeBatch) -> Any:
        """Return actions (N, *shape), in the format of the environment."""
        actions = self.choose(batch)
        values = [np.asarray(actions[c.name]) for c in self.task.action]
        return pack_many(self.actions, [value.reshape(-1, value.shape[-1]).T for value in values])

    def tabulate(self, model: Model) -> Tabulated | None:
        """Return its probabilities of actions on an exact model of its task; None where they are unknown."""
        return None


def drawn(probabilities: Array, uniform: Array) -> Array:
    """Return the indices int64 (N,) of actions drawn from probabilities (A, N), by uniform numbers (N,) in [0, 1)."""
    rising = np.cumsum(probabilities, axis=0)
    return np.minimum((rising <= uniform * rising[-1]).sum(axis=0), len(rising) - 1)


def greedy(values: Array, legal: Array | None = None) -> Array:
    """Return the probabilities (..., A) of the greedy policy of values (..., A), uniform over tied actions that are `legal`."""
    if legal is not None:
        values = np.where(legal, values, -np.inf)
    best = best_actions(values)
    return best / best.sum(axis=-1, keepdims=True)


def best_actions(values: Array) -> Array:
    """Return which actions, bool (..., A), have the largest of values (..., A), ties within rounding included."""
    high = values.max(axis=-1, keepdims=True)
    return np.asarray(values >= high - TIE * np.maximum(np.abs(high), 1))


def observation_of(observations: Any, lane: int) -> Any:
    """Return the observation (or action) of one lane in the format of the scalar environment."""
    if isinstance(observations, dict):
        return {name: observation_of(part, lane) for name, part in observations.items()}
    if observations.ndim > 1:
        return observations[lane].copy()
    return observations[lane].item()


def states_of(model: Model) -> State:
    """Return all states of a model by component, (*shape, S)."""
    return {name: value for (role, name), value in model.reads().items() if role is Role.STATE}


# -- policies by name -------------------------------------------------------------------------------------------------

NAMES = {
    "random": "uniform over the action space, or over the legal actions",
    "expert": "the spec's own",
    "optimal": "one of the best actions, planned on the exact model",
    "soft(1)": "Boltzmann-rational at an inverse temperature, planned on the exact model",
    "epsilon(0.1)": "the expert, or the optimal policy without one, but random with a probability",
}
"""The names of policies, with their meanings; the numbers stand for any."""
KINDS = {known.partition("(")[0]: known for known in NAMES}
_CALL = re.compile(r"(\w+)\((.+)\)")


def named(task: Task, name: str) -> NamedPolicy:
    """Return the policy of a name."""
    given = planned(name)
    if given is not None:
        return PlannedPolicy(task, name, given)
    match parsed(name):
        case ("random", None):
            return RandomPolicy(task)
        case ("expert", None):
            if task.annotations.expert is None:
                hint = "an `expert:` section says how it acts; `optimal` is planned on the exact model"
                misused(f"{task.id} gives no expert", hint)
            if isinstance(task.annotations.expert, tuple):
                return ExpressedExpert(task)
            return PlannedPolicy(task, "expert", None)
        case ("epsilon", float(epsilon)) if 0 <= epsilon <= 1:
            return EpsilonPolicy(task, name, epsilon)
    unknown(name)


def planned(name: str) -> Given:
    """Return the policy planned on the exact model under a name, "optimal" or "soft(1)"; None for other names."""
    match parsed(name):
        case ("optimal", None):
            return "optimal"
        case ("soft", float(beta)) if math.isfinite(beta):
            return Soft(beta)
    return None


def is_name(name: str) -> bool:
    """Return whether a policy of this kind exists, with any number."""
    return name.partition("(")[0] in KINDS


def unknown(name: str, others: tuple[str, ...] = (), known: Iterable[str] = NAMES, noun: str = "policy") -> NoReturn:
    """Raise E713 for a name that is not known; `others` are further policies that a command takes, in words."""
    kinds = {each.partition("(")[0]: each for each in known}
    kind = name.partition("(")[0]
    hint = f"for example: {kinds[kind]}" if kind in kinds else suggest(kind, kinds)
    misused(f"there is no {noun} '{name}'", hint or ", ".join((*known, *others)))


def parsed(name: str) -> tuple[str, float | None]:
    """Return the kind of a name and its number; None where it has none."""
    match = _CALL.fullmatch(name)
    try:
        if match:
            return (match[1], float(match[2]))
        return (name, None)
    except ValueError:
        return name, None


class NamedPolicy(TaskPolicy):
    """A policy that knows the state; its actions are a function of the state, the time and random words.

    Attributes:
        words: the number of random words for one step.
        which: the name of its return in `Results`.
    """

    words: int
    given: Given = None
    which = "expert"

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
        """Return its probabilities of actions (A, S) at each time on an exact model of its task."""
        rule = rule_of(model, self.given)
        if rule is None:
            problem = "remembers, or draws from too many outcomes: it has no table"
            refuse(f"the policy '{self.name}' of {model.task.id} {problem}")
        return tables(model, rule)

    def tabulate(self, model: Model) -> Tabulated:
        return Tabulated(self.plan(model), "probabilities")

    @cached_property
    def results(self) -> Results:
        """Exact results of its task, with this policy in place of the expert."""
        return Results(self.task, expert=self.given)

    @cached_property
    def value(self) -> Return | None:
        results = self.results
        if results.model is None or results.enclosure(self.which) is None:
            return None
        if self.which == "expert":
            return results.expert
        return results.random


class RandomPolicy(NamedPolicy):
    """Uniformly random actions."""

    name = "random"
    which = "random"

    def __init__(self, task: Task) -> None:
        for c in task.action:
            if not all(map(math.isfinite, (*c.low, *c.high))):
                misused(f"random actions need a bounded range, which '{c.name}' has not", "give it `low` and `high`")
        self.task = task
        self.words = total_size(task.action)

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        """Return uniform actions, from one word for each number; only legal ones, where the task tells them apart."""
        actions: dict[str, Array] = {}
        if self.task.mask:
            return legal_at_random(self.task, states, words[0])
        first = 0
        for c in self.task.action:
            own = words[first : first + c.type.size]
            first += c.type.size
            low = np.array(c.low)[:, None]
            high = np.array(c.high)[:, None]
            if c.is_finite:
                values = low.astype(np.int64) + draws.indices(own, (high - low + 1).astype(np.int64))
            else:
                values = low + (high - low) * draws.uniforms(own).astype(np.float64)
            kind = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}[c.type.kind]
            actions[c.name] = values.astype(kind).reshape(*c.type.shape, words.shape[-1])
        return actions

    def plan(self, model: Model) -> Plan:
        return uniform_plan(model)


class ExpressedExpert(NamedPolicy):
    """An expert given by expressions over the state and the time."""

    name = "expert"

    def __init__(self, task: Task) -> None:
        assert isinstance(task.annotations.expert, tuple)
        self.task = task.remembering()
        self.layout = WordLayout.of(task.annotations.expert)
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
            problem = f"is planned on the exact model of {task.id}, which does not exist: {self.results.why_not}"
            refuse(f"the policy '{name}' {problem}", self.results.remedy)
        self._plan = plan

    def by_words(self, states: State, t: int, words: Array) -> Actions:
        return decoded(self.results, drawn(probabilities_of(self.results, self._plan, states, t), words[0] * 2.0**-32))


class EpsilonPolicy(NamedPolicy):
    """The expert (or the optimal policy, if the spec gives none) with random actions at probability epsilon."""

    def __init__(self, task: Task, name: str, epsilon: float) -> None:
        self.name = name
        self.epsilon = epsilon
        if task.annotations.expert is None:
            self.given = "optimal"
        else:
            self.given = None
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
        return lambda t: (1 - self.epsilon) * base(t) + self.epsilon * model.uniform

    @cached_property
    def value(self) -> Return | None:
        if self.base.value is None:
            return None
        model = self.results.model  # of the task with the expert's memory, where it has one
        assert model is not None
        return Return(solve.policy_return(model, self.plan(model)))


def probabilities_of(results: Results, plan: Plan, states: State, t: int) -> Array:
    """Return the probabilities (A, N) of a plan on the model of some results, in states of their task, (*shape, N)."""
    model = results.model
    assert model is not None
    lanes = next(iter(states.values())).shape[-1]
    if results.abstraction is not None:
        states = results.abstraction.map(states)
    return plan(t)[:, model.state_indices(states, lanes)]


def decoded(results: Results, indices: Array) -> Actions:
    """Return the actions by component of indices (N,) in the model of some results."""
    assert results.model is not None
    values = results.model.actions.decode(indices)
    return {name: value for (_, name), value in values.items()}
