"""Episodes of many lanes at once, from the same random words as the environments.

Lane i of seed s walks the trajectory of the scalar environment with seed s + i.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec import draws
from taskspec.exact.model.cost import BYTES
from taskspec.exact.simulation.points import columns, sampled
from taskspec.lang.batch import evaluate
from taskspec.lang.ir import Node, Role
from taskspec.lang.types import Kind
from taskspec.lang.variates.layout import WordLayout
from taskspec.lang.variates.sample import batch_sampler
from taskspec.limits import limits
from taskspec.task.task import Component, Task

Array = np.ndarray[Any, Any]
Key = tuple[Role, str]
State = dict[str, Array]
Choose = Callable[[State, int, np.random.Generator], Mapping[str, Array]]
"""Gives actions by name, (*shape, lanes), from the state by name and the time."""


@dataclass(frozen=True)
class Moved:
    """The result of a step in every lane."""

    state: State
    reward: Array
    terminal: Array


class Rollout:
    """Steps a task's array form. Arrays are (*shape, lanes)."""

    def __init__(self, task: Task, lanes: int, seed: int = 0) -> None:
        self.task, self.lanes = task, lanes
        self.seeds = draws.lane_seeds(seed, lanes)

    @property
    def words(self) -> int:
        """Random words that a step or a start takes in one lane."""
        return max(self.task.reset_words.count, self.task.step_words.count)

    def start(self, episode: int = 0) -> State:
        words = draws.lanes_block(self.seeds, draws.RESET, episode, self.task.reset_words.count)
        values = self._values(self.task.initial, {}, self.task.reset_words, words)
        return dict(zip((c.name for c in self.task.state), values, strict=True))

    def step(self, state: State, action: Mapping[str, Array], t: int, steps: int | None = None) -> Moved:
        """One step at time t; `steps` counts those since the seed was set (t in the first episode)."""
        words = draws.lanes_block(self.seeds, draws.STEP, t if steps is None else steps, self.task.step_words.count)
        roots = (*self.task.next, self.task.reward, self.task.terminal)
        *following, reward, terminal = self._values(roots, reads_of(state, action, t), self.task.step_words, words)
        return Moved(dict(zip(state, following, strict=True)), reward, terminal)

    def _values(
        self, roots: Sequence[Node], reads: Mapping[Key, Array], layout: WordLayout, words: Array
    ) -> list[Array]:
        found = evaluate(roots, reads, batch_sampler(layout, words))
        return [np.broadcast_to(v, (*v.shape[:-1], self.lanes)) for v in found]


def reads_of(state: Mapping[str, Array], action: Mapping[str, Array], t: int) -> dict[Key, Array]:
    found: dict[Key, Array] = {(Role.STATE, name): value for name, value in state.items()}
    found |= {(Role.ACTION, name): value for name, value in action.items()}
    found[Role.TIME, "t"] = np.array([t], dtype=np.int64)
    return found


def at_random(task: Task) -> Choose:
    """Uniformly random actions, of a range with ends."""

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        return {c.name: uniform(c, lanes, rng) for c in task.action}

    return choose


def uniform(c: Any, lanes: int, rng: np.random.Generator) -> Array:
    """Uniform values of a component, (*shape, lanes)."""
    rows: list[Array] = []
    for low, high in zip(c.low, c.high, strict=True):
        if c.is_finite:
            rows.append(rng.integers(int(low), int(high) + 1, lanes))
        else:
            rows.append(rng.uniform(low, high, lanes))
    values = np.array(rows) if c.type.shape else rows[0]
    kind = {0: np.bool_, 1: np.int64, 2: np.float64}[int(c.type.kind)]
    return values.reshape(*c.type.shape, lanes).astype(kind)


def by_expert(task: Task) -> Choose:
    """The actions of an expert given by expressions."""
    experts = task.expert
    assert isinstance(experts, tuple)

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        layout = WordLayout.of(experts)
        words = rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32)
        values = evaluate(experts, reads_of(state, {}, t), batch_sampler(layout, words))
        return {c.name: np.broadcast_to(v, (*v.shape[:-1], lanes)) for c, v in zip(task.action, values, strict=True)}

    return choose


LANES, STEPS = 64, 60


def visited(task: Task) -> Mapping[Key, Array]:
    """States, actions and times of a few episodes: at random, by holding on to an action, and by the expert."""
    parts = []
    rng = np.random.default_rng(0)
    acts = isinstance(task.expert, tuple) and task.memory is None
    everyone = [sampled_actions(task), _held(task)] + ([by_expert(task)] if acts else [])
    numbers = sum(c.type.size for c in (*task.state, *task.action))
    lanes = max(1, min(LANES, int(limits().megabytes * 1e6 / (BYTES * numbers * STEPS * len(everyone)))))
    for choose in everyone:
        rollout = Rollout(task, lanes)
        state = rollout.start()
        for t in range(min(STEPS, STEPS if task.horizon is None else task.horizon)):
            chosen = choose(state, t, rng)
            action = {c.name: _within(c, chosen[c.name]) for c in task.action}
            parts.append(reads_of(state, action, t) | {(Role.TIME, "t"): np.full(lanes, t)})
            moved = rollout.step(state, action, t)
            if moved.terminal.all() or not _are_numbers(moved.state):
                break
            state = {n: np.where(moved.terminal, state[n], moved.state[n]) for n in state}
    return columns(parts)


def _within(c: Component, values: Array) -> Array:
    """Actions as the environment takes them: an expert that is yet to be looked at may give others."""
    if c.type.kind is Kind.BOOL or (not c.is_finite and c.type.kind is Kind.INT):
        return values
    low, high = (np.array(ends, values.dtype).reshape(*c.type.shape, 1) for ends in (c.low, c.high))
    return np.clip(values, low, high)


def _held(task: Task) -> Choose:
    """One action for each lane, the same at all times: it drives states to where they end up."""
    actions = sampled_actions(task)
    chosen: list[Mapping[str, Array]] = []

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        if not chosen:
            chosen.append(actions(state, t, rng))
        return chosen[0]

    return choose


def sampled_actions(task: Task) -> Choose:
    """Actions over the whole range and at its ends; a range without an end is cut."""

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        return {c.name: sampled(c, lanes, rng) for c in task.action}

    return choose


def _are_numbers(state: State) -> bool:
    return all(np.isfinite(v).all() for v in state.values())
