"""Policies as they act in many episodes at once: those with a name, functions of the observation, objects with `predict`."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from taskspec import draws
from taskspec.backends.buffers import Values
from taskspec.backends.numpy.engine import write
from taskspec.data.functions import function_of, is_function
from taskspec.exact.scoring.named import Named, named, unknown
from taskspec.exact.scoring.returns import Return
from taskspec.exact.simulation.rollout import State
from taskspec.task.spaces import SpaceLayout, action_layout
from taskspec.task.task import Task

Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Now:
    """What N episodes are at, all of them after as many steps.

    `seeds` uint64 (N,); `running` bool (N,), those that have not ended; `seen` the observations, lanes first; `state` by
    component, (*shape, N).
    """

    t: int
    seeds: Array
    running: Array
    seen: Any
    state: State


class Actor(Protocol):
    """A policy in many episodes; what it draws is a function of an episode's seed and of the step."""

    name: str
    task: Task
    """What is acted in; its state may have the memory of an expert in it."""

    def act(self, now: Now) -> Any:
        """Actions (N, *shape), as the environment takes them."""

    @property
    def value(self) -> Return | None:
        """The expected return where it is known exactly."""


def actor_of(task: Task, policy: Any) -> Actor:
    """The actor of a policy's name, of `model.py:fn`, of a function, or of an object with `predict`.

    Raises:
        SpecError: E713 for what is no policy; see `exact.scoring.named.named` and `data.functions.function_of`.
    """
    if isinstance(policy, str) and not is_function(policy):
        return _Knowing(named(task, policy))
    name = policy if isinstance(policy, str) else getattr(policy, "__name__", type(policy).__name__)
    found = function_of(policy) if isinstance(policy, str) else policy
    if hasattr(found, "predict"):
        return _Predicting(task, name, found)
    if callable(found):
        return _Reacting(task, name, found)
    unknown(name, ("a function of the observation", "an object with `predict`"))


class _Knowing:
    """A named policy, which knows the state."""

    def __init__(self, policy: Named) -> None:
        self.task, self.policy, self.name, self.layout = policy.task, policy, policy.name, action_layout(policy.task)

    def act(self, now: Now) -> Any:
        words = draws.lanes_block(now.seeds, draws.POLICY, now.t, self.policy.words)
        return packed(self.layout, self.task, self.policy.act(now.state, now.t, words), len(now.seeds))

    @property
    def value(self) -> Return | None:
        return self.policy.value


def packed(layout: SpaceLayout, task: Task, chosen: Any, lanes: int) -> Array:
    """Actions by component, (*shape, lanes), as the environment takes them: (lanes, *shape)."""
    held = Values.empty(layout, lanes)
    write(layout, held.segments(), [np.asarray(chosen[c.name]) for c in task.action], np.arange(lanes))
    return np.array(held.view())


class _Reacting:
    """A function from one observation to one action; where it has a parameter `rng`, it is given a generator."""

    value = None

    def __init__(self, task: Task, name: str, function: Any) -> None:
        self.task, self.name, self.function = task, name, function
        self.draws = "rng" in inspect.signature(function).parameters

    def act(self, now: Now) -> Any:
        running = np.flatnonzero(now.running)
        chosen = np.array([self._one(now, int(i)) for i in running])
        actions = np.repeat(
            chosen[:1], len(now.seeds), axis=0
        )  # what is done in episodes that are over does not matter
        actions[running] = chosen
        return actions

    def _one(self, now: Now, lane: int) -> Any:
        seen = one_of(now.seen, lane)
        if not self.draws:
            return self.function(seen)
        return self.function(seen, rng=np.random.Generator(np.random.Philox(key=[int(now.seeds[lane]), now.t])))


class _Predicting:
    """An object with `predict(observations)`, as models of Stable-Baselines3 are; it is asked for its most likely actions."""

    value = None

    def __init__(self, task: Task, name: str, policy: Any) -> None:
        self.task, self.name, self.policy, self.memory = task, name, policy, None
        self.takes = frozenset(inspect.signature(policy.predict).parameters)

    def act(self, now: Now) -> Any:
        options: dict[str, Any] = {}
        if "deterministic" in self.takes:
            options["deterministic"] = True
        if "state" in self.takes and now.t:
            options["state"] = self.memory
        if "episode_start" in self.takes:
            options["episode_start"] = np.full(len(now.seeds), now.t == 0)
        answer = self.policy.predict(now.seen, **options)
        actions, self.memory = answer if isinstance(answer, tuple) else (answer, None)
        return actions


def one_of(seen: Any, lane: int) -> Any:
    """The observation of one lane, as the scalar environment gives it."""
    if isinstance(seen, dict):
        return {name: one_of(part, lane) for name, part in seen.items()}
    return seen[lane].copy() if seen.ndim > 1 else seen[lane].item()
