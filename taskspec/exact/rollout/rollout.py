"""Episodes of many lanes at once, from the same random words as the environments.

Lane i of seed s walks the trajectory of the scalar environment with seed s + i.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NoReturn

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.limits import limits, tell
from taskspec.base.named import all_names
from taskspec.exact.model.model import refuse
from taskspec.exact.model.points import BYTES, Budget, Cost, columns, sampled
from taskspec.language import draws
from taskspec.language.expressions.batch import DTYPES, evaluate
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.types import TIME, Expression, Kind, Role, total_size
from taskspec.language.expressions.variates import WordLayout, batch_sampler
from taskspec.language.task.legal import legal_at_random
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task

Key = tuple[Role, str]
State = dict[str, Array]
Choose = Callable[[State, int, np.random.Generator], Mapping[str, Array]]
"""A function from the state by component and the time to actions by component, (*shape, lanes)."""


@dataclass(frozen=True)
class Moved:
    """The result of a step in every lane."""

    state: State
    reward: Array
    terminal: Array


STEPS_AHEAD = 16
WORDS_AHEAD = 16_384
"""Random words drawn together, at most, unless a single step takes more."""


class Rollout:
    """Steps a task's array form. Arrays are (*shape, lanes)."""

    def __init__(self, task: Task, lanes: int, seed: int = 0) -> None:
        self.task = task
        self.lanes = lanes
        self.seeds = draws.lane_seeds(seed, lanes)
        self._depth = max(1, min(STEPS_AHEAD, WORDS_AHEAD // max(1, lanes * task.step_words.count)))
        self._ahead = range(0)  # the steps whose words are drawn
        self._words_ahead: Array = np.empty((0, 0, lanes), np.uint32)  # (count, steps, lanes)

    @property
    def words(self) -> int:
        """Random words that a step or a start takes in one lane."""
        return max(self.task.reset_words.count, self.task.step_words.count)

    def start(self, episode: int = 0) -> State:
        words = draws.lanes_block(self.seeds, draws.RESET, episode, self.task.reset_words.count)
        values = self._values(self.task.process.initial, {}, self.task.reset_words, words)
        return dict(zip(all_names(self.task.state), values, strict=True))

    def step(self, state: State, action: Mapping[str, Array], t: int, steps: int | None = None) -> Moved:
        """Return one step at time t; `steps` counts those since the seed was set (t in the first episode)."""
        words = self._step_words(t if steps is None else steps)
        roots = (*self.task.process.next, self.task.process.reward, self.task.process.terminal)
        *following, reward, terminal = self._values(roots, reads_of(state, action, t), self.task.step_words, words)
        return Moved(dict(zip(state, following, strict=True)), reward, terminal)

    def _step_words(self, step: int) -> Array:
        """Return the random words of a step, uint32 (count, lanes); those of the steps after it are drawn with them."""
        if step not in self._ahead:
            self._ahead = range(step, step + self._depth)
            first = np.full(self.lanes, step, np.uint32)
            words = draws.lanes_ahead(self.seeds, first, self._depth, self.task.step_words.count)
            self._words_ahead = words.reshape(-1, self._depth, self.lanes)
        return self._words_ahead[:, step - self._ahead.start]

    def _values(
        self, roots: Sequence[Expression], reads: Mapping[Key, Array], layout: WordLayout, words: Array
    ) -> list[Array]:
        values = evaluate(roots, reads, batch_sampler(layout, words))
        return [_spread(v, self.lanes) for v in values]


def reads_of(state: Mapping[str, Array], action: Mapping[str, Array], t: int) -> dict[Key, Array]:
    reads: dict[Key, Array] = {(Role.STATE, name): value for name, value in state.items()}
    reads |= {(Role.ACTION, name): value for name, value in action.items()}
    reads[TIME] = np.array([t], dtype=np.int64)
    return reads


def alone(c: Component, value: Any) -> Array:
    """Return a value of a component, or its label, as that of one lane, (*shape, 1)."""
    if c.domain is not None and isinstance(value, str):
        value = c.domain.labels.index(value)
    return np.array(value, DTYPES[c.type.kind]).reshape(*c.type.shape, 1)


def is_bounded(task: Task) -> bool:
    """Tell whether every action has both ends, so that there are uniformly random ones."""
    ends: list[float] = []
    for c in task.action:
        ends += [*c.low, *c.high]
    return all(map(math.isfinite, ends))


def at_random(task: Task) -> Choose:
    """Return random actions like those of `action_space.sample()`: uniform, where a range has both ends; only legal ones."""

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        if task.mask:
            return legal_at_random(task, state, rng.integers(0, 2**32, lanes, dtype=np.uint32))
        return {c.name: uniform(c, lanes, rng) for c in task.action}

    return choose


def uniform(c: Component, lanes: int, rng: np.random.Generator) -> Array:
    """Return random values of a component, (*shape, lanes): uniform where its range has both ends.

    As in Gymnasium's `Box`, they are standard normal where there is no end, and an exponential of mean 1 from the only end.
    """
    rows: list[Array] = []
    for low, high in zip(c.low, c.high, strict=True):
        if c.is_finite:
            row: Array = rng.integers(int(low), int(high) + 1, lanes)
        elif math.isfinite(low) and math.isfinite(high):
            row = rng.uniform(low, high, lanes)
        elif math.isfinite(low):
            row = low + rng.exponential(1.0, lanes)
        elif math.isfinite(high):
            row = high - rng.exponential(1.0, lanes)
        else:
            row = rng.standard_normal(lanes)
        rows.append(row)
    values: Array = np.array(rows).reshape(*c.type.shape, lanes)
    if c.type.kind is Kind.REAL:
        return values
    return np.asarray(np.rint(values).astype(DTYPES[c.type.kind]))


def by_expert(task: Task) -> Choose:
    """Return the actions of an expert given by expressions."""
    assert isinstance(task.annotations.expert, tuple)
    layout = WordLayout.of(task.annotations.expert)

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        return expert_actions(task, state, t, layout, rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32))

    return choose


def expert_actions(task: Task, state: State, t: int, layout: WordLayout, words: Array) -> Mapping[str, Array]:
    """Return actions by component, (*shape, N), of an expert given by expressions, from random words uint32 (count, N)."""
    assert isinstance(task.annotations.expert, tuple)
    values = evaluate(task.annotations.expert, reads_of(state, {}, t), batch_sampler(layout, words))
    pairs = zip(task.action, values, strict=True)
    return {c.name: _spread(v, words.shape[-1]) for c, v in pairs}


LANES = 64
STEPS = 60
MANY_STEPS = 1000
HELD = 0.25  # nominal seconds for the episodes of constant actions


@dataclass(frozen=True)
class Visited:
    """States of some episodes, with actions and times: of one step after the other, each with whether episodes end there."""

    parts: Sequence[tuple[bool, Mapping[Key, Array]]]

    @cached_property
    def acting(self) -> Mapping[Key, Array]:
        """The states in which episodes act."""
        return columns([reads for is_end, reads in self.parts if not is_end])

    @cached_property
    def entered(self) -> Mapping[Key, Array]:
        """These, and the states in which episodes end."""
        return columns([reads for _, reads in self.parts])


def visited(task: Task) -> Visited:
    """Return states of episodes that act at random, by holding on to an action, and by the expert."""
    rng = np.random.default_rng(0)
    far = _affordable(task)
    rounds = max(1, far // max(STEPS, task.horizon or far))
    everyone = [(sampled_actions(task), STEPS, LANES), (_held(task), far // rounds, LANES * rounds)]
    if isinstance(task.annotations.expert, tuple) and task.annotations.memory is None:
        everyone.append((by_expert(task), STEPS, LANES))
    size = total_size((*task.state, *task.action))
    numbers = size * sum(steps * lanes for _, steps, lanes in everyone)
    share = min(1.0, limits().megabytes * 1e6 / (BYTES * numbers))
    parts: list[tuple[bool, Mapping[Key, Array]]] = []
    for choose, steps, lanes in everyone:
        parts += _episodes(task, choose, max(1, int(share * lanes)), steps, rng)
    return Visited(parts)


def _affordable(task: Task) -> int:
    """Return the number of steps for constant actions, which lead far: more than for others if steps are cheap."""
    cost = Cost((*task.process.next, task.process.reward, task.process.terminal), simulated=True)
    return max(STEPS, min(MANY_STEPS, int(HELD / cost.seconds(LANES))))


def _episodes(
    task: Task, choose: Choose, lanes: int, most: int, rng: np.random.Generator
) -> Iterator[tuple[bool, Mapping[Key, Array]]]:
    """Yield the reads of each step of episodes with `most` steps together, then those of the lanes that end in it."""
    rollout = Rollout(task, lanes)
    state = rollout.start()
    going = np.ones(lanes, np.bool_)
    t = 0
    episode = 0
    for steps in range(most):
        chosen = choose(state, t, rng)
        action = {c.name: _within(c, chosen[c.name]) for c in task.action}
        yield False, _picked(reads_of(state, action, t), going)
        moved = rollout.step(state, action, t, steps)
        ended = going & (moved.terminal | (t + 1 == task.horizon))
        if ended.any():
            yield True, _picked(reads_of(moved.state, action, t + 1), ended)
        going = going & ~ended
        state = {n: np.where(going, moved.state[n], state[n]) for n in state}
        t = t + 1
        if not going.any() or not all(np.isfinite(v).all() for v in state.values()):
            episode += 1
            state = rollout.start(episode)
            going = np.ones(lanes, np.bool_)
            t = 0


def _picked(reads: Mapping[Key, Array], lanes: Array) -> dict[Key, Array]:
    picked = {}
    for key, values in reads.items():
        picked[key] = _spread(values, len(lanes))[..., lanes]
    return picked


def _spread(values: Array, lanes: int) -> Array:
    if values.shape[-1] == lanes:
        return values
    return np.broadcast_to(values, (*values.shape[:-1], lanes))


def entered(task: Task, reads: Mapping[Key, Array], ends: bool, rng: np.random.Generator) -> dict[Key, Array]:
    """Return the next states of reads that stay in the state space, and their times.

    A step that ends the episode counts with `ends` alone: a state that only such steps lead to is one that no episode acts in.
    """
    roots = (*task.process.raw_next, task.process.terminal)
    lanes = max(v.shape[-1] for v in reads.values())
    layout = WordLayout.of(roots)
    words = rng.integers(0, 2**32, (layout.count, lanes), dtype=np.uint32)
    *following, terminal = evaluate(roots, reads, batch_sampler(layout, words))
    given = {c.read: v for c, v in zip(task.state, following, strict=True)}
    given[TIME] = reads[TIME] + 1
    going = np.broadcast_to(ends | ~terminal, (lanes,))
    for c in task.state:
        value = given[c.read]
        low, high = (np.reshape(ends, (*c.type.shape, 1)) for ends in (c.low, c.high))
        inside = (value >= low) & (value <= high)
        going = going & inside.reshape(-1, inside.shape[-1]).all(axis=0)
    if task.horizon is not None:
        going = going & (given[TIME] < task.horizon + ends)
    return _picked(given, going)


def _within(c: Component, values: Array) -> Array:
    """Clip actions to the action space: an expert that is not checked yet may leave it."""
    if c.type.kind is Kind.BOOL or (not c.is_finite and c.type.kind is Kind.INT):
        return values
    low = np.array(c.low, values.dtype).reshape(*c.type.shape, 1)
    high = np.array(c.high, values.dtype).reshape(*c.type.shape, 1)
    return np.clip(values, low, high)


def _held(task: Task) -> Choose:
    actions = sampled_actions(task)
    chosen: Mapping[str, Array] = {}

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        nonlocal chosen
        if t == 0:
            chosen = actions(state, t, rng)
        return chosen

    return choose


def sampled_actions(task: Task) -> Choose:
    """Return actions over the whole range and at its ends; a range without an end is cut."""

    def choose(state: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        lanes = next(iter(state.values())).shape[-1]
        return {c.name: sampled(c, lanes, rng) for c in task.action}

    return choose


EPISODES = 1000
LONGEST = 20_000  # steps after which an episode without a horizon is taken never to end
UNENDING = 2_000  # steps after which episodes are given up if hardly any of them has ended
WORDS = 4_000_000  # random words that a batch of episodes may take for one step
CUT = 1e-12  # the weight of a reward (a power of the discount) at which simulated episodes are cut off


def simulate(task: Task, choose: Choose, episodes: int = EPISODES, seed: int = 0) -> Array:
    """Return the returns float64 (N,) of episodes, discounted. Episode i has the environment's seed `seed + i`."""
    if task.process.never_ends and task.discount == 1 and (task.horizon is None or task.horizon > LONGEST):
        _refuse_endless(task, LONGEST)
    parts = []
    expert = task.annotations.expert_nodes
    start = Cost(task.process.initial, simulated=True)
    step = Cost((*task.process.next, task.process.reward, task.process.terminal, *expert), simulated=True)
    lanes = step.batch(min(episodes, WORDS // max(1, Rollout(task, 1).words)))
    budget = Budget(f"{episodes:,} episodes")
    for first in range(0, episodes, lanes):
        some = min(lanes, episodes - first)
        budget.spend(start, some)
        parts.append(_simulate(task, choose, some, seed + first, partial(budget.spend, step, some)))
    return np.concatenate(parts)


def _simulate(task: Task, choose: Choose, lanes: int, seed: int, spend: Callable[[], None]) -> Array:
    rollout = Rollout(task, lanes, seed)
    rng = np.random.default_rng(seed)
    state = rollout.start()
    returns = np.zeros(lanes)
    running = np.ones(lanes, np.bool_)
    weight = 1.0
    t = 0
    is_undiscounted = task.horizon is None and task.discount == 1
    while running.any() and (task.horizon is None or t < task.horizon):
        spend()
        tell(f"{lanes:,} episodes, step {t + 1:,}")
        moved = rollout.step(state, choose(state, t, rng), t)
        with np.errstate(over="ignore", invalid="ignore"):  # a return that no float holds is infinite, or nan
            returns += np.where(running, weight * moved.reward, 0.0)
        running = running & ~moved.terminal
        state = {n: np.where(running, moved.state[n], state[n]) for n in state}
        weight *= task.discount
        t += 1
        if weight < CUT:
            break
        if t == UNENDING and is_undiscounted:  # judged by those that ended before
            is_lasting = running.mean() ** (LONGEST / UNENDING) * lanes >= 1
            if is_lasting:
                _refuse_endless(task, t)
        if running.any() and t >= LONGEST:
            _refuse_endless(task, t)
    return returns


def _refuse_endless(task: Task, steps: int) -> NoReturn:
    hint = "choose a smaller horizon"
    if task.horizon is None:
        hint = "give the task a horizon, or a discount below 1"
    refuse(f"episodes are still running after {steps:,} steps", hint)


def return_range(task: Task) -> tuple[float, float]:
    """Return bounds of the return of an episode, from bounds of the reward."""
    weight = math.inf  # sum of gamma**t over the longest episode
    if task.horizon is not None:
        weight = float(task.horizon)
    gap = 1 - task.discount
    if gap == 1:
        weight = 1.0
    elif gap > 0:
        weight = -math.expm1(weight * math.log1p(-gap)) / gap  # 1 - gamma**steps would cancel for gamma near 1
    ends = list(map(float, bounds(task.process.reward, {})))
    if task.process.always_ends:
        weight = 1.0  # the first step ends the episode
    elif not task.process.never_ends:
        ends.append(0.0)
    low = 0.0
    if min(ends):
        low = weight * min(ends)
    high = 0.0
    if max(ends):
        high = weight * max(ends)
    cut = 0.0
    if gap:
        cut = CUT * max(abs(low), abs(high))
    return low - 1e-9 * abs(low) - cut, high + 1e-9 * abs(high) + cut  # by more than the rounding error of sums
