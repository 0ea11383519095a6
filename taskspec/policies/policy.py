"""The protocol of policies, and what all of them share: batches of episodes, random draws, and tables of probabilities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np

from taskspec import draws
from taskspec.base.arrays import Array
from taskspec.lang.ir import Role
from taskspec.model.model import Model
from taskspec.rollout.rollout import State
from taskspec.scores.returns import Return
from taskspec.solve.backward import Plan
from taskspec.task.spaces import SpaceLayout, pack_many
from taskspec.task.task import Task

Actions = Mapping[str, Array]
"""Actions by component, (*shape, N)."""
Asking = Literal["probabilities", "actions", "samples"]
"""What the value of a policy rests on: its probabilities of actions, its actions if they never vary, or simulated episodes."""
TIE = 1e-9
"""Values of actions this close, as a share of the largest, are tied."""


class Randomness(Protocol):
    """Random numbers for one step of N episodes."""

    def words(self, count: int) -> Array:
        """Return random words uint32 (count, N)."""

    def generator(self, lane: int) -> np.random.Generator:
        """Return the generator of one episode."""


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
    draws: Randomness
    running: Array


@dataclass(frozen=True, slots=True)
class Tabulated:
    """A policy on an exact model: probabilities of actions at each time, and what they rest on."""

    plan: Plan
    asked: Asking


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
    index: Array = np.minimum((rising <= uniform * rising[-1]).sum(axis=0), len(rising) - 1)
    return index


def greedy(values: Array) -> Array:
    """Return the probabilities (..., A) of the greedy policy of values (..., A), uniform over tied actions."""
    high = values.max(axis=-1, keepdims=True)
    best = values >= high - TIE * np.maximum(np.abs(high), 1)
    found: Array = best / best.sum(axis=-1, keepdims=True)
    return found


def observation_of(observations: Any, lane: int) -> Any:
    """Return the observation (or action) of one lane in the format of the scalar environment."""
    if isinstance(observations, dict):
        return {name: observation_of(part, lane) for name, part in observations.items()}
    return observations[lane].copy() if observations.ndim > 1 else observations[lane].item()


def states_of(model: Model) -> State:
    """Return all states of a model by component, (*shape, S)."""
    return {name: value for (role, name), value in model.reads().items() if role is Role.STATE}
